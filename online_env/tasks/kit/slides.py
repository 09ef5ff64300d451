"""Presentations of Impress: made, read and compared on our side."""

import io
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..hand import Hand
from ..tree_nodes import TreeNode
from .office import APP, OfficeTask, plain

PLACE_ICON = (89, 71)  # width and height in pixels of what LibreOffice 7.4 shows at an empty place


@dataclass(frozen=True, kw_only=True)
class SlideContent:
    """What a slide holds.

    Args:
        title: Its title, or "".
        texts: The other texts on it.
        notes: What the speaker reads.
        background: The colour of its own background, such as `FFFF00`; "" if it has none.
        drawn: How many pictures, tables, lines and other shapes without a text were put on it.
        marks: Which of `bold`, `italic` and `underlined` parts of its texts were made.
        hidden: Whether it is left out when the slides are shown.
    """

    title: str
    texts: tuple[str, ...] = ()
    notes: str = ""
    background: str = ""
    drawn: int = 0
    marks: tuple[str, ...] = ()
    hidden: bool = False


class SlideTask(OfficeTask):
    """A task on one presentation, which is open in Impress at the start."""

    library = "pptx"

    def load(self, data: bytes) -> Any:
        """Return a presentation of python-pptx."""
        import pptx

        return pptx.Presentation(io.BytesIO(data))

    def content(self, data: bytes) -> tuple[SlideContent, ...]:
        """Return what a presentation holds."""
        return read_slides(data)


def presentation(slides: Sequence[tuple[str, str]]) -> Any:
    """Return a presentation of python-pptx; each slide has a title and a text."""
    import pptx

    made = pptx.Presentation()
    for title, text in slides:
        add_slide(made, title, text)
    return made


def add_slide(made: Any, title: str, text: str = "") -> None:
    """Add a slide at the end of a presentation of python-pptx."""
    slide = made.slides.add_slide(made.slide_layouts[1])
    slide.shapes.title.text = title
    slide.placeholders[1].text = text


def order_slides(made: Any, order: Sequence[int]) -> None:
    """Put the slides of a presentation of python-pptx in another order, or leave some out.

    Args:
        made: The presentation.
        order: The present indices, from 0, in the new order.
    """
    listed = made.slides._sldIdLst
    entries = list(listed)
    for entry in entries:
        listed.remove(entry)
    for index in order:
        listed.append(entries[index])


def read_slides(data: bytes) -> tuple[SlideContent, ...]:
    """Return what the slides of a presentation hold.

    Raises:
        KeyError: It is a zip file of another kind.
        ValueError: It cannot be read.
    """
    import pptx

    return tuple(_slide(slide) for slide in pptx.Presentation(io.BytesIO(data)).slides)


def slide_changes(
    now: Sequence[SlideContent], wanted: Sequence[SlideContent], but: Collection[str] = ()
) -> Iterator[str]:
    """Yield what differs between the slides as they are and as they should be.

    Args:
        now: The slides as they are.
        wanted: The slides as they should be.
        but: Attributes of `SlideContent` that may differ.
    """
    titles = [slide.title for slide in now]
    if "title" not in but and titles != [slide.title for slide in wanted]:
        yield f"the slides are {titles!r}, not {[slide.title for slide in wanted]!r}"
        return
    if len(now) != len(wanted):
        yield f"there are {len(now)} slides, not {len(wanted)}"
        return
    for number, (found, right) in enumerate(zip(now, wanted, strict=True), 1):
        for name in ("texts", "notes", "background", "drawn", "marks", "hidden"):
            if name not in but and getattr(found, name) != getattr(right, name):
                yield f"the {name} of slide {number} are {getattr(found, name)!r}"


def show_slide(hand: Hand, number: int, title: str, *, of: int) -> None:
    """Show a slide by clicking on its small picture.

    Args:
        hand: The hand.
        number: Its number, from 1.
        title: Its title, which is the name of the picture.
        of: How many slides there are.
    """
    hand.click_on("panel", title, app=APP)
    hand.wait(f"slide {number}", _has_text("label", f"Slide {number} of {of}"))


def write_in(hand: Hand, hint: str, text: str) -> None:
    """Write in a field that shows only a hint, and leave it.

    Args:
        hand: The hand.
        hint: What the field shows, such as `Click to add Title`.
        text: The text to write.
    """
    hand.double_click(hand.wait(f"field {hint!r}", _has_text("paragraph", hint)))
    hand.find("paragraph", app=APP, state="focused")
    hand.type(text)
    hand.wait(f"text {text!r}", _has_text("paragraph", text.partition("\n")[0]))
    hand.press("escape")


def _has_text(role: str, text: str) -> Any:
    def test(node: TreeNode) -> bool:
        return node.role == role and APP in node.app and node.box is not None and node.text == text

    return test


def _slide(slide: Any) -> SlideContent:
    title = slide.shapes.title
    others = [s for s in slide.shapes if title is None or s.shape_id != title.shape_id]
    texts = [_text(shape) for shape in others]
    notes = slide.notes_slide.notes_text_frame if slide.has_notes_slide else None
    return SlideContent(
        title="" if title is None else _text(title),
        texts=tuple(text for text in texts if text),
        notes="" if notes is None else plain(notes.text).strip(),
        background=_background(slide),
        drawn=sum(_is_drawn(shape) for shape in others),
        marks=_marks(slide),
        hidden=slide._element.get("show") in ("0", "false"),
    )


def _is_drawn(shape: Any) -> bool:
    """Return whether a shape was drawn.

    Impress saves an empty place for content as a picture of its icon, without a name.
    """
    if shape.is_placeholder or _text(shape):
        return False
    try:
        is_icon = not shape.name and shape.image.size == PLACE_ICON
    except (AttributeError, ValueError):  # no picture, or one in another file
        return True
    return not is_icon


def _text(shape: Any) -> str:
    """Return the text of a shape; "" if it has none, as a picture."""
    return plain(shape.text_frame.text).strip() if shape.has_text_frame else ""


def _marks(slide: Any) -> tuple[str, ...]:
    frames = [shape.text_frame for shape in slide.shapes if shape.has_text_frame]
    fonts = [
        run.font
        for frame in frames
        for paragraph in frame.paragraphs
        for run in paragraph.runs
        if run.text.strip()
    ]
    marks = {
        "bold": any(font.bold for font in fonts),
        "italic": any(font.italic for font in fonts),
        "underlined": any(font.underline for font in fonts),
    }
    return tuple(name for name, is_set in marks.items() if is_set)


def _background(slide: Any) -> str:
    from pptx.enum.dml import MSO_FILL

    # Asking for the fill would give the slide a background of its own.
    if slide.follow_master_background:
        return ""
    fill = slide.background.fill
    if fill.type != MSO_FILL.SOLID:
        return f"{fill.type}"
    return f"{getattr(fill.fore_color, 'rgb', 'of a theme')}"
