"""A Qwen3-VL of some hundred thousand random parameters with its real processor, made here.

Nothing is downloaded: the tokenizer has a token for each byte, and Qwen's special tokens. The chat
template is the one that TRL ships, since TRL takes tools only with templates that it knows.
"""

from pathlib import Path
from typing import Any

SPECIAL = [
    "<|endoftext|>",
    "<|im_start|>",
    "<|im_end|>",
    "<|vision_start|>",
    "<|vision_end|>",
    "<|image_pad|>",
    "<|video_pad|>",
]
PLAIN = ["<tool_call>", "</tool_call>", "<tool_response>", "</tool_response>"]
PATCHES = {"patch_size": 16, "temporal_patch_size": 2, "merge_size": 2}


def tokenizer() -> Any:
    """A byte-level tokenizer without merges."""
    from tokenizers import pre_tokenizers
    from transformers import Qwen2Tokenizer

    letters = sorted(pre_tokenizers.ByteLevel.alphabet())
    qwen2_tokenizer = Qwen2Tokenizer(
        vocab={letter: number for number, letter in enumerate(letters)},
        merges=[],
        eos_token="<|im_end|>",
        pad_token="<|endoftext|>",
        unk_token=None,
    )
    qwen2_tokenizer.add_special_tokens({"additional_special_tokens": SPECIAL})
    qwen2_tokenizer.add_tokens(PLAIN)
    return qwen2_tokenizer


def processor(template: str, max_pixels: int = 64 * 64 * 16) -> Any:
    """The processor, whose pictures have at most `max_pixels` pixels."""
    from transformers import Qwen2VLImageProcessor, Qwen3VLProcessor, Qwen3VLVideoProcessor

    images = Qwen2VLImageProcessor(
        **PATCHES, size={"shortest_edge": 32 * 32, "longest_edge": max_pixels}
    )
    videos = Qwen3VLVideoProcessor(**PATCHES)
    qwen3_vlprocessor = Qwen3VLProcessor(images, tokenizer(), videos, chat_template=template)
    qwen3_vlprocessor.tokenizer.chat_template = template
    qwen3_vlprocessor.tokenizer.padding_side = "left"
    return qwen3_vlprocessor


def model(words: Any, seed: int = 0) -> Any:
    """The model; `words` is the tokenizer."""
    import torch
    from transformers import Qwen3VLConfig, Qwen3VLForConditionalGeneration

    torch.manual_seed(seed)
    at = words.convert_tokens_to_ids
    text = {
        "vocab_size": len(words),
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_hidden_layers": 2,
        "head_dim": 16,
        "num_attention_heads": 2,
        "num_key_value_heads": 1,
        "max_position_embeddings": 8192,
        "eos_token_id": at("<|im_end|>"),
        "bos_token_id": None,
        "pad_token_id": at("<|endoftext|>"),
        "rope_parameters": {
            "rope_type": "default",
            "rope_theta": 10_000.0,
            "mrope_section": [4, 2, 2],
            "mrope_interleaved": True,
        },
    }
    vision = {
        "depth": 2,
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_heads": 2,
        "out_hidden_size": 32,
        "patch_size": 16,
        "num_position_embeddings": 256,
        "deepstack_visual_indexes": [0],
    }
    config = Qwen3VLConfig(
        text_config=text,
        vision_config=vision,
        image_token_id=at("<|image_pad|>"),
        video_token_id=at("<|video_pad|>"),
        vision_start_token_id=at("<|vision_start|>"),
        vision_end_token_id=at("<|vision_end|>"),
    )
    return Qwen3VLForConditionalGeneration(config)


def trl_template(name: str = "qwen3_vl") -> str:
    """A chat template that TRL ships."""
    import trl

    return (Path(trl.__file__).parent / "chat_templates" / f"{name}.jinja").read_text()
