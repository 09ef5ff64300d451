"""The gymnasium spaces of observations and actions, shared by all environments.

The core does not depend on gymnasium; importing this module requires an extra that installs it.
"""

import multiprocessing
import operator
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector.utils import (
    create_shared_memory,  # pyright: ignore[reportUnknownVariableType]  (gymnasium leaves it open)
    read_from_shared_memory,
    write_to_shared_memory,
)

from .errors import ParameterError
from .types import Size

MAX_TEXT = 1 << 20  # characters
SHARED_TEXT = 1 << 18  # bytes of a text that processes share, in UTF-8
_HEAD = 4  # bytes of its length
_SLOT = _HEAD + SHARED_TEXT


class Text(gymnasium.Space[str]):
    """Any text; gymnasium's own `Text` space needs a list of allowed characters."""

    def __init__(self) -> None:
        super().__init__((), np.str_)

    @property
    def is_np_flattenable(self) -> bool:
        """False, because text cannot be flattened into a vector."""
        return False

    def contains(self, x: Any) -> bool:
        """Return whether `x` is a text of at most `MAX_TEXT` characters."""
        return isinstance(x, str) and len(x) <= MAX_TEXT

    def sample(self, mask: Any = None, probability: Any = None) -> str:
        """Return a text of eight letters."""
        letters = self.np_random.integers(ord("a"), ord("z") + 1, 8)
        return "".join(map(chr, letters))

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return False
        return vars(self).get("size") == vars(other).get("size")

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"


class Actions(Text):
    """The answers of an agent: any text; a text that is not an action counts as malformed.

    Samples are clicks inside the picture, and now and then `WAIT`.

    Args:
        size: (height, width) of the picture in pixels.
    """

    def __init__(self, size: Size) -> None:
        super().__init__()
        self.size = size

    def sample(self, mask: Any = None, probability: Any = None) -> str:
        """Return a click somewhere, or `WAIT`."""
        height, width = self.size
        x = int(self.np_random.integers(0, width))
        y = int(self.np_random.integers(0, height))
        if self.np_random.integers(0, 8) == 0:
            return "WAIT"
        return f"pyautogui.click({x}, {y})"


def observations(size: Size) -> gymnasium.spaces.Dict:
    """Return the space of `{"screenshot": uint8 RGB [H, W, 3], "instruction": text}`.

    Args:
        size: (height, width) of the screenshot in pixels.
    """
    picture = gymnasium.spaces.Box(0, 255, (*size, 3), np.uint8)
    return gymnasium.spaces.Dict({"screenshot": picture, "instruction": Text()})


# `AsyncVectorEnv` shares observations between processes through these functions for custom spaces.


@create_shared_memory.register(Text)
def _create(space: Text, n: int = 1, ctx: ModuleType = multiprocessing) -> Any:
    return ctx.Array("B", n * _SLOT)


@write_to_shared_memory.register(Text)
def _write(space: Text, index: int, value: str, shared_memory: Any) -> None:
    content = value.encode("utf-8", "surrogatepass")
    if len(content) > SHARED_TEXT:
        raise ParameterError(
            f"an instruction of {len(content)} bytes is more than processes share ({SHARED_TEXT});"
            " make the AsyncVectorEnv with shared_memory=False"
        )
    data = len(content).to_bytes(_HEAD, "little") + content
    start = index * _SLOT
    end = start + len(data)
    _byte_view(shared_memory)[start:end] = data


@read_from_shared_memory.register(Text)
def _read(space: Text, shared_memory: Any, n: int = 1) -> Any:
    return SharedTexts(shared_memory, n)


class SharedTexts(Sequence[str]):
    """A live view of the texts of several processes; a deep copy is a tuple of the present texts.

    Gymnasium reads shared memory once and keeps the result as a view, as it would an array.

    Args:
        shared_memory: As `create_shared_memory` made it.
        n: The number of processes.
    """

    def __init__(self, shared_memory: Any, n: int) -> None:
        self._memory = shared_memory
        self._n = n

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(self._n)))
        memory = _byte_view(self._memory)
        number = range(self._n)[operator.index(index)]
        head = number * _SLOT
        start = head + _HEAD
        length = int.from_bytes(memory[head:start], "little")
        content = bytes(memory[start : start + length])
        return content.decode("utf-8", "surrogatepass")

    def __deepcopy__(self, memo: Any) -> tuple[str, ...]:
        return tuple(self)

    def __repr__(self) -> str:
        return repr(tuple(self))


def _byte_view(shared_memory: Any) -> memoryview:
    return memoryview(shared_memory.get_obj()).cast("B")
