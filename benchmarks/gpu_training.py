"""What training a 7B model on screenshots takes of one GPU: answers, optimiser steps, memory.

    python benchmarks/gpu_training.py

The model has the shape of UI-TARS-1.5-7B (Qwen2.5-VL-7B) and random weights: time and memory do
not depend on their values. The settings are the paper's (section 5): 1920x1080 screenshots, 4
rollouts a task, AdamW; all weights are trained, in bfloat16, with gradient checkpointing. Answers
come from transformers; a server such as vLLM gives them faster. Without a GPU it measures nothing;
`--tiny` runs the same code on a small model anywhere.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import torch
from common import machine, table
from transformers import Qwen2_5_VLConfig, Qwen2_5_VLForConditionalGeneration

ROLLOUTS = 4  # of one task, the paper's rollout_n
ANSWER = 128  # tokens: a thought and an action
PATCH = 14  # pixels
MERGED = 2  # patches a side that become one token
GRID = (78, 138)  # patches of a 1920x1080 screenshot, resized to multiples of 28 pixels: 1932x1092
TINY_GRID = (4, 6)
PICTURES = (1, 5, 10)  # in the history of one sequence; an episode of the paper has 10 steps
IMAGE_TOKEN = 151655
START_TOKEN = 151652
TEXT_TOKEN = 100
GIB = 2**30


def shape(tiny: bool) -> Qwen2_5_VLConfig:
    """Return the shape of the 7B model, or of a tiny one."""
    text = {
        "vocab_size": 152064,
        "hidden_size": 3584,
        "intermediate_size": 18944,
        "num_hidden_layers": 28,
        "num_attention_heads": 28,
        "num_key_value_heads": 4,
        "max_position_embeddings": 128000,
        "rope_parameters": {
            "rope_type": "default",
            "rope_theta": 1e6,
            "mrope_section": [16, 24, 24],
        },
    }
    vision = {
        "depth": 32,
        "hidden_size": 1280,
        "intermediate_size": 3420,
        "num_heads": 16,
        "out_hidden_size": 3584,
        "fullatt_block_indexes": [7, 15, 23, 31],
    }
    if tiny:
        text |= {
            "hidden_size": 256,
            "intermediate_size": 128,
            "num_hidden_layers": 2,
            "num_attention_heads": 2,
            "num_key_value_heads": 1,
        }
        vision |= {
            "depth": 2,
            "hidden_size": 64,
            "intermediate_size": 96,
            "num_heads": 2,
            "out_hidden_size": 256,
            "fullatt_block_indexes": [1],
        }
    return Qwen2_5_VLConfig(
        text_config=text,
        vision_config=vision,
        image_token_id=IMAGE_TOKEN,
        vision_start_token_id=START_TOKEN,
    )


def prompt(
    pictures: int, rows: int, grid: tuple[int, int], device: torch.device
) -> dict[str, torch.Tensor]:
    """Return random inputs of `rows` equal sequences: text, then each picture and an answer."""
    tokens = grid[0] * grid[1] // MERGED**2
    turn = [START_TOKEN] + [IMAGE_TOKEN] * tokens + [TEXT_TOKEN] * ANSWER
    ids = torch.tensor([TEXT_TOKEN] * 400 + turn * pictures, device=device).repeat(rows, 1)
    patches = rows * pictures * grid[0] * grid[1]
    values = torch.randn(patches, 3 * 2 * PATCH**2, device=device, dtype=torch.bfloat16)
    grid_shapes = torch.tensor([[1, *grid]], device=device).repeat(rows * pictures, 1)
    return {
        "input_ids": ids,
        "attention_mask": torch.ones_like(ids),
        "mm_token_type_ids": (ids == IMAGE_TOKEN).int(),
        "pixel_values": values,
        "image_grid_thw": grid_shapes,
    }


class Clock:
    """Times work on the device, from idle to idle."""

    def __init__(self, device: torch.device) -> None:
        self.device = device

    def __call__(self, work: Callable[[], Any]) -> float:
        """Run `work` and return its seconds."""
        self._wait()
        start = time.perf_counter()
        work()
        self._wait()
        return time.perf_counter() - start

    def peak(self) -> float:
        """Return the GiB that were held at most since the last call."""
        if self.device.type != "cuda":
            return 0.0
        value = torch.cuda.max_memory_allocated() / GIB
        torch.cuda.reset_peak_memory_stats()
        return value

    def _wait(self) -> None:
        if self.device.type == "cuda":
            torch.cuda.synchronize()


def answer_rows(model: Any, grid: tuple[int, int], clock: Clock) -> list[list[str]]:
    """Time four answers at once, each to its own history."""
    rows: list[list[str]] = []
    model.eval()
    for pictures in PICTURES:
        inputs = prompt(pictures, ROLLOUTS, grid, clock.device)

        def answer(tokens: int, inputs: dict[str, torch.Tensor] = inputs) -> object:
            with torch.inference_mode():
                return model.generate(
                    **inputs,
                    min_new_tokens=tokens,
                    max_new_tokens=tokens,
                    do_sample=True,
                    temperature=1.0,
                )

        answer(2)
        clock.peak()
        first = clock(lambda answer=answer: answer(1))
        answer_seconds = clock(lambda answer=answer: answer(ANSWER))
        rate = ROLLOUTS * (ANSWER - 1) / max(answer_seconds - first, 1e-9)
        row = [
            str(pictures),
            str(inputs["input_ids"].shape[1]),
            f"{first:.2f}",
            f"{rate:.0f}",
            f"{answer_seconds:.1f}",
            f"{clock.peak():.1f}",
        ]
        rows.append(row)
    return rows


def training_rows(model: Any, grid: tuple[int, int], clock: Clock) -> list[list[str]]:
    """Time the gradient of one rollout, and the optimiser's step on all weights."""
    rows: list[list[str]] = []
    model.train()
    model.gradient_checkpointing_enable()
    optimizer = torch.optim.AdamW(model.parameters(), lr=1e-6, fused=clock.device.type == "cuda")
    for pictures in PICTURES:
        inputs = prompt(pictures, 1, grid, clock.device)
        kept = pictures * ANSWER

        def gradient(inputs: dict[str, torch.Tensor] = inputs, kept: int = kept) -> None:
            out = model(**inputs, use_cache=False, logits_to_keep=kept + 1)
            scores = out.logits[0, :-1].float()
            target = inputs["input_ids"][0, -kept:]
            loss = torch.nn.functional.cross_entropy(scores, target)
            (loss / ROLLOUTS).backward()

        try:
            gradient()
            optimizer.step()
            clock.peak()
            backward = clock(gradient)
            step = clock(optimizer.step)
        except torch.cuda.OutOfMemoryError:
            rows.append([str(pictures), str(inputs["input_ids"].shape[1]), *["no memory"] * 4])
            break
        finally:
            optimizer.zero_grad(set_to_none=True)
        row = [
            str(pictures),
            str(inputs["input_ids"].shape[1]),
            f"{backward:.2f}",
            f"{step:.2f}",
            f"{ROLLOUTS * backward + step:.1f}",
            f"{clock.peak():.1f}",
        ]
        rows.append(row)
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tiny", action="store_true", help="a small model, on any machine")
    tiny = parser.parse_args().tiny
    if not torch.cuda.is_available() and not tiny:
        print("Not measured: this machine has no GPU.")
        return
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    grid = TINY_GRID if tiny else GRID
    name = torch.cuda.get_device_name() if device.type == "cuda" else "CPU"
    torch.set_default_dtype(torch.bfloat16)
    with device:
        model = Qwen2_5_VLForConditionalGeneration(shape(tiny))
    weights = sum(parameter.numel() for parameter in model.parameters())
    clock = Clock(device)
    print(f"{name}; {weights / 1e9:.2f} billion weights in bfloat16.\n\n{machine()}\n")
    head = [
        "pictures in the history",
        "tokens",
        "to the first token, s",
        "tokens/s",
        "whole answer, s",
        "peak GiB",
    ]
    print(f"{ROLLOUTS} answers of {ANSWER} tokens at once, by transformers.\n")
    print(table(head, answer_rows(model, grid, clock)))
    head = [
        "pictures in the history",
        "tokens",
        "gradient of a rollout, s",
        "AdamW step, s",
        f"step of {ROLLOUTS} rollouts, s",
        "peak GiB",
    ]
    print("\nTraining all weights, one rollout at a time, gradients added up.\n")
    print(table(head, training_rows(model, grid, clock)))


if __name__ == "__main__":
    main()
