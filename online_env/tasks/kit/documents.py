"""Text documents of Writer: made, read and compared on our side."""

import io
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .office import OfficeTask, plain

_WORD = "{http://schemas.openxmlformats.org/wordprocessingml/2006/main}"
_NUMBERING = "http://schemas.openxmlformats.org/officeDocument/2006/relationships/numbering"
_DEFAULTS = " defaults"  # no style has such an id
_FALLBACK = "{http://schemas.openxmlformats.org/markup-compatibility/2006}Fallback"
_DRAWN = ("drawing", "pict", "object")
_LINE = 240  # units in a line
_COVER = "\0"  # stands for what is not bold
_VALUED = ("sz", "color")
_MARKS = ("i", "u", "strike", "highlight", "shd", "vertAlign", *_VALUED)
_UNMARKED = ("false", "0", "none", "off", "auto", "baseline")


@dataclass(frozen=True, kw_only=True)
class ParagraphContent:
    """What a paragraph holds.

    Args:
        text: Its text, with straight quotation marks, and without space at its end.
        style: The name of its style, such as `Heading 1`.
        bold: The parts of the text that are bold, apart from what the style says, without the
            space around them.
        marks: What else was given to parts of it, such as `i` (italic), `sz 28` (14 points) or
            `color FF0000`.
        marker: What stands before an item of a list, such as `bullet` or `decimal`; "" if it is
            no item.
        spacing: Its line spacing in lines, that of its style included; 0 if it is in points.
        alignment: Its alignment, such as `center`; "" if it is at the left, or its style says it.
    """

    text: str
    style: str = "Normal"
    bold: tuple[str, ...] = ()
    marks: tuple[str, ...] = ()
    marker: str = ""
    spacing: float = 1.0
    alignment: str = ""


@dataclass(frozen=True, kw_only=True)
class TextContent:
    """What a text document holds.

    Args:
        paragraphs: The paragraphs of the text, without those of tables.
        tables: The rows of each table, as texts of cells.
        headers: The text at the top of the pages, one a section.
        footers: The text at the bottom of the pages, one a section.
        landscape: Whether the pages lie on their long side, one a section.
        sizes: The width and height of the pages in inches, one a section.
        after_table: The text below the last table, "" if there is no table.
        pictures: How many pictures, drawings and embedded objects it has.
    """

    paragraphs: tuple[ParagraphContent, ...]
    tables: tuple[tuple[tuple[str, ...], ...], ...] = ()
    headers: tuple[str, ...] = ()
    footers: tuple[str, ...] = ()
    landscape: tuple[bool, ...] = ()
    sizes: tuple[tuple[float, float], ...] = ()
    after_table: str = ""
    pictures: int = 0


class TextTask(OfficeTask):
    """A task on one text document, which is open in Writer at the start."""

    library = "docx"

    def load(self, data: bytes) -> Any:
        """Return a document of python-docx."""
        import docx

        return docx.Document(io.BytesIO(data))

    def content(self, data: bytes) -> TextContent:
        """Return what a text document holds."""
        return read_text(data)


def document(title: str, paragraphs: Sequence[str]) -> Any:
    """Return a document of python-docx with a title and paragraphs."""
    import docx

    made = docx.Document()
    made.add_heading(title, 0)
    for text in paragraphs:
        made.add_paragraph(text)
    return made


def read_text(data: bytes) -> TextContent:
    """Return what a text document holds.

    Raises:
        KeyError: It is a zip file of another kind.
        ValueError: It cannot be read.
    """
    import docx

    found = docx.Document(io.BytesIO(data))
    styles = _styles(found)
    paragraphs = [_paragraph(paragraph, styles) for paragraph in found.paragraphs]
    while len(paragraphs) > 1 and not paragraphs[-1].text:
        paragraphs.pop()
    return TextContent(
        paragraphs=tuple(paragraphs),
        tables=tuple(
            tuple(tuple(plain(cell.text) for cell in row.cells) for row in table.rows)
            for table in found.tables
        ),
        headers=tuple(_text(section.header) for section in found.sections),
        footers=tuple(_text(section.footer) for section in found.sections),
        landscape=tuple(_is_landscape(section) for section in found.sections),
        sizes=tuple(_size(section) for section in found.sections),
        after_table=_after_table(found),
        pictures=_pictures(found),
    )


def text_changes(now: TextContent, before: TextContent, but: Collection[str] = ()) -> Iterator[str]:
    """Yield what differs between two documents, except for some.

    Empty paragraphs at the end count as nothing.

    Args:
        now: The document as it is.
        before: The document as it should be.
        but: Attributes of `TextContent` and `ParagraphContent` that may differ.
    """
    yield from _paragraph_changes(now.paragraphs, before.paragraphs, but)
    for name in ("tables", "headers", "footers", "landscape", "pictures"):
        found = getattr(now, name)
        wanted = getattr(before, name)
        if name not in but and found != wanted:
            yield f"the {name} are {found!r}, not {wanted!r}"


def changed(content: TextContent, text: str, /, **changes: Any) -> TextContent:
    """Return a document in which the paragraph of a text is another one.

    Args:
        content: The document.
        text: The whole text of the paragraph.
        **changes: Attributes of `ParagraphContent`.
    """
    paragraphs = [
        replace(paragraph, **changes) if paragraph.text == text else paragraph
        for paragraph in content.paragraphs
    ]
    return replace(content, paragraphs=tuple(paragraphs))


def find_paragraph(found: Any, text: str) -> Any:
    """Return the paragraph of a python-docx document that has a text.

    Raises:
        ValueError: There is none.
    """
    for paragraph in found.paragraphs:
        if paragraph.text == text:
            return paragraph
    raise ValueError(f"the document has no paragraph {text!r}")


def remove_paragraph(found: Any, text: str) -> None:
    """Remove the paragraph of a python-docx document that has a text."""
    element = find_paragraph(found, text)._element
    element.getparent().remove(element)


def _paragraph_changes(
    now: Sequence[ParagraphContent], before: Sequence[ParagraphContent], but: Collection[str]
) -> Iterator[str]:
    if len(now) != len(before):
        yield f"the document has {len(now)} paragraphs, not {len(before)}"
        return
    for number, (found, wanted) in enumerate(zip(now, before, strict=True), 1):
        for name in ("text", "style", "bold", "marks", "marker", "spacing", "alignment"):
            is_same = getattr(found, name) == getattr(wanted, name)
            if name not in but and not is_same:
                yield (
                    f"the {name} of paragraph {number} is {getattr(found, name)!r}, "
                    f"not {getattr(wanted, name)!r}"
                )


def _paragraph(found: Any, styles: Mapping[str, Any]) -> ParagraphContent:
    used = styles[found._element.style or ""]
    return ParagraphContent(
        text=plain(found.text),
        style=used.name_val[:1].upper() + used.name_val[1:],  # files say `heading 1`
        bold=_bold(found),
        marks=_marks(found),
        marker=_marker(found, styles),
        spacing=_spacing(found, styles),
        alignment=_alignment(found),
    )


def _alignment(found: Any) -> str:
    element = found._element.find(f"{_WORD}pPr/{_WORD}jc")
    name = "" if element is None else element.get(f"{_WORD}val")
    # LibreOffice's other docx says `start` and `end`, which python-docx does not know.
    return {"left": "", "start": "", "end": "right"}.get(name, name)


def _spacing(found: Any, styles: Mapping[str, Any]) -> float:
    """Return the line spacing, in lines, that a paragraph or its style has."""
    for element in (*_sources(found, styles), styles[_DEFAULTS]):
        spacing = element.find(f"{_WORD}pPr/{_WORD}spacing")
        if spacing is None:
            continue
        line = spacing.get(f"{_WORD}line")
        if line is not None:
            is_in_points = spacing.get(f"{_WORD}lineRule") in ("exact", "atLeast")
            return 0.0 if is_in_points else round(int(line) / _LINE, 2)
    return 1.0


def _styles(found: Any) -> dict[str, Any]:
    """Return the elements of all styles by their ids; "" is the default of paragraphs."""
    styles: dict[str, Any] = {_DEFAULTS: found.styles.element.find(f".//{_WORD}pPrDefault")}
    for element in found.styles.element.iter(f"{_WORD}style"):
        styles[element.get(f"{_WORD}styleId")] = element
        is_default = element.get(f"{_WORD}default") in ("1", "true")
        if is_default and element.get(f"{_WORD}type") == "paragraph":
            styles[""] = element
    return styles


def _marker(found: Any, styles: Mapping[str, Any]) -> str:
    """Return the format of the numbers of a list that a paragraph or its style is in."""
    for element in _sources(found, styles):
        number = element.find(f"{_WORD}pPr/{_WORD}numPr/{_WORD}numId")
        if number is None:
            continue
        wanted = number.get(f"{_WORD}val")
        if not any(rel.reltype == _NUMBERING for rel in found.part.rels.values()):
            return ""  # python-docx would try to make the list
        numbering = found.part.numbering_part.element
        for entry in numbering.iter(f"{_WORD}num"):
            if entry.get(f"{_WORD}numId") == wanted:
                abstract = entry.find(f"{_WORD}abstractNumId").get(f"{_WORD}val")
                return _format(numbering, abstract)
        return ""  # the number 0 takes a paragraph out of a list
    return ""


def _format(numbering: Any, abstract: str) -> str:
    """Return the format of the first level of a list, such as `bullet`."""
    for entry in numbering.iter(f"{_WORD}abstractNum"):
        if entry.get(f"{_WORD}abstractNumId") == abstract:
            found = entry.find(f".//{_WORD}numFmt")
            name = "" if found is None else found.get(f"{_WORD}val")
            return "" if name == "none" else name
    return ""


def _sources(found: Any, styles: Mapping[str, Any]) -> Iterator[Any]:
    """Yield the elements that may say that a paragraph is an item: it, and its styles."""
    yield found._element
    style = styles.get(found._element.style or "")
    while style is not None:
        yield style
        base = style.find(f"{_WORD}basedOn")
        style = None if base is None else styles.get(base.get(f"{_WORD}val"))


def _is_landscape(section: Any) -> bool:
    return section.page_width > section.page_height


def _size(section: Any) -> tuple[float, float]:
    return round(section.page_width.inches, 2), round(section.page_height.inches, 2)


def _after_table(found: Any) -> str:
    """Return the text below the last table."""
    texts: list[str] = []
    has_table = False
    for element in found.element.body:
        if element.tag == f"{_WORD}tbl":
            has_table = True
            texts = []
        elif has_table:
            texts.append("".join(part.text or "" for part in element.iter(f"{_WORD}t")))
    return "\n".join(texts).strip()


def _bold(found: Any) -> tuple[str, ...]:
    """Return the bold parts of a paragraph; space between two of them does not count."""
    shown = ""
    for run in found.runs:
        is_bold = run.style.font.bold if run.bold is None else run.bold
        shown += run.text if is_bold else re.sub(r"\S", _COVER, run.text)
    parts = (plain(part).strip() for part in shown.split(_COVER))
    return tuple(part for part in parts if part)


def _marks(found: Any) -> tuple[str, ...]:
    marks: set[str] = set()
    for run in found.runs:
        for name in _MARKS:
            element = run._element.find(f"{_WORD}rPr/{_WORD}{name}")
            if element is None or not run.text.strip():
                continue
            value = element.get(f"{_WORD}fill") or element.get(f"{_WORD}val", "true")
            if value in _UNMARKED:
                continue
            marks.add(f"{name} {value}" if name in _VALUED else name)
    return tuple(sorted(marks))


def _pictures(found: Any) -> int:
    """Count what is drawn, without what a file holds once more for old programs."""
    drawn = sum(1 for name in _DRAWN for _ in found.element.body.iter(f"{_WORD}{name}"))
    again = sum(
        1
        for other in found.element.body.iter(_FALLBACK)
        for name in _DRAWN
        for _ in other.iter(f"{_WORD}{name}")
    )
    return drawn - again


def _text(part: Any) -> str:
    return plain("\n".join(paragraph.text for paragraph in part.paragraphs)).strip()
