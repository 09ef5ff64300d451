"""Supervised fine-tuning on exports, with TRL's `SFTTrainer`."""
