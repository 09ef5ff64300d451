"""The pages of the repository as pages of the site.

They stay plain Markdown that reads well beside the code. Here only what a site needs is changed:
links that leave docs/, and the words after a fence's language, which are for the tests.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Pages from outside docs/, and what they are called on the site.
OUTSIDE = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/RESULTS.md": "results.md",
}
_FENCE = re.compile(r"^( *)```([a-z]+)[^\n`]*$", re.M)
_LINK = re.compile(r"(!?)\[((?:[^\]\[]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def pages() -> dict[str, Path]:
    """The file of each page of the site that is a page of the repository."""
    docs = ROOT / "docs"
    files = sorted([*docs.glob("*.md"), *docs.glob("results/*.md")])
    found = {path.relative_to(docs).as_posix(): path for path in files}
    outside = {name: ROOT / file for file, name in OUTSIDE.items() if name != "index.md"}
    return found | outside


def text_of(
    path: Path,
    site: Mapping[str, str],
) -> str:
    """The text of a page with its links and fences as the site needs them.

    `site` is the address on the site of each file of the repository that is on it.
    """
    text = _FENCE.sub(r"\1```\2", path.read_text(encoding="utf-8"))
    pieces = re.split(r"(^ *```.*?^ *```$)", text, flags=re.S | re.M)
    for number in range(0, len(pieces), 2):
        pieces[number] = _LINK.sub(lambda match: _link(match, path, site), pieces[number])
    return "".join(pieces)


def _link(
    match: re.Match[str],
    path: Path,
    site: Mapping[str, str],
) -> str:
    """A link as it is on the site; one to a file that is not there becomes the file's name."""
    image, words, target = match.groups()
    if "://" in target or target.startswith("#"):
        return match[0]
    file, sign, anchor = target.partition("#")
    name = os.path.relpath(path.parent / file, ROOT)
    own = site.get(os.path.relpath(path, ROOT), "")
    place = site.get(name, "")
    if image and name.startswith(("docs/images/", "docs/results/")):
        place = name.removeprefix("docs/")
    if place:
        return (
            f"{image}[{words}]({os.path.relpath(place, os.path.dirname(own) or '.')}{sign}{anchor})"
        )
    return words if words.startswith("`") else f"{words} (`{name}`)"
