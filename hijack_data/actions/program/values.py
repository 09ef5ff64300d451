"""The values and names of a program that are known without running it."""

from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeAlias

Scalar: TypeAlias = int | float | str | None
Value: TypeAlias = "Scalar | tuple[Value, ...]"
Number: TypeAlias = int | float
MaybeValue: TypeAlias = "Value | Unknown"
_Sees: TypeAlias = Callable[[str], bool]


class Unknown(Exception):
    """A value that is not known before the code runs; `reason` is a clause for a message."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class ScreenSize(NamedTuple):
    """The result of `pyautogui.size()`."""

    width: int
    height: int


class Listed(tuple[Value, ...]):
    """The items of a list, which may be changed, unlike those of a tuple."""

    __slots__ = ()


def list_depths(value: MaybeValue, depth: int = 0) -> Iterable[int]:
    """Yield the depth of each list in `value`: 0 for the value itself, 1 for its items, etc."""
    if isinstance(value, Listed):
        yield depth
    if isinstance(value, tuple):
        for item in value:
            yield from list_depths(item, depth + 1)


def same(a: MaybeValue, b: MaybeValue) -> bool:
    """Return whether two values are equal; a list never equals a tuple."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if not isinstance(a, tuple) or not isinstance(b, tuple):
        return a == b
    if len(a) != len(b):
        return False
    return all(same(x, y) for x, y in zip(a, b, strict=True))


class Bindings:
    """The known values of names at one place of a program.

    Entering a block costs nothing; leaving it costs time in proportion to its changes, however
    large the program is.

    Args:
        around: the bindings of the enclosing block, for names without a binding in this one.
        sees: returns whether a name of `around` is visible in this block; by default all are.
    """

    __slots__ = ("_around", "_sees", "changed")

    def __init__(self, around: "Bindings | None" = None, sees: _Sees | None = None) -> None:
        self._around = around
        self._sees = sees
        self.changed: dict[str, MaybeValue] = {}

    def get(self, name: str) -> MaybeValue:
        """Return the value of a name, or an `Unknown` with the reason why there is none."""
        env: Bindings | None = self
        while env is not None:
            if name in env.changed:
                return env.changed[name]
            if env._sees is not None and not env._sees(name):
                break
            env = env._around
        return Unknown(f"nothing before this line gives {name!r} a value")

    def __setitem__(self, name: str, value: MaybeValue) -> None:
        self.changed[name] = value

    def inside(self, sees: _Sees | None = None) -> "Bindings":
        """Return the bindings at the start of an inner block, which keeps its changes to itself."""
        return Bindings(self, sees)

    def forget(self, names: Iterable[str], why: str, line: int) -> None:
        """Make `names` unknown because of line `line`."""
        for name in names:
            self.changed[name] = Unknown(f"{name!r} {why} (line {line})")

    def merge(self, ends: list["Bindings"]) -> None:
        """Take over the values on which alternative inner blocks, of which one runs, agree.

        The other names that they change become unknown.
        """
        values: dict[str, list[MaybeValue]] = {}
        for end in ends:
            for name, value in end.changed.items():
                values.setdefault(name, []).append(value)
        for name, found in values.items():
            if len(found) < len(ends):  # at least one block leaves it unchanged
                found.append(self.get(name))
            agree = all(same(found[0], value) for value in found)
            disagree = Unknown(f"{name!r} does not have the same value in every branch")
            self.changed[name] = found[0] if agree else disagree
