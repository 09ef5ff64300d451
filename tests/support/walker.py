"""An agent that looks for what it should not know: walks all that it is given."""

import functools
import types
from collections.abc import Iterable, Iterator
from typing import Any

# Made anew each time they are asked for, and alike for all objects: only whom they belong to is of interest.
WRAPPERS = (
    types.BuiltinFunctionType, types.MethodWrapperType, types.WrapperDescriptorType, types.MethodDescriptorType,
    types.GetSetDescriptorType, types.MemberDescriptorType, types.ClassMethodDescriptorType,
)  # fmt: skip
LIMIT = 200_000


def neighbours(thing: Any) -> Iterator[Any]:
    """What an object leads to without asking the garbage collector or the variables of whole modules."""
    yield repr(thing) if not isinstance(thing, str | bytes | int | float) else ""
    if isinstance(thing, dict):
        for key, value in thing.items():
            yield from (key, value)
    elif isinstance(thing, list | tuple | set | frozenset):
        yield from thing
    elif isinstance(thing, types.MethodType):
        yield from (thing.__self__, thing.__func__)
    elif isinstance(thing, functools.partial):
        yield from (thing.func, thing.args, thing.keywords)
    elif isinstance(thing, types.FunctionType):
        yield from (thing.__defaults__, thing.__kwdefaults__, vars(thing), thing.__doc__)
        yield from (cell.cell_contents for cell in thing.__closure__ or ())
    elif isinstance(thing, property):
        yield from (thing.fget, thing.fset)
    elif isinstance(thing, WRAPPERS):
        yield getattr(thing, "__self__", None)
    elif isinstance(thing, types.ModuleType):
        return
    else:
        yield from inner(thing)


def inner(thing: Any) -> Iterator[Any]:
    """Attributes, slots, everything that `dir` names, and the class with its bases."""
    for name in dir(thing):
        if name in ("__subclasses__", "__globals__", "__builtins__", "__abstractmethods__"):
            continue
        try:
            yield from (name, getattr(thing, name))
        except Exception:  # noqa: BLE001  (a property may raise what it likes)
            continue
    if isinstance(thing, type):
        yield from (thing.__mro__, dict(vars(thing)))
    else:
        yield type(thing)


def walk(*starts: Any) -> Iterator[str]:
    """Every text that can be reached."""
    seen: set[int] = set()
    kept: list[Any] = []  # so that no id is used twice
    todo = list(starts)
    while todo:
        thing = todo.pop()
        if id(thing) in seen or isinstance(thing, int | float | complex | type(None)):
            continue
        assert len(seen) < LIMIT, "there is no end to it: what was found so far is no proof"
        seen.add(id(thing))
        kept.append(thing)
        if isinstance(thing, bytes):
            thing = thing.decode("latin-1")
        if isinstance(thing, str):
            yield thing
            continue
        if type(thing).__module__.partition(".")[0] in ("numpy", "logging", "threading"):
            yield repr(thing)
            continue
        todo.extend(neighbours(thing))


def found(words: Iterable[str], *starts: Any) -> set[str]:
    """Which of `words` can be reached, in any case."""
    wanted = [word.lower() for word in words]
    return {word for text in walk(*starts) for word in wanted if word in text.lower()}
