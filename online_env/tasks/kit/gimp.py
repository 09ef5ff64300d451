"""Pictures for tasks, their judgement, and the ways of a person who works on one in GIMP."""

import re
from collections.abc import Iterator, Sequence
from io import BytesIO

import numpy as np
from PIL import Image, ImageDraw

from hijack_data.rng import Stream

from ..base import Task
from ..hand import ENTRIES, Hand
from ..machine import Machine
from ..tree_nodes import TreeNode

GIMP = "gimp"
EXPORT = "file-"  # the part of GIMP that has a window for the options of a format
_NO_PICTURE = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)
_OPTIONS = re.compile("Export Image as")
_ASKED = re.compile("Export Image as|Question")
_CHANGED = re.compile(r"\*\[")  # how the title begins, as long as there is something to take back
_CHANGES = 12  # so many changes are taken back at most
_CANVAS_FIELDS = 4  # width, height, and the two offsets
_SLACK = 0.1  # mean difference of colour values, of 255: less than that of a dab of the brush
_SPOT = 16  # pixels
_SPOT_SLACK = 16.0  # of 255; a dab of 20 pixels changes a square by 50 and more


class PictureTask(Task):
    """A task on one picture, which is open in GIMP at the start.

    What `draw` returns has its `path`, relative to the home folder, and its `size` in pixels.
    """

    domain = "gimp"
    apps = ("gimp",)

    def prepare(self, machine: Machine) -> None:
        """Put the picture in place."""
        machine.write(self.values.path, encoded(self.picture()))

    def initial_app(self, machine: Machine) -> Sequence[str]:
        """Return GIMP with the picture."""
        return "gimp", machine.path(self.values.path)

    def picture(self) -> Image.Image:
        """Return the picture as it is at first."""
        return drawing(Stream(self.seed, self.name), *self.values.size)


def drawing(stream: Stream, width: int, height: int) -> Image.Image:
    """Return a picture of its own for each stream: no two of its parts look the same."""
    picture = Image.new("RGB", (width, height), _color(stream, 150))
    pen = ImageDraw.Draw(picture)
    for _ in range(12):
        x, y = stream.integer(0, width - 40), stream.integer(0, height - 40)
        size = stream.integer(30, 140)
        box = (x, y, x + size, y + stream.integer(30, 140))
        if stream.integer(0, 1):
            pen.ellipse(box, fill=_color(stream, 0))
        else:
            pen.rectangle(box, fill=_color(stream, 0))
    return picture


def _color(stream: Stream, least: int) -> tuple[int, int, int]:
    red, green, blue = (stream.integer(least, 255) for _ in range(3))
    return red, green, blue


def encoded(picture: Image.Image, kind: str = "PNG", quality: int | None = None) -> bytes:
    """Return the bytes of a picture's file.

    Args:
        picture: The picture.
        kind: A format of Pillow.
        quality: 1 to 100, for JPEG; `None` for the usual one.
    """
    buffer = BytesIO()
    options = {} if quality is None else {"quality": quality}
    picture.save(buffer, kind, **options)
    return buffer.getvalue()


def opened(machine: Machine, path: str) -> Image.Image | None:
    """Return the picture in a file; `None` if there is no file, or if it is no picture.

    What is too large for Pillow (some 13,000 by 13,000 pixels) is no picture.
    """
    data = machine.read(path)
    if data is None:
        return None
    try:
        picture = Image.open(BytesIO(data))
        picture.load()
    except _NO_PICTURE:
        return None
    return picture


def difference(first: Image.Image, second: Image.Image) -> float:
    """Return the mean difference of the colour values of two pictures of one size, 0 to 255.

    If their opacity differs more than that, its mean difference.
    """
    one = np.asarray(first.convert("RGBA"), np.float32)
    other = np.asarray(second.convert("RGBA"), np.float32)
    off = np.abs(one - other)
    return float(max(off[..., :3].mean(), off[..., 3].mean()))


def greatest_spot(first: Image.Image, second: Image.Image) -> float:
    """Return how much the mean colour of a square of 16 pixels differs at most, 0 to 255.

    JPEG and the ways of scaling change single pixels and hardly such a mean; a brush changes it.
    """
    one = np.asarray(first.convert("RGB"), np.float32)
    other = np.asarray(second.convert("RGB"), np.float32)
    off = one - other
    rows, columns = (np.arange(0, length, _SPOT) for length in off.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(off, rows, axis=0), columns, axis=1)
    heights = np.diff([*rows, off.shape[0]])[:, None, None]
    widths = np.diff([*columns, off.shape[1]])[None, :, None]
    # An edge of a few pixels is no square; its sum is compared with that of a whole one.
    area = np.maximum(heights * widths, _SPOT * _SPOT / 2)
    return float(np.abs(sums / area).max())


def dabbed(picture: Image.Image) -> Image.Image:
    """Return a picture with a dab of a brush on it, as wrong results have it."""
    copy = picture.convert("RGB")
    dark = np.asarray(copy)[100, 100].mean() < 128
    ImageDraw.Draw(copy).ellipse((90, 90, 110, 110), "white" if dark else "black")
    return copy


def colorfulness(picture: Image.Image) -> int:
    """Return the greatest difference of the colour values of one pixel, 0 to 255."""
    values = np.asarray(picture.convert("RGB"), np.int16)
    return int((values.max(axis=2) - values.min(axis=2)).max())


def has_quality(picture: Image.Image, quality: int) -> bool:
    """Return whether a picture is from a JPEG file of a quality, 1 to 100."""
    sample = Image.open(BytesIO(encoded(Image.new("RGB", (8, 8)), "JPEG", quality)))
    tables = getattr(picture, "quantization", None)
    return tables == getattr(sample, "quantization", ())


def picture_problems(
    machine: Machine, path: str, wanted: Image.Image, kind: str = "PNG", slack: float = _SLACK
) -> Iterator[str]:
    """Yield how a picture file differs from what it should be.

    Args:
        machine: Where it is.
        path: The file.
        wanted: What it should look like.
        kind: The format it should have, as Pillow names it.
        slack: The greatest mean difference of colour values, of 255.
    """
    found = opened(machine, path)
    if found is None:
        yield f"there is no picture {path}"
        return
    if found.format != kind:
        yield f"{path} is a {found.format} file, not {kind}"
    if found.size != wanted.size:
        yield f"{path} has {found.size} pixels, not {wanted.size}"
        return
    off = difference(found, wanted)
    if off > slack:
        yield f"{path} looks different: colours are off by {off:.1f} of 255"
        return
    spot = greatest_spot(found, wanted)
    if spot > _SPOT_SLACK:
        yield f"{path} looks different at one place: colours are off by {spot:.1f} of 255"


def grey_problems(machine: Machine, path: str, picture: Image.Image) -> Iterator[str]:
    """Yield how a picture file differs from a picture in shades of grey.

    There are several ways to weigh the colours; all of them give a pixel a shade that is between
    the least and the greatest of its colour values.

    Args:
        machine: Where it is.
        path: The file.
        picture: The picture in colours.
    """
    found = opened(machine, path)
    wanted = picture.convert("L")
    if found is not None and found.size == picture.size:
        if colorfulness(found) > 0:
            yield f"{path} has colours"
        colours = np.asarray(picture)
        shades = np.asarray(found.convert("L"))
        wanted = Image.fromarray(np.clip(shades, colours.min(axis=2), colours.max(axis=2)))
    yield from picture_problems(machine, path, wanted)


def gimp_command(hand: Hand, words: str) -> None:
    """Run a command of GIMP by its search, the key `/`.

    The accessibility tree has no places for the menus of GIMP.
    """
    leave_dialogs(hand)
    hand.press("/")
    hand.find("frame", "Search Actions", GIMP)
    hand.type(words)
    hand.wait(f"commands for {words!r}", lambda node: node.role in ENTRIES and node.text == words)
    hand.find("frame", "Search Actions", GIMP)
    hand.press("enter")


def leave_dialogs(hand: Hand) -> None:
    """Close dialogs of GIMP that an earlier try left open."""
    for _ in range(3):
        shown = [node for node in hand.look() if node.role in ("dialog", "alert") and node.box]
        own = [node for node in shown if GIMP in node.app or EXPORT in node.app]
        if not own:
            return
        hand.activate(own[-1])
        hand.press("escape")


def undo_all(hand: Hand) -> None:
    """Take back what an earlier try, or an accident, changed in the open picture."""
    leave_dialogs(hand)
    for _ in range(_CHANGES):
        if hand.see("frame", _CHANGED, GIMP) is None:
            return
        hand.press("ctrl", "z")


def gimp_export(hand: Hand, path: str, quality: int | None = None) -> None:
    """Export the picture to a file, whose name decides the format.

    Args:
        hand: The hand.
        path: The file; one that is there is replaced.
        quality: For JPEG, 0 to 100; `None` leaves the options as they are.
    """
    leave_dialogs(hand)
    hand.press("ctrl", "shift", "e")
    hand.find("dialog", "Export Image", GIMP)
    hand.find("text", app=GIMP, state="focused")
    hand.replace(hand.path(path))
    hand.press("enter")
    asked = hand.find(("dialog", "alert"), _ASKED)
    if asked.role == "alert":
        hand.button("Replace", GIMP)
        hand.find("dialog", _OPTIONS)
    if quality is not None:
        hand.press("tab")  # from the slider to its number
        hand.find("spin-button", app=EXPORT, state="focused")
        hand.replace(str(quality))
        hand.press("tab")
    hand.button("Export", EXPORT)
    hand.wait_until_gone("dialog", _OPTIONS)
    hand.wait_until_gone("dialog", app=GIMP)


def set_canvas(hand: Hand, width: int, height: int, left: int, top: int) -> None:
    """Fill in the dialog for the size of the canvas, which is open; pixels."""
    fields, chain = _canvas_fields(hand)
    _enter(hand, fields[0], width)
    (_, beside, *_), _ = _canvas_fields(hand)
    if beside.text != fields[1].text:
        hand.click(chain)  # it kept the proportions
        _enter(hand, fields[0], width)
    for field, value in zip(fields[1:], (height, left, top), strict=False):
        _enter(hand, field, value)
    hand.button("Resize", GIMP)
    hand.wait_until_gone("dialog", "Set Image Canvas Size", GIMP)


def _enter(hand: Hand, field: TreeNode, value: int) -> None:
    hand.double_click(field)
    hand.replace(f"{value}\t")


def _canvas_fields(hand: Hand) -> tuple[list[TreeNode], TreeNode]:
    """Return the four fields for numbers, and the chain between the first two."""
    return hand.wait_until_stable("dialog Set Image Canvas Size", lambda: _canvas_parts(hand))


def _canvas_parts(hand: Hand) -> tuple[list[TreeNode], TreeNode] | None:
    """Return the fields and the chain as they are now; `None` if some do not show."""
    dialog = hand.find("dialog", "Set Image Canvas Size", GIMP)
    seen = hand.look()
    parts = seen[seen.index(dialog) :] if dialog in seen else []
    fields = [node for node in parts if node.role == "spin-button" and node.box]
    if len(fields) < _CANVAS_FIELDS:
        return None
    beside = [node for node in parts if node.role == "push-button" and _is_beside(node, fields[0])]
    return (fields, beside[0]) if beside else None


def _is_beside(node: TreeNode, field: TreeNode) -> bool:
    """Return whether a node begins where a field ends, and is not above it."""
    if node.box is None or field.box is None:
        return False
    return node.box[0] == field.box[2] and node.box[1] >= field.box[1]


def size_title(width: int, height: int) -> re.Pattern[str]:
    """Return a pattern for the title of the window with a picture of a size, in pixels."""
    return re.compile(rf".* {width}x{height} ")


def mode_title(mode: str) -> re.Pattern[str]:
    """Return a pattern for the title of the window with a picture of a colour mode."""
    return re.compile(rf".*\({mode}")
