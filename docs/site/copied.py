"""The pages of the repository as pages of the site.

They stay plain Markdown that reads well beside the code. Here only what a site needs is changed:
links that leave docs/, the words after a fence's language, which are for the tests, and what GitHub
and MkDocs read differently.
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
_FINDER = """<p class="finder"><label>Search the tasks
<input type="search" placeholder="calc held_out rename"></label>
<span role="status"></span></p>

"""
_FENCE = re.compile(r"^( *)```([a-z]+)[^\n`]*$", re.M)
# Of a console's lines, those without a prompt are coloured as output: ours have none.
_COLOURED_AS = {"console": "sh"}
_ROW_OF_A_TABLE = re.compile(r"^ *\|.*$", re.M)
_CODE = re.compile(r"`[^`]+`")
_ABOUT = re.compile(r"docs/(results/\w+)/about\.md$")
_LINK = re.compile(r"(!?)\[((?:[^\]\[]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def pages() -> dict[str, Path]:
    """The file of each page of the site that is a page of the repository."""
    docs = ROOT / "docs"
    files = sorted([*docs.glob("*.md"), *docs.glob("results/*.md")])
    found = {path.relative_to(docs).as_posix(): path for path in files}
    outside = {name: ROOT / file for file, name in OUTSIDE.items() if name != "index.md"}
    return found | outside


def text_of(path: Path, site: Mapping[str, str]) -> str:
    """The text of a page with its links and fences as the site needs them.

    `site` is the address on the site of each file of the repository that is on it.
    """
    text = plain_fences(path.read_text(encoding="utf-8"))
    pieces = re.split(r"(^ *```.*?^ *```$)", text, flags=re.S | re.M)
    for number in range(0, len(pieces), 2):
        linked = _LINK.sub(lambda match: _link(match, path, site), pieces[number])
        pieces[number] = _ROW_OF_A_TABLE.sub(_row, linked)
    return "".join(pieces)


def searchable_suite(text: str) -> str:
    """The page of the suite with a search, and each first screen once.

    Many tasks of a domain begin on the same screen; its picture stands at the first of them.
    """
    shown: set[bytes] = set()

    def picture(match: re.Match[str]) -> str:
        pixels = (ROOT / "docs" / match[1]).read_bytes()
        if pixels in shown:
            return ""
        shown.add(pixels)
        return match[0] + "{ loading=lazy }"

    text = re.sub(r"!\[First screen of \w+\]\((images/[^)]+)\)", picture, text)
    head, mark, rest = text.partition("| domain | tasks |")
    return head + _FINDER + mark + rest


def plain_fences(text: str) -> str:
    """A text without the words for the tests after the languages of its blocks."""
    return _FENCE.sub(_fence, text)


def _fence(match: re.Match[str]) -> str:
    """The first line of a block, without the words for the tests."""
    indent, language = match.groups()
    return f"{indent}```{_COLOURED_AS.get(language, language)}"


def _row(match: re.Match[str]) -> str:
    r"""A row of a table: in its code, GitHub wants `\|` for a bar, and MkDocs shows the `\`."""
    return _CODE.sub(lambda code: code[0].replace(r"\|", "|"), match[0])


def _link(match: re.Match[str], path: Path, site: Mapping[str, str]) -> str:
    """A link as it is on the site; one to a file that is not there becomes the file's name."""
    image, words, target = match.groups()
    if "://" in target or target.startswith("#"):
        return match[0]
    file, sign, anchor = target.partition("#")
    name = os.path.relpath(path.parent / file, ROOT)
    own = site.get(os.path.relpath(path, ROOT), "")
    place = site.get(name, "")
    about = _ABOUT.match(name)
    if about:  # a part of the page of its folder
        place = f"{about[1]}.md"
    shipped = image or name.endswith(".html")
    if shipped and name.startswith(("docs/images/", "docs/results/")):
        place = name.removeprefix("docs/")
    if place:
        return (
            f"{image}[{words}]({os.path.relpath(place, os.path.dirname(own) or '.')}{sign}{anchor})"
        )
    return words if words.startswith("`") else f"{words} (`{name}`)"
