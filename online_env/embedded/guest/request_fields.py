"""Reading the fields of a request; a wrong one raises `GuestError` (400)."""

import json
from typing import Any, cast

from starlette.requests import Request

from ...errors import GuestError
from .commands import MAX_TIMEOUT

BAD_REQUEST = 400
UNSUPPORTED_TYPE = 415


async def read_json_body(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request carries; an empty body is an empty object.

    Like OSWorld's server, it refuses (415) a body that is not declared to be JSON: a web page may
    send any other type to a server that is not its own without asking.

    Raises:
        GuestError: The body is not a JSON object, or not declared to be one.
    """
    data = await request.body()
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if data and not _is_json(kind):
        raise GuestError(
            f"the body must be sent as application/json, got {kind or 'no type'!r:.100}",
            UNSUPPORTED_TYPE,
        )
    value: object = {}
    try:
        if data.strip():
            value = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise GuestError(f"the body is not JSON: {error}", BAD_REQUEST) from None
    if not isinstance(value, dict):
        kind = type(value).__name__
        raise GuestError(f"the body must be a JSON object, got {kind}", BAD_REQUEST)
    return cast("dict[str, Any]", value)


def _is_json(kind: str) -> bool:
    if kind == "application/json":
        return True
    return kind.startswith("application/") and kind.endswith("+json")


def text(fields: dict[str, Any], name: str) -> str:
    """Return a field that must be there and must be a text.

    Raises:
        GuestError: It is not.
    """
    value = fields.get(name)
    if not isinstance(value, str) or not value:
        raise GuestError(f"{name} must be a text that is not empty, got {value!r:.200}", 400)
    return value


def flag(fields: dict[str, Any], name: str, default: bool = False) -> bool:
    """Return a field that is true or false; OSWorld's tasks also write the text `"true"`.

    OSWorld's server takes any text for true, even "false", so other texts are refused.

    Raises:
        GuestError: It is neither.
    """
    value = fields.get(name, default)
    if value == "true":
        return True
    if not isinstance(value, bool):
        raise GuestError(f"{name} must be true or false, got {value!r:.200}", BAD_REQUEST)
    return value


def number(
    fields: dict[str, Any],
    name: str,
    default: float | None = None,
    low: float = 0.0,
    high: float = MAX_TIMEOUT,
) -> float:
    """Return a field that is a finite number in `[low, high]`.

    Args:
        fields: of the request.
        name: of the field.
        default: if it is left out; it must be there if this is None.
        low: the smallest value.
        high: the largest value.

    Raises:
        GuestError: It is not such a number.
    """
    value = fields.get(name, default)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not low <= value <= high:
        raise GuestError(
            f"{name} must be a number from {low:g} to {high:g}, got {value!r:.200}", BAD_REQUEST
        )
    return float(value)
