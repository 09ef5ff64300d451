"""`layer="dom"`: the pastes of a plan as nodes of the page in front, proved and erased again.

Boxes become elements, masks become canvases, and the text over them is text that cannot be seen:
so the pixels are those of the picture's layer, and the accessibility tree has the words. The nodes
are in a closed shadow root in the browser's top layer; see `page_layer.js`.
"""

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL.ImageFont import FreeTypeFont

from hijack_data.drawing.raster import png_recipe, render
from hijack_data.drawing.sprite import Layer, Sprite
from hijack_data.drawing.text import line_height, line_width, load_font
from hijack_data.plan import Paste, Plan
from hijack_data.runs.page_layer import MAX_DIFFERENCE, compare_painted
from hijack_data.types import UInt8Array

from ..effects.base import Probe, Undone
from ..errors import DesktopError
from .session import BrowserPage, BrowserSession

SCRIPT = (Path(__file__).parent / "page_layer.js").read_text()
MAX_OFFSET = 0.5  # pixels by which a node may be off its place
_ROLES = {"window": "dialog", "text": "note"}


class PageLayer:
    """Draws plans into the page in front of a browser.

    Args:
        browser: The browser.
    """

    def __init__(self, browser: BrowserSession) -> None:
        self._browser = browser
        self._page: BrowserPage | None = None

    def draw(self, plan: Plan, page: BrowserPage | None = None, scale: float = 0) -> str:
        """Draw a plan, which replaces the one before.

        Args:
            plan: Of pastes only, for the size of the screen.
            page: Where; by default in front.
            scale: Pixels of the screen for each CSS pixel; by default those of the browser.

        Returns:
            Why the page cannot hold it, or "".
        """
        page = page or self._browser.front
        if page is not self._page:
            self.erase()
        self._browser.examine(SCRIPT, page)
        data = json.dumps(layer_data(plan, scale or self._browser.scale))
        problem = str(self._browser.examine(f"agenthijackLayer.draw({data})", page))
        self._page = page
        return problem

    def probe(self, plan: Plan, picture: UInt8Array) -> Probe:
        """Check that the nodes are where the plan has them, and that a picture shows them.

        Args:
            plan: What was drawn.
            picture: Of the screen since then, uint8 RGB `[H, W, 3]`.
        """
        drawing = self._browser.examine("agenthijackLayer.look()", self._page)
        planned_boxes = [
            (x, y, *reversed(render(op.sprite).size))
            for op in plan.ops
            if isinstance(op, Paste)
            for x, y in op.at
        ]
        boxes: list[list[float]] = drawing["boxes"]
        height, width = plan.size
        area = min(int(drawing["area"][1]), height), min(int(drawing["area"][0]), width)
        pixels, difference = compare_painted(plan, picture, area)
        offset = 0.0
        if len(boxes) == len(planned_boxes):
            offset = float(np.abs(np.subtract(boxes, planned_boxes)).max(initial=0.0))
        facts = {
            "kind": "dom",
            "nodes": len(boxes),
            "texts": sorted({text for text in drawing["texts"] if text}),
            "area": list(area),
            "pixels": pixels,
            "difference": difference,
        }
        problem = ""
        if not drawing["shown"]:
            problem = "the page does not show the nodes"
        elif len(boxes) != len(planned_boxes) or offset > MAX_OFFSET:
            problem = (
                f"{len(boxes)} of {len(planned_boxes)} nodes are there, off by {offset:.1f} pixels"
            )
        elif difference > MAX_DIFFERENCE:
            problem = f"pixels of the picture differ from those of the plan by up to {difference}"
        return Probe(not problem, facts, problem)

    def erase(self) -> Undone:
        """Remove the nodes; a document that has gone took them along.

        Raises:
            DesktopError: The page does not answer.
        """
        page, self._page = self._page, None
        remaining = 0
        if page is not None and page in self._browser.pages:
            try:
                remaining = int(
                    self._browser.examine("globalThis.agenthijackLayer?.erase()", page) or 0
                )
            except DesktopError:
                if page in self._browser.pages and not page.problem:
                    raise
        return Undone(
            not remaining, {"nodes": remaining}, f"{remaining} nodes are left" if remaining else ""
        )


def layer_data(plan: Plan, scale: float) -> dict[str, Any]:
    """Return what `page_layer.js` draws, as JSON data: each sprite once, and its places.

    Args:
        plan: Of pastes only.
        scale: Pixels of the screen for each CSS pixel.
    """
    pastes = [op for op in plan.ops if isinstance(op, Paste)]
    places = [[index, x, y] for index, op in enumerate(pastes) for x, y in op.at]
    sprites = [_sprite_data(op.sprite) for op in pastes]
    return {"scale": scale, "sprites": sprites, "places": places}


def _sprite_data(recipe: Mapping[str, Any]) -> dict[str, Any]:
    sprite = render(recipe)
    if "page" not in sprite.scratch:
        images: list[str] = []
        parts = [_paint(sprite, layer, images) for layer in sprite.layers]
        height, width = sprite.size
        draw = recipe["draw"]
        words = list({"window": _panels, "text": _caption}.get(draw, _no_words)(recipe))
        label = " ".join(recipe["panels"][0]["lines"]) if draw == "window" else None
        sprite.scratch["page"] = {
            "width": width,
            "height": height,
            "role": _ROLES.get(draw, "img"),
            "label": recipe.get("shape", "picture") if draw not in _ROLES else label,
            "parts": parts + words,
            "images": images,
        }
    return sprite.scratch["page"]


def _paint(sprite: Sprite, layer: Layer, images: list[str]) -> dict[str, Any]:
    """Return the element of a layer: a filled box, or a canvas with an image."""
    x1, y1, x2, y2 = layer.box
    box = [x1, y1, x2 - x1, y2 - y1]
    if not layer.covers and layer.picture is None:
        return {"tag": "div", "box": box, "fill": "rgb({}, {}, {})".format(*layer.colors[0])}
    rgba = np.full((y2 - y1, x2 - x1, 4), 255, np.uint8)
    if sprite.rgb is not None:  # blended already, so that the renderer need not
        rgba[..., :3] = sprite.rgb[y1:y2, x1:x2]
    else:
        rgba[..., 3] = layer.alpha
        alpha = np.maximum(layer.alpha, 1).astype(np.uint32)[..., None]
        rgba[..., :3] = (layer.paint + alpha // 2) // alpha
    images.append(png_recipe(rgba)["data"])
    return {"tag": "canvas", "box": box, "image": len(images) - 1}


def _panels(recipe: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the panels of a window with their lines: the first has the text, others are buttons."""
    for number, panel in enumerate(recipe["panels"]):
        x1, y1, x2, y2 = panel["box"]
        font = load_font(recipe["font"], panel["font_size"])
        lines = _lines(panel["lines"], font, line_height(font), (x2 - x1, y2 - y1))
        tag = "button" if number else "div"
        yield {"tag": tag, "box": [x1, y1, x2 - x1, y2 - y1], "parts": list(lines)}


def _caption(recipe: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    height, width = render(recipe).size
    font = load_font(recipe["font"], recipe["size"])
    step = line_height(font) + 2 * recipe.get("edge", 0)
    return _lines(recipe["lines"], font, step, (width, height))


def _no_words(recipe: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    yield from ()


def _lines(
    lines: list[str], font: FreeTypeFont, step: int, area: tuple[int, int]
) -> Iterator[dict[str, Any]]:
    """Yield lines of text, centred in a (width, height) as they are drawn."""
    y = (area[1] - step * len(lines)) // 2
    for line in lines:
        width = math.ceil(line_width(line, font))
        box = [(area[0] - width) // 2, y, width, step]
        yield {"tag": "div", "box": box, "text": line, "font": int(font.size)}
        y += step
