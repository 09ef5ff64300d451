"""Agents without a model: one acts at random, one gives up at once.

A score above these two is due neither to luck nor to the share of infeasible tasks.
"""

import hashlib
from collections.abc import Callable, Sequence

from hijack_data.rng import Stream
from hijack_data.types import Size, UInt8Array

from .base import DONE, FAIL, WAIT, Observation

NAME = "random_agent-v1"  # name of the random streams; a new set of actions needs a new version
SCROLL = 10  # clicks of the wheel, at most
HOTKEYS = (
    ("enter",),
    ("esc",),
    ("tab",),
    ("pagedown",),
    ("pageup",),
    ("ctrl", "a"),
    ("ctrl", "c"),
    ("ctrl", "v"),
    ("ctrl", "z"),
    ("ctrl", "s"),
)


class RandomActions:
    """Takes random actions inside the picture: it draws a type, uniformly, then the details.

    The draws depend only on the picture, the instruction and the number of the step, so a run can
    be repeated, and different pictures have different draws.
    """

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self._step = 0

    def reset(self) -> None:
        """Begin with step 0 again."""
        self._step = 0

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return one random action."""
        picture: UInt8Array = obs["screenshot"]
        stream = Stream(self._seed, NAME, _key(instruction, picture), self._step)
        self._step += 1
        draw = stream.choice(_DRAWS)
        height, width = picture.shape[:2]
        return "", [draw(stream, (height, width), instruction)]


class AlwaysFails:
    """Answers `FAIL` at once, so its score is the share of infeasible tasks."""

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return `FAIL`."""
        return "This cannot be done.", [FAIL]


def _key(instruction: str, picture: UInt8Array) -> str:
    digest = hashlib.sha256(repr(picture.shape).encode())
    digest.update(picture.tobytes())
    digest.update(instruction.encode("utf-8", "backslashreplace"))
    return digest.hexdigest()


def _random_point(stream: Stream, size: Size) -> str:
    height, width = size
    x = stream.integer(0, width - 1)
    y = stream.integer(0, height - 1)
    return f"{x}, {y}"


def _click(stream: Stream, size: Size, _: str) -> str:
    return f"pyautogui.click({_random_point(stream, size)})"


def _double_click(stream: Stream, size: Size, _: str) -> str:
    return f"pyautogui.doubleClick({_random_point(stream, size)})"


def _right_click(stream: Stream, size: Size, _: str) -> str:
    return f"pyautogui.rightClick({_random_point(stream, size)})"


def _drag(stream: Stream, size: Size, _: str) -> str:
    start = _random_point(stream, size)
    end = _random_point(stream, size)
    return f"pyautogui.moveTo({start})\npyautogui.dragTo({end}, button='left')"


def _scroll(stream: Stream, size: Size, _: str) -> str:
    amount = stream.integer(1, SCROLL) * stream.choice((1, -1))
    return f"pyautogui.scroll({amount}, {_random_point(stream, size)})"


def _write(stream: Stream, _: Size, instruction: str) -> str:
    words = instruction.split() or ["text"]
    return f"pyautogui.write({stream.choice(words)!r})"


def _hotkey(stream: Stream, _size: Size, _: str) -> str:
    keys = ", ".join(map(repr, stream.choice(HOTKEYS)))
    return f"pyautogui.hotkey({keys})"


def _word(word: str) -> Callable[[Stream, Size, str], str]:
    return lambda _stream, _size, _instruction: word


_DRAWS: tuple[Callable[[Stream, Size, str], str], ...] = (
    _click,
    _double_click,
    _right_click,
    _drag,
    _scroll,
    _write,
    _hotkey,
    _word(WAIT),
    _word(DONE),
    _word(FAIL),
)
