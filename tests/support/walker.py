"""An agent that looks for what it should not know: walks all that it is given."""

import functools
import types
from collections.abc import Iterable, Iterator
from typing import Any

# Made anew each time they are asked for, and alike for all objects: only whom they belong to is of
# interest.
WRAPPERS = (
    types.BuiltinFunctionType,
    types.MethodWrapperType,
    types.WrapperDescriptorType,
    types.MethodDescriptorType,
    types.GetSetDescriptorType,
    types.MemberDescriptorType,
    types.ClassMethodDescriptorType,
)
LIMIT = 200_000
# What Python itself names and does not give.
PYTHONS = {
    "builtins.type.__annotations__",
    "types.GenericAlias.__copy__",
    "types.GenericAlias.__deepcopy__",
}


def neighbours(thing: Any, raised: set[str]) -> Iterator[Any]:
    """What an object leads to without asking the garbage collector or the variables of whole
    modules.

    What raises instead is noted in `raised`, by module, class and name.
    """
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
        yield from inner(thing, raised)


def inner(thing: Any, raised: set[str]) -> Iterator[Any]:
    """Attributes, slots, everything that `dir` names, and the class with its bases."""
    for name in dir(thing):
        if name in ("__subclasses__", "__globals__", "__builtins__", "__abstractmethods__"):
            continue
        yield name
        try:
            value = getattr(thing, name)
        except Exception as error:  # noqa: BLE001  (a property may raise what it likes)
            owner = thing if isinstance(thing, type) else type(thing)
            raised.add(f"{owner.__module__}.{owner.__qualname__}.{name}")
            value = repr(error)
        yield value
    if isinstance(thing, type):
        yield from (thing.__mro__, dict(vars(thing)))
    else:
        yield type(thing)


def walk(starts: Iterable[Any], raised: set[str]) -> Iterator[str]:
    """Every text that can be reached; `raised` gets the names of the attributes that raised
    instead."""
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
        todo.extend(neighbours(thing, raised))


def found(words: Iterable[str], *starts: Any, raising: Iterable[str] = ()) -> set[str]:
    """Which of `words` can be reached, in any case.

    An attribute that raises may hide something: it has to be in `raising` (as `module.Class.name`),
    or Python's own.
    """
    wanted = [word.lower() for word in words]
    raised: set[str] = set()
    hits = {word for text in walk(starts, raised) for word in wanted if word in text.lower()}
    unseen = raised - PYTHONS - set(raising)
    assert not unseen, f"not looked into, as they raise: {sorted(unseen)}"
    return hits
