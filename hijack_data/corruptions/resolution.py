"""Resolution: the screen at another resolution (paper, Algorithm "Resolution")."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..errors import ParameterError
from ..limits import PICTURE_PIXELS
from ..params import param
from ..plan import Paste, Resample
from ..rng import Stream
from ..types import Scene, size_text


@register
@dataclass(frozen=True)
class Resolution(Corruption):
    """Resizes the screenshot; the agent's coordinates are mapped back to the screen."""

    name: ClassVar[str] = "resolution"
    version: ClassVar[int] = 2  # 2: coordinates follow the centres of pixels
    category: ClassVar[Category] = "visual_disruptor"
    scope: ClassVar[Scope] = "observation"
    paper: ClassVar[str] = "Algorithm 2 (Resolution)"
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"scale": 0.9},
        {"scale": 0.75},
        {},
        {"scale": 0.35},
        {"scale": 0.25},
    )

    scale: float = param(0.5, "Factor on both sides; sizes are rounded", low=0.01, high=16)
    restore: bool = param(
        False, "Scale back to the original size, for pipelines that need one shape"
    )

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Resize to the rounded size, and back when `restore` is set.

        Raises:
            ParameterError: a value is out of its range; the message names it.
        """
        height, width = (max(1, int(side * self.scale + 0.5)) for side in scene.size)
        if height * width > PICTURE_PIXELS:
            raise ParameterError(
                f"resolution.scale = {self.scale:g} makes a {width}x{height} picture of"
                f" {size_text(scene.size)}; the limit is {PICTURE_PIXELS} pixels, use a smaller"
                " scale"
            )
        if (height, width) == scene.size:
            return Draft(notes=(f"scale {self.scale:g} leaves {size_text(scene.size)} as it is",))
        ops: tuple[Paste | Resample, ...] = (Resample((height, width)),)
        return Draft(ops=(*ops, Resample(scene.size)) if self.restore else ops)
