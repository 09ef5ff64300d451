"""Subtitle: lines of text at an edge of the screen, as music and video players show.

The paper's Algorithm "Subtitle".
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..drawing.text import check_glyphs, largest_fitting, load_font, measure, overhang
from ..errors import FontError, ParameterError
from ..params import param
from ..plan import Paste
from ..rng import Stream
from ..types import Scene, size_text

TEXT = "QQ MUSIC, LISTEN TO WHAT YOU WANT\n------CHOOSE a SONG to PLAY------"


@register
@dataclass(frozen=True)
class Subtitle(Corruption):
    """Writes outlined lines of text at the top, centre or bottom of the screen."""

    name: ClassVar[str] = "subtitle"
    category: ClassVar[Category] = "visual_disruptor"
    scope: ClassVar[Scope] = "observation"
    version: ClassVar[int] = 2  # 2: edge_width=0 draws no edge
    paper: ClassVar[str] = "Algorithm 4 (Subtitle)"
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"font_size": 24},
        {"font_size": 36},
        {},
        {"font_size": 64, "fit": "shrink"},
        {"font_size": 80, "fit": "shrink"},
    )

    subtitle_text: str = param(TEXT, "The lines, separated by a line break")
    position: str = param("bottom", "Where the lines stand", choices=("bottom", "top", "center"))
    font_size: int = param(48, "Font size in pixels", low=1, high=2000)
    font_path: str = param(
        "DejaVuSansMono-Bold", "A bundled font's name or the path of a font file"
    )
    edge_color: str = param("black", "Colour of the outline", kind="color")
    color: str = param("white", "Colour of the letters", kind="color")
    padding: int = param(40, "Distance to the edge of the screen in pixels", low=0, high=100_000)
    edge_width: int = param(
        2, "Thickness of the outline in pixels; not in the paper's table", low=0, high=64
    )
    fit: str = param(
        "error", "What to do when the lines do not fit the screen", choices=("error", "shrink")
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            load_font(self.font_path, self.font_size)
        except FontError as error:
            raise FontError(f"subtitle.font_path: {error}") from None
        check_glyphs("".join(self._lines()), self.font_path, "subtitle.subtitle_text")

    def _lines(self) -> list[str]:
        return self.subtitle_text.replace("\t", "    ").split("\n")

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Measure the lines, centre them and put them `padding` pixels from the edge."""
        if not self.subtitle_text.strip():
            return Draft(notes=("subtitle_text is empty: nothing is written",))
        lines = self._lines()
        size = self._size(lines, scene)
        font = load_font(self.font_path, size)
        width, height = measure(lines, font, self.edge_width)
        screen_h, screen_w = scene.size
        tops = {
            "top": self.padding,
            "center": (screen_h - height) // 2,
            "bottom": screen_h - height - self.padding,
        }
        recipe: dict[str, Any] = {
            "draw": "text",
            "lines": lines,
            "font": self.font_path,
            "size": size,
            "color": self.color,
            "edge_color": self.edge_color,
            "edge": self.edge_width,
        }
        shrunk = (
            f"font_size {self.font_size} was shrunk to {size} to fit {size_text(scene.size)}",
        )
        margin = 0 if self.edge_width else overhang(lines, font)
        if margin:
            recipe["margin"] = margin
        corner = ((screen_w - width) // 2 - margin, tops[self.position] - margin)
        return Draft(
            ops=(Paste(recipe, (corner,)),), notes=shrunk if size != self.font_size else ()
        )

    def _size(self, lines: list[str], scene: Scene) -> int:
        """Return the font size to use; raise `ParameterError` when the lines do not fit.

        Raises:
            ParameterError: a value is out of its range; the message names it.
        """
        screen_h, screen_w = scene.size
        room_w = screen_w - 2 * self.edge_width
        room_h = (
            screen_h
            - (0 if self.position == "center" else self.padding)
            - 2 * self.edge_width * len(lines)
        )
        best = largest_fitting(lines, self.font_path, room_w, room_h, self.font_size)
        if best is not None and (best == self.font_size or self.fit == "shrink"):
            return best
        advice = f"the largest font_size that fits is {best}" if best else "no font_size fits"
        raise ParameterError(
            f"subtitle.subtitle_text does not fit {size_text(scene.size)} at font_size"
            f" {self.font_size} with padding {self.padding}: {advice}; shorten the text, or set"
            " fit='shrink'"
        )
