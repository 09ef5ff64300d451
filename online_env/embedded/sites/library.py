"""Articles written in Markdown with a YAML head, and their HTML.

Raw HTML in an article stays text.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any, cast

import yaml
from markdown_it import MarkdownIt

from .pages import HERE


@dataclass(frozen=True)
class Article:
    """One file of `content/`: its name, its head (title and whatever else) and its Markdown."""

    slug: str
    head: Mapping[str, Any]
    body: str

    @property
    def title(self) -> str:
        """The title in the head."""
        return self.head["title"]


@dataclass(frozen=True)
class Rendered:
    """HTML of a text, and its second-level headings as `(anchor, title)`."""

    html: str
    headings: tuple[tuple[str, str], ...]


def load(name: str) -> Any:
    """Return the data in `content/NAME.yaml`."""
    path = HERE / "content" / f"{name}.yaml"
    return _parse(path.read_bytes())


def _parse(text: str | bytes) -> Any:
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load(text, loader)


@cache
def articles(folder: str) -> dict[str, Article]:
    """Return the articles of `content/FOLDER`, by slug.

    They come in the order that their heads ask for, then by slug.
    """
    pages: list[Article] = []
    for path in sorted((HERE / "content" / folder).glob("*.md")):
        _, head, body = path.read_text("utf-8").split("---\n", 2)
        fields = cast("dict[str, Any]", _parse(head))
        pages.append(Article(path.stem, fields, body.strip()))
    pages.sort(key=lambda article: (article.head.get("order", 0), article.slug))
    return {article.slug: article for article in pages}


@cache
def _markdown() -> MarkdownIt:
    return MarkdownIt("commonmark", {"html": False}).enable("table")


def anchor(title: str) -> str:
    """`"Back up a laptop"` is `"back-up-a-laptop"`."""
    return re.sub(r"\W+", "-", title.lower()).strip("-")


@lru_cache(maxsize=128)
def render(text: str) -> Rendered:
    """Markdown (CommonMark and tables) as HTML; every heading gets an anchor."""
    tokens = _markdown().parse(text)
    headings: list[tuple[str, str]] = []
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            opening.attrSet("id", anchor(inline.content))
            if opening.tag == "h2":
                headings.append((anchor(inline.content), inline.content))
        elif opening.type == "fence":
            opening.attrSet("tabindex", "0")
    return Rendered(_markdown().renderer.render(tokens, _markdown().options, {}), tuple(headings))


def plain(text: str) -> str:
    """Return the words of a Markdown text, without its marks, on one line."""
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", " ", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(
        r"^\s*(#+|[-*>]|[0-9]+\.|```.*|\|[-| :]+\|)(\s+|$)|\|", " ", text, flags=re.MULTILINE
    )
    text = re.sub(r"[`*]", "", text)
    return " ".join(text.split())
