"""Texts that OCR read, in a folder that the processes of a run share.

Each part of a picture has a file, named by its pixels. Its lock makes sure that a part is read
once, and that a process that needs it at the same time waits for the one that reads it: agents that
are compared play the same episode side by side, and see the same screens.
"""

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from hijack_data.locking import lock
from hijack_data.types import Box

TextLines: TypeAlias = list[tuple[str, Box]]  # the text of each line, and its box


class TextFiles:
    """A folder of text that was read.

    Args:
        folder: Its path; it is made with the first text.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def read(self, key: str, read: Callable[[], TextLines]) -> tuple[TextLines, bool]:
        """Return the lines of a part, and whether they were known.

        A folder that cannot be used costs time, and changes nothing else.

        Args:
            key: The digest of its pixels, in hexadecimal digits.
            read: Reads the part, if no process has.
        """
        path = self._folder / f"{key}.json"
        lines = _read_lines(path)
        if lines is not None:
            return lines, True
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            file_lock = lock(path, wait=True)
        except OSError:
            return read(), False
        with file_lock:
            lines = _read_lines(path)
            if lines is not None:
                return lines, True
            lines_read = read()
            with suppress(OSError):
                path.write_text(json.dumps(lines_read))
            return lines_read, False


def _read_lines(path: Path) -> TextLines | None:
    """Return the content of a file; `None` while it is being written, or if that was cut off."""
    try:
        lines = json.loads(path.read_text())
    except (OSError, ValueError):
        return None
    return [(text, (x1, y1, x2, y2)) for text, (x1, y1, x2, y2) in lines]
