"""Which key types which symbol, and lending spare keys to symbols that the keyboard lacks."""

import contextlib
import fcntl
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from .connection import Connection

KeyStroke = tuple[int, bool]  # keycode, and whether Shift is held
LOCK_FILE = "keyboard.lock"
GROUP_BIT = 13  # where the keyboard's group begins in the mask of modifiers


class KeyboardLayout:
    """The keyboard's map as it is now: `keys` by keysym, `spare` the keycodes without a symbol."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        info = connection.display.display.info
        self._first = info.min_keycode
        count = info.max_keycode - self._first + 1
        mapping = connection.display.get_keyboard_mapping(self._first, count)
        self._rows: list[list[int]] = [list(row) for row in mapping]
        self._width = len(self._rows[0])
        # A row of one symbol throughout is what a typist left that was killed before it
        # gave the key back.
        self.spare = [self._first + i for i, row in enumerate(self._rows) if len(set(row)) == 1]
        group = connection.root.query_pointer().mask >> GROUP_BIT & 3
        self.keys = self._read(group)

    def _read(self, group: int) -> dict[int, KeyStroke]:
        keys: dict[int, KeyStroke] = {}
        for index, row in enumerate(self._rows):
            code = self._first + index
            if code in self.spare:
                continue
            columns = row[2 * group : 2 * group + 2]
            if not any(columns):
                columns = row[:2]
            for level, symbol in enumerate(columns):
                if symbol:
                    keys.setdefault(symbol, (code, level == 1))
        return keys

    def chunks(self, symbols: Iterable[int]) -> Iterator[tuple[list[int], list[int]]]:
        """Cut `symbols` into runs that the spare keys can serve.

        With each come the symbols that need a spare key.
        """
        run: list[int] = []
        lacking: list[int] = []
        for symbol in symbols:
            if symbol not in self.keys and symbol not in lacking:
                if len(lacking) == len(self.spare):
                    yield run, lacking
                    run = []
                    lacking = []
                lacking.append(symbol)
            run.append(symbol)
        if run:
            yield run, lacking

    @contextlib.contextmanager
    def borrow_keys(self, symbols: list[int]) -> Iterator[dict[int, KeyStroke]]:
        """Give each of `symbols` a spare key, until the application has read what was typed."""
        if not symbols:
            yield self.keys
            return
        codes = self.spare[: len(symbols)]
        borrowed = dict(zip(codes, symbols, strict=True))
        try:
            self._assign(borrowed)
            yield self.keys | {symbol: (code, False) for code, symbol in borrowed.items()}
            self._connection.settle()
        finally:
            self._assign(dict.fromkeys(codes, 0))

    def _assign(self, symbols: dict[int, int]) -> None:
        """Set the symbol of each keycode on all levels, so that no modifier changes it.

        Neighbours go in one request.
        """
        runs: list[list[int]] = []
        for code in sorted(symbols):
            if runs and runs[-1][-1] == code - 1:
                runs[-1].append(code)
            else:
                runs.append([code])
        display: Any = self._connection.display
        for run in runs:
            rows = [[symbols[code]] * self._width for code in run]
            display.change_keyboard_mapping(run[0], rows)
        display.sync()


@contextlib.contextmanager
def typing_lock() -> Iterator[None]:
    """Hold the right to lend keys.

    Two programs that lend the same key at once would type each other's symbols.
    """
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or "/tmp")
    descriptor = os.open(
        folder / LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600
    )
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
