"""Requests to models in a form that tests can compare."""

import base64
import io

import numpy as np
from PIL import Image

LENGTH = 32  # characters of a text


def outline(messages):
    """Messages as roles and parts: texts are shortened, pictures are the red of their corner."""
    items = []
    for message in messages:
        content = message["content"]
        if isinstance(content, str):
            content = [{"type": "text", "text": content}]
        items.append((message["role"], [_part(part) for part in content]))
    return items


def decode_data_url(data):
    """Return the picture of a data URL, or of base64."""
    content = base64.b64decode(data.rpartition(",")[2])
    return np.asarray(Image.open(io.BytesIO(content)))


def _part(part):
    if part["type"] == "text":
        return part["text"][:LENGTH]
    if part["type"] == "tool_result":
        return [part["tool_use_id"], *map(_part, part["content"])]
    if part["type"] == "tool_use":
        return part["id"]
    data = part["image_url"]["url"] if "image_url" in part else part["source"]["data"]
    return int(decode_data_url(data)[0, 0, 0])
