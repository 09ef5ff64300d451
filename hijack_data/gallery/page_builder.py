"""Build the page: plan and apply every corruption on every picture, and collect the results."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from .._apply import apply
from ..composites import Composite, composite, is_bare
from ..elements import scene_from
from ..errors import HijackError, ImageError, quantity
from ..picture_io import load_image
from ..plan import CLEAN, Plan
from ..planner import Planner
from ..safety import judge
from ..types import UInt8Array
from .data_uris import caption, embed, scale_for
from .markup import Html, clean, fill, join, script_json, source, source_hash, wrap
from .tiles import GalleryPicture, Tile, message_tile, painted, tile

Detect: TypeAlias = Literal["picture", "ocr", "none"]


def sample_id(path: str | os.PathLike[str]) -> str:
    """Return the sample id of a picture file: its name, without the folder."""
    return clean(Path(path).name)


@dataclass
class PageBuilder:
    """Builds the page: `add` each picture, then call `html`."""

    planners: Mapping[str, Planner]
    seed: int
    detect: Detect
    width: int
    problems: list[str] = field(default_factory=list[str])
    _pictures: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    _tiles: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    _styles: list[str] = field(default_factory=list[str])
    _sections: list[Html] = field(default_factory=list[Html])

    @property
    def readable(self) -> int:
        """The number of pictures that could be read."""
        return len(self._pictures)

    def add(self, path: str | os.PathLike[str]) -> None:
        """Read a picture and put its section on the page."""
        name = sample_id(path)
        try:
            image, notes = load_image(path)
        except ImageError as error:
            message = _short(error, path)
            self.problems.append(clean(f"{name}: {message}"))
            body = message_tile("not readable", message, None)
            section = fill("picture.html", name=name, facts="", notes=Html(), tiles=body)
            self._sections.append(section)
            return
        shot = self._shot(name, image)
        tiles: list[Html] = []
        for number, (title, planner) in enumerate(self.planners.items()):
            tiles.append(self._tile(number, title, planner, shot, image))
        lines = wrap("p", [_short(note, path) for note in notes])
        size = caption([shot.scene.size], shot.scale)
        facts = (
            f"{size}; {quantity(len(shot.scene.boxes), 'element')} {_DETECTION_TEXT[self.detect]}"
        )
        section = fill("picture.html", name=name, facts=facts, notes=lines, tiles=join(tiles))
        self._sections.append(section)

    def _shot(self, name: str, image: UInt8Array) -> GalleryPicture:
        scene = scene_from(image, detect=self.detect)
        scale = scale_for(scene.size, self.width)
        shot = GalleryPicture(
            index=len(self._pictures),
            name=name,
            scene=scene,
            scale=scale,
            seed=self.seed,
            detected=self.detect == "picture",
        )
        height, width = scene.size
        self._pictures.append({"size": [width, height], "boxes": scene.boxes.tolist()})
        self._styles.append(
            f".p{shot.index}{{--w:{width};--r:{width / height:.6f}}}"
            f".p{shot.index} .before{{background-image:url({embed(image, scale).uri})}}"
        )
        return shot

    def _tile(
        self, number: int, title: str, planner: Planner, shot: GalleryPicture, image: UInt8Array
    ) -> Html:
        try:
            corruption_plan = planner.plan(shot.scene, seed=self.seed, sample=shot.name)
            composited = self._composite(corruption_plan, shot, image)
            plan = composited.plan if composited else corruption_plan
            after = apply(plan, image)
        except HijackError as error:
            return self._message(title, number, shot, str(error))
        if not plan.ops:
            return self._unchanged(title, number, shot, plan)
        safety = judge(plan, image, after, boxes=shot.scene.boxes)
        rectangles = painted(plan)
        self._tiles.append(
            {"picture": shot.index, "covered": list(safety.covered), "painted": rectangles}
        )
        new_tile = Tile(
            index=len(self._tiles) - 1,
            title=title,
            number=number,
            plan=plan,
            safety=safety,
            after=embed(after, shot.scale),
            painted=rectangles,
            corruption_plan=corruption_plan,
            composited=composited,
        )
        return tile(new_tile, shot)

    def _composite(self, plan: Plan, shot: GalleryPicture, image: UInt8Array) -> Composite | None:
        """Return the picture of an effect on the machine, or `None` for any other plan."""
        if not is_bare(plan):
            return None
        return composite(plan, image, shot.scene, seed=self.seed, sample=shot.name)

    def _unchanged(self, title: str, number: int, shot: GalleryPicture, plan: Plan) -> Html:
        if plan.corruption == CLEAN:
            return message_tile(title, "left clean", number)
        reason = "; ".join(plan.notes) or "the plan changes nothing"
        return self._message(title, number, shot, reason)

    def _message(self, title: str, number: int, shot: GalleryPicture, message: str) -> Html:
        self.problems.append(clean(f"{shot.name}: {title}: {message}"))
        return message_tile(title, message, number)

    def html(self) -> str:
        """Return the finished page."""
        style = Html(source("page.css") + "".join(self._styles))
        script = Html(source("page.js"))
        pictures = quantity(len(self._sections), "picture")
        corruptions = quantity(len(self.planners), "corruption")
        filters: list[Html] = []
        for number, title in enumerate(self.planners):
            filters.append(fill("filter.html", number=number, title=title))
        return fill(
            "page.html",
            style=style,
            style_hash=source_hash(style),
            script=script,
            script_hash=source_hash(script),
            facts=f"{pictures}, {corruptions}, seed {self.seed}",
            problems=self._problem_list(),
            filters=join(filters),
            pictures=join(self._sections),
            version=_version(),
            detect=self.detect,
            data=script_json({"pictures": self._pictures, "tiles": self._tiles}),
        )

    def _problem_list(self) -> Html:
        if not self.problems:
            return Html()
        return fill(
            "problems.html",
            title=quantity(len(self.problems), "problem"),
            items=wrap("li", self.problems),
        )


_DETECTION_TEXT = {
    "picture": "found in the picture",
    "ocr": "found by OCR",
    "none": "(not looked for)",
}


def _short(message: object, path: str | os.PathLike[str]) -> str:
    """Return a message without the path of its file, because the page may be shared."""
    name = Path(path).name
    return str(message).replace(str(path), name).removeprefix(f"{name}: ")


def _version() -> str:
    from .. import __version__

    return __version__
