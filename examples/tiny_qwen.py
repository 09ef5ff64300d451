"""A Qwen2.5-VL of 100 thousand parameters: the real classes with random weights, no download.

Its tokens are the special ones of Qwen2.5-VL and single characters, so that no tokenizer is needed.
It answers with the point to click as Qwen2.5-VL does, `(x,y)` in pixels of the picture that it
sees, which `smart_resize` decides.
"""

import re
from typing import Any

import numpy as np
import torch
from tiny_vlm import MERGE, Processor
from transformers import Qwen2_5_VLConfig, Qwen2_5_VLForConditionalGeneration

PAD, END, VISION_START, VISION_END, IMAGE, VIDEO = range(6)
FIRST = 6  # tokens from here on are the characters from blank to ~
IGNORED = -100  # label of what is not to be learned


def encode(text: str) -> list[int]:
    """Return the tokens of a text; a character that has none is a question mark."""
    return [FIRST + ord(c if " " <= c <= "~" else "?") - ord(" ") for c in text]


def decode(tokens: list[int]) -> str:
    """Return the text of tokens, without the special ones."""
    return "".join(chr(token - FIRST + ord(" ")) for token in tokens if token >= FIRST)


def answer(point: tuple[int, int]) -> str:
    """Return what the model is to say."""
    return f"({point[0]},{point[1]})"


def read_answer(text: str) -> tuple[int, int] | None:
    """Return the point that a model said, in its own pixels, or `None` where it said none."""
    result = re.search(r"\((\d{1,5}),(\d{1,5})\)", text)
    return (int(result[1]), int(result[2])) if result else None


def build() -> Qwen2_5_VLForConditionalGeneration:
    """Return the model with random weights."""
    text = {
        "vocab_size": FIRST + 95,
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_hidden_layers": 2,
        "num_attention_heads": 2,
        "num_key_value_heads": 1,
        "max_position_embeddings": 1024,
        "eos_token_id": END,
        "bos_token_id": None,
        "pad_token_id": PAD,
        "rope_parameters": {
            "rope_type": "default",
            "rope_theta": 10_000.0,
            "mrope_section": [2, 3, 3],
        },
    }
    vision = {
        "depth": 2,
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_heads": 2,
        "out_hidden_size": 32,
        "fullatt_block_indexes": [1],
    }
    tokens = {
        "image_token_id": IMAGE,
        "video_token_id": VIDEO,
        "vision_start_token_id": VISION_START,
    }
    config = Qwen2_5_VLConfig(
        text_config=text, vision_config=vision, vision_end_token_id=VISION_END, **tokens
    )
    return Qwen2_5_VLForConditionalGeneration(config)


class Collate:
    """Turns samples into the input and the labels of the model.

    A sample has `image` (uint8 `[3, H, W]`), `target` (box) and `instruction`.
    """

    def __init__(self, processor: Processor | None = None) -> None:
        self.processor = processor or Processor()
        if self.processor.theirs is None:
            raise RuntimeError(
                "this example needs the image processor of transformers: pip install transformers"
            )

    def __call__(self, rows: list[dict[str, Any]]) -> dict[str, torch.Tensor]:
        """Return `pixel_values`, `image_grid_thw`, and tokens with the answers as labels."""
        calls = self.processor.theirs(images=[row["image"] for row in rows], return_tensors="pt")
        requests = []
        output = []
        for row, grid in zip(rows, calls["image_grid_thw"].tolist(), strict=True):
            picture = [VISION_START, *[IMAGE] * (int(np.prod(grid)) // MERGE**2), VISION_END]
            requests.append(picture + encode(row["instruction"]))
            output.append([*encode(answer(self.point(row))), END])
        longest = max(len(a) + len(s) for a, s in zip(requests, output, strict=True))
        ids = torch.full((len(rows), longest), PAD)
        labels = torch.full((len(rows), longest), IGNORED)
        for n, (before, after) in enumerate(zip(requests, output, strict=True)):
            whole = len(before) + len(after)
            ids[n, :whole] = torch.tensor(before + after)
            labels[n, len(before) : whole] = torch.tensor(after)
        # 1 where a token is a piece of a picture, which gets a place in two dimensions
        kinds = (ids == IMAGE).int()
        return {
            "input_ids": ids,
            "attention_mask": (ids != PAD).long(),
            "labels": labels,
            "mm_token_type_ids": kinds,
            **calls,
        }

    def point(self, row: dict[str, Any]) -> tuple[int, int]:
        """Return the middle of the target in pixels of the picture that the model sees."""
        x1, y1, x2, y2 = row["target"]
        return self.processor.to_model(
            ((x1 + x2) / 2, (y1 + y2) / 2), tuple(row["image"].shape[1:])
        )
