"""Pictures to and from the bytes of files."""

import hashlib
import io
import os
import warnings
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

from .errors import HijackError, ImageError, ParameterTypeError, short_repr
from .limits import PICTURE_PIXELS
from .types import UInt8Array

FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "GIF", "TIFF")


def pixel_sha256(pixels: UInt8Array) -> str:
    """Return the SHA-256 of a picture's pixels, as 64 hexadecimal digits.

    Args:
        pixels: uint8 `[H, W, 3]` or `[H, W, 4]`.
    """
    return hashlib.sha256(np.ascontiguousarray(pixels).data).hexdigest()


def load_image(path: str | os.PathLike[str]) -> tuple[UInt8Array, tuple[str, ...]]:
    """Read a picture file as uint8 RGB `[H, W, 3]`, with notes on each conversion.

    A picture with an EXIF orientation is turned upright, as viewers show it, because labels by
    people and detectors refer to that view.

    Raises:
        ImageError: the file is missing, empty, truncated, animated, 16-bit, too large or not a
            picture.
        ParameterTypeError: `path` is not a path.
    """
    try:
        file = Path(path)
    except TypeError:
        raise ParameterTypeError(
            f"a picture is named by its path, got {short_repr(path)}"
        ) from None
    try:
        data = file.read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # a NUL, or half a surrogate
        raise ImageError(f"{str(path)!r}: is not a path ({error})") from None
    return decode_image(data, str(path), upright=True)


def decode_image(
    data: bytes, name: str, *, upright: bool = False
) -> tuple[UInt8Array, tuple[str, ...]]:
    """Decode the bytes of a picture file to uint8 RGB `[H, W, 3]`, with notes on each conversion.

    Args:
        data: the bytes of the file.
        name: the name of the picture in error messages and notes.
        upright: turn a picture with an EXIF orientation upright. Otherwise it is refused, because
            it is unknown whether recorded coordinates refer to the picture as stored or as shown.

    Raises:
        ImageError: the picture is empty, truncated, animated, 16-bit, too large, turned by its
            EXIF orientation, or not a picture at all.
    """
    if not data:
        raise ImageError(f"{name}: the file is empty (0 bytes)")
    if data[:8] == b"\x89PNG\r\n\x1a\n" and data[24:25] == b"\x10":
        raise ImageError(f"{name}: 16 bits a channel; save it as an 8-bit PNG")
    try:
        with warnings.catch_warnings():
            # Pillow's warning about decompression bombs comes before our own limit.
            warnings.simplefilter("ignore")
            return _decoded(data, name, upright)
    except Image.DecompressionBombError:
        raise ImageError(f"{name}: more than {PICTURE_PIXELS} pixels") from None
    except UnidentifiedImageError:
        raise ImageError(f"{name}: not a {'/'.join(FORMATS)} picture") from None
    except Exception as error:  # Pillow may raise any exception for damaged bytes
        if isinstance(error, HijackError | MemoryError):
            raise
        raise ImageError(f"{name}: damaged or cut off ({error})") from error


def _decoded(data: bytes, name: str, upright: bool) -> tuple[UInt8Array, tuple[str, ...]]:
    image = Image.open(io.BytesIO(data), formats=FORMATS)
    _check(image, name)
    notes = _turned(image, name, upright)
    image.load()
    picture = ImageOps.exif_transpose(image) if notes else image
    if image.mode != "RGB":
        notes = (*notes, f"{name}: {image.mode} was converted to RGB{_transparency_note(image)}")
    return np.array(picture.convert("RGB")), notes


def _turned(image: Image.Image, name: str, upright: bool) -> tuple[str, ...]:
    # Returns a note on a picture with an EXIF orientation; raises unless it may be turned upright.
    orientation = image.getexif().get(ExifTags.Base.Orientation, 1)
    if orientation not in range(2, 9):
        return ()
    if upright:
        return (f"{name}: turned upright (EXIF orientation {orientation})",)
    unknown = "turns it, and its coordinates may refer to the stored or to the turned picture"
    advice = "save it upright, without that tag"
    raise ImageError(f"{name}: its EXIF orientation {orientation} {unknown}; {advice}")


def _check(image: Image.Image, name: str) -> None:
    frames = getattr(image, "n_frames", 1)
    if frames > 1:
        raise ImageError(f"{name}: animated, {frames} frames; save the one frame you need")
    if image.mode.startswith(("I", "F")):
        raise ImageError(
            f"{name}: mode {image.mode} has more than 8 bits a channel; save it with 8 bits"
        )
    if image.width * image.height > PICTURE_PIXELS:
        size = f"{image.width}x{image.height}"
        raise ImageError(f"{name}: {size} is more than {PICTURE_PIXELS} pixels")


def _transparency_note(image: Image.Image) -> str:
    transparent = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
    return ", transparency dropped" if transparent else ""


def encode_png(image: UInt8Array) -> bytes:
    """Return uint8 RGB `[H, W, 3]` as PNG bytes."""
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG")
    return buffer.getvalue()
