"""What the readers of folders of results share: JSON files, and conditions that folders name."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hijack_data.corruption import CORRUPTIONS
from hijack_data.errors import short_repr
from hijack_data.plan import CLEAN
from hijack_data.runs.amounts import is_amount

from ..outcomes import OutcomeError

MAX_JSON = 64 * 2**20  # bytes


def condition_name(part: str) -> str | None:
    """Return the registered corruption that a folder is named after, whatever joins its words."""
    plain = _plain(part)
    for name in (CLEAN, *CORRUPTIONS.names()):
        if plain == _plain(name):
            return name
    return None


def _plain(text: str) -> str:
    return "".join(filter(str.isalnum, text.lower()))


def find_condition(source: Path, folder: Path, columns: Mapping[str, str]) -> str:
    """Return the condition of an episode from the folders that it lies in.

    Args:
        source: the folder that was given.
        folder: that of the episode, `source` or below it.
        columns: `condition` may be the number of the folder below `source`, from 1.

    Returns:
        The one folder named after a corruption or `clean`, from `source` down; else `clean`.

    Raises:
        OutcomeError: folders name two conditions, or the number names no folder.
    """
    below = folder.relative_to(source).parts
    if "condition" in columns:
        number = columns["condition"]
        if not number.isdecimal() or not 1 <= int(number) <= len(below):
            raise OutcomeError(
                f"--columns condition={number}: must be the number of a folder from {source} down"
                f" to {folder}, 1 to {len(below)}"
            )
        part = below[int(number) - 1]
        return condition_name(part) or part
    parts = (source.resolve().name, *below)
    names = {name for name in map(condition_name, parts) if name is not None}
    if len(names) > 1:
        raise OutcomeError(
            f"{folder}: lies in folders of several conditions ({', '.join(sorted(names))});"
            " --columns condition=N says which counts, from 1 below the source"
        )
    return names.pop() if names else CLEAN


def read_object(path: Path, description: str) -> dict[str, Any]:
    """Return the object in a JSON file.

    Args:
        path: the file.
        description: what it should be, such as `a result of Harbor`, for messages.

    Raises:
        OutcomeError: it cannot be read, or holds no object.
    """
    try:
        if path.stat().st_size > MAX_JSON:
            raise OutcomeError(
                f"{path}: is larger than {MAX_JSON} bytes, so it is not {description}"
            )
        data: object = json.loads(path.read_bytes())
    except OSError as error:
        raise OutcomeError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise OutcomeError(f"{path}: is not JSON ({str(error)[:120]})") from None
    if not isinstance(data, dict):
        raise OutcomeError(
            f"{path}: is not {description}: must be an object, got {short_repr(data)}"
        )
    return data


def field(data: Mapping[str, Any], path: Path, *keys: str, kind: Any) -> Any:
    """Return a field of an object, or of an object within it.

    Args:
        data: the object.
        path: its file, for messages.
        keys: the key, with those of the objects that it is in before it.
        kind: the type or types that it may have; `None` is one only if `type(None)` is listed.

    Raises:
        OutcomeError: it is missing or of another type.
    """
    value: Any = data
    for depth, key in enumerate(keys):
        name = ".".join(keys[: depth + 1])
        if not isinstance(value, Mapping) or key not in value:
            raise OutcomeError(f"{path}: has no field {name!r}; it is of another format or version")
        value = value[key]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise OutcomeError(
            f"{path}: field {'.'.join(keys)!r} has another type, got {short_repr(value)}; it is of"
            " another format or version"
        )
    return value


def check_score(value: Any, path: Path, name: str) -> float:
    """Return a score.

    Raises:
        OutcomeError: it is no number in 0..1.
    """
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not 0 <= value <= 1:
        raise OutcomeError(
            f"{path}: {name} must be a number from 0 to 1, got {short_repr(value)}; write the"
            " scores to a table, scaled, and give that"
        )
    return float(value)


def sum_amounts(data: Any, path: Path, *keys: str) -> float | None:
    """Return the sum of amounts in an object, such as of tokens read and written.

    Args:
        data: the object; `None` if the file has none.
        path: its file, for messages.
        keys: of the amounts.

    Returns:
        `None` unless all are there: a part would pass for the whole.

    Raises:
        OutcomeError: one is no number of at least 0.
    """
    values = [data.get(key) if isinstance(data, Mapping) else None for key in keys]
    for key, value in zip(keys, values, strict=True):
        if value is not None and not is_amount(value):
            raise OutcomeError(
                f"{path}: {key} must be a number of at least 0, got {short_repr(value)}; remove it"
                " if it is not known"
            )
    return None if None in values else float(sum(filter(is_amount, values)))


def has_keys(path: Path, *keys: str) -> bool:
    """Return whether a JSON file is an object with some keys.

    Where they are not among its first bytes, the whole file is read: keys have no order.

    Raises:
        OutcomeError: it is not JSON.
    """
    start = head(path)
    if all(f'"{key}"'.encode() in start for key in keys):
        return True
    try:
        data: object = json.loads(path.read_bytes()) if path.stat().st_size <= MAX_JSON else None
    except OSError as error:
        raise OutcomeError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise OutcomeError(
            f"{path}: is not JSON ({str(error)[:120]}); remove it if it is no result"
        ) from None
    return isinstance(data, dict) and set(keys) <= set(data)


def head(path: Path, size: int = 4096) -> bytes:
    """Return the first bytes of a file; none if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError:
        return b""
