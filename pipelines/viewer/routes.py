"""The answers for each path: the page of a dataset, and that of a run.

Requests never contain file names: rows, episodes and steps are identified by number, and the page's
own files are in a fixed table.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import parse_qsl

from hijack_data.cache import Cache
from hijack_data.errors import HijackError
from hijack_data.gallery.markup import Html

from . import json_answers
from .page_files import RUN_SCRIPTS, page_file, run_page
from .picture_cache import CACHE_BYTES, Pictures, cached_bytes, thumbnail
from .runs import RunSource
from .runs.export import MAX_PAGE_EPISODES, export_page

if TYPE_CHECKING:
    from .dataset_source import DatasetSource

STRIP_SIDE_PX = 240  # pixels of the longest side of a picture in the strip of steps
_ROW_PICTURE = re.compile(r"/(thumb|picture|before)/([0-9]{1,9})")
_RUN_PICTURE = re.compile(r"/(seen|clean|strip)/([0-9]{1,9})/([0-9]{1,6})")
_ROW_SCRIPTS = ("gallery.js", "common.js", "view.js")
_LINKS = Html(
    "\n".join(
        [
            '<link rel="stylesheet" href="view.css">',
            *(f'<script src="{name}"></script>' for name in RUN_SCRIPTS),
        ]
    )
)


@dataclass(frozen=True)
class ViewerAnswer:
    """The body of an answer, its type, and more headers."""

    body: bytes
    kind: str
    headers: Mapping[str, str] = field(default_factory=dict[str, str])


class Pages(Protocol):
    """The interface of the pages that a server serves."""

    title: str
    description: str

    def answer(self, path: str, query: str) -> ViewerAnswer | None:
        """Return the answer to a path, or `None` if there is nothing under it."""
        ...


class RowPages:
    """The page of a dataset."""

    def __init__(self, source: "DatasetSource") -> None:
        self.title = source.title
        self.description = f"{len(source.index)} rows ({source.facts})"
        self._source = source
        self._pictures = Pictures(source)
        self._json_answers: dict[str, Callable[[Mapping[str, str]], Any]] = {
            "/api/about": lambda _: json_answers.about(source),
            "/api/rows": lambda query: json_answers.rows(source, query),
            "/api/row": lambda query: json_answers.row(source, query),
        }

    def answer(self, path: str, query: str) -> ViewerAnswer | None:
        """Return the answer to a path, or `None` if there is nothing under it.

        Raises:
            HijackError: the data for the answer cannot be read.
        """
        if path == "/":
            return ViewerAnswer(page_file("view.html").encode(), "text/html")
        if path in self._json_answers:
            return _json(self._json_answers[path](dict(parse_qsl(query))))
        picture = _ROW_PICTURE.fullmatch(path)
        if picture and self._source.index.at(int(picture[2])) is not None:
            kind = "image/jpeg" if picture[1] == "thumb" else "image/png"
            return ViewerAnswer(self._pictures.get(picture[1], int(picture[2])), kind)
        return _own_file(path, _ROW_SCRIPTS)


class RunPages:
    """The page of a run."""

    def __init__(self, source: RunSource) -> None:
        self.title = source.title
        self.description = source.facts
        self._source = source
        self._thumbnails = Cache(CACHE_BYTES)
        self._json_answers: dict[str, Callable[[Mapping[str, str]], Any]] = {
            "/api/run": lambda _: source.about(),
            "/api/episode": lambda query: source.episode(_number(query)),
            "/api/check": lambda query: source.check(_number(query)),
        }

    def answer(self, path: str, query: str) -> ViewerAnswer | None:
        """Return the answer to a path, or `None` if there is nothing under it.

        Raises:
            HijackError: the data for the answer cannot be read.
        """
        if path == "/":
            return ViewerAnswer(run_page(_LINKS, Html("{}")).encode(), "text/html")
        if path in self._json_answers:
            return _json(self._json_answers[path](dict(parse_qsl(query))))
        if path == "/export":
            return self._export(dict(parse_qsl(query)).get("episodes", ""))
        picture = _RUN_PICTURE.fullmatch(path)
        if picture and int(picture[2]) < len(self._source.entries):
            return self._picture(picture[1], int(picture[2]), int(picture[3]))
        return _own_file(path, RUN_SCRIPTS)

    def _picture(self, kind: str, number: int, step: int) -> ViewerAnswer:
        if kind != "strip":
            data = self._source.picture(number, step, kind == "clean")
            return ViewerAnswer(data, "image/png")
        data = cached_bytes(
            self._thumbnails,
            (number, step),
            lambda: thumbnail(self._source.pixels(number, step, False), STRIP_SIDE_PX),
        )
        return ViewerAnswer(data, "image/jpeg")

    def _export(self, text: str) -> ViewerAnswer:
        parts = [part for part in text.split(",") if part.isascii() and part.isdigit()]
        if not parts or len(parts) > MAX_PAGE_EPISODES:
            raise HijackError(
                f"an export from the page takes 1 to {MAX_PAGE_EPISODES} episodes, not"
                f" {len(parts)}; hijack view RUNS --export FILE --episode PATTERN takes any number"
            )
        page = export_page(self._source, [int(part[:9]) for part in parts])
        name = re.sub(r"[^A-Za-z0-9._-]+", "-", self.title) or "run"
        disposition = f'attachment; filename="{name}-episodes.html"'
        return ViewerAnswer(page.encode(), "text/html", {"Content-Disposition": disposition})


def make_pages(source: "DatasetSource | RunSource") -> Pages:
    """Return the pages of an open folder."""
    return RunPages(source) if isinstance(source, RunSource) else RowPages(source)


def _own_file(path: str, scripts: Sequence[str]) -> ViewerAnswer | None:
    name = path.removeprefix("/")
    if name == "view.css":
        return ViewerAnswer(page_file(name).encode(), "text/css")
    if name in scripts:
        return ViewerAnswer(page_file(name).encode(), "text/javascript")
    return None


def _json(data: Any) -> ViewerAnswer:
    return ViewerAnswer(json.dumps(data).encode(), "application/json")


def _number(query: Mapping[str, str]) -> int:
    text = query.get("number", "")
    if text.isascii() and text.isdigit() and len(text) < 10:
        return int(text)
    raise HijackError(f"there is no episode {text!r} here; give its number from 0")
