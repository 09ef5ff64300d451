"""Train a vision model with DA-GRPO in TRL, on the toy desktop or on real ones.

Run it with `python examples/train_trl.py --model Qwen/Qwen3-VL-2B-Instruct`. `--live` takes the
tasks of the suite on embedded desktops instead. Models need a chat template that TRL can render
tools with: Qwen3-VL has one, Qwen2.5-VL has not.
"""

import argparse
import os
from pathlib import Path
from typing import Any

import gymnasium
import yaml

os.environ.setdefault("TRL_EXPERIMENTAL_SILENCE", "1")

from datasets import Dataset
from transformers import AutoModelForImageTextToText, AutoProcessor
from trl import GRPOConfig

import hijack_data as hj
from pipelines.train.adapters.trl_environment import TrlEnvironments, training_rows
from pipelines.train.adapters.trl_trainer import DAGRPOTrainer
from pipelines.train.replay import ReplayBuffer
from pipelines.train.sampler import CorruptionSampler
from pipelines.train.split import members
from pipelines.train.toy.env import ToyEnv
from pipelines.train.toy.settings import load_replication

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "train" / "trl.yaml"
HOW = {
    "toy": "Call the tool with click(x, y), in pixels of the screenshot, or with DONE.",
    "live": "Call the tool with Python code that calls pyautogui, in pixels of the screenshot,"
    " or with WAIT, DONE or FAIL.",
}


def make_live() -> gymnasium.Env[Any, str]:
    """Return an environment on an embedded desktop of its own."""
    return gymnasium.make("online_env:AgentHijack/Embedded-v0", size=(720, 1280), max_steps=10)


def main() -> None:
    """Train, and save the model."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", required=True)
    parser.add_argument("--live", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("runs/trl"))
    parser.add_argument("--config", type=Path, default=CONFIG, help="fields of GRPOConfig")
    parser.add_argument("--tasks", type=int, help="only the first N training tasks")
    options = parser.parse_args()
    kind = "live" if options.live else "toy"
    family = "suite" if options.live else "toy"
    tasks = members(f"{family}/training")[: options.tasks]
    corruptions = [hj.PopUps(), hj.Marks(), hj.Subtitle(), hj.Resolution(), hj.MultiApps()]
    if not options.live:  # the paper's, at the size of the toy's screen
        corruptions = list(load_replication("train/toy").trained.values())
    settings = yaml.safe_load(options.config.read_text())
    args = GRPOConfig(output_dir=str(options.out), **settings)
    environments = TrlEnvironments(
        make_live if options.live else ToyEnv,
        args,
        sampler=CorruptionSampler(hj.OneOf(corruptions), per="rollout", seed=7),
        folder=options.out,
    )
    trainer = DAGRPOTrainer(
        AutoModelForImageTextToText.from_pretrained(options.model),
        args=args,
        train_dataset=Dataset.from_list(training_rows(tasks, HOW[kind])),
        processing_class=AutoProcessor.from_pretrained(options.model),
        environment_factory=environments,
        replay=ReplayBuffer(seed=7),
    )
    trainer.train()
    trainer.save_model(str(options.out / "model"))


if __name__ == "__main__":
    main()
