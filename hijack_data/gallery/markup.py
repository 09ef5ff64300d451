"""Markup of pages: templates are filled here and nowhere else.

Values are escaped unless they are `Html`, so markup in a file name stays text. The templates are
those of the standard library's `string.Template`.
"""

import base64
import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import Any, cast

PAGE = Path(__file__).parent / "page"
LINE_LENGTH = 76


class Html(str):
    """Text that is markup already and is inserted unescaped."""


@lru_cache(maxsize=32)
def source(name: str) -> str:
    """Return the text of a file in `page/`."""
    return (PAGE / name).read_text(encoding="utf-8")


def clean(text: str) -> str:
    """Return `text` as UTF-8 can encode it: undecodable bytes of a file name become `?`."""
    return text.encode("utf-8", "replace").decode("utf-8")


def escape(value: object) -> Html:
    """Return a value as text that is safe in elements and attributes; `Html` stays as it is."""
    if isinstance(value, Html):
        return value
    return Html(html.escape(clean(str(value))))


def fill(template: str, /, **values: object) -> Html:
    """Fill the `$names` of the file `page/<template>` with escaped values."""
    return fill_text(source(template), **values)


def fill_text(text: str, /, **values: object) -> Html:
    """Fill the `$names` of a template that is given as text with escaped values."""
    safe = {name: escape(value) for name, value in values.items()}
    return Html(Template(text).substitute(safe))


def join(parts: Sequence[Html]) -> Html:
    """Concatenate pieces of markup."""
    return Html("".join(parts))


def wrap(tag: str, texts: Sequence[str]) -> Html:
    """Wrap each escaped text in its own element: `<li>..</li><li>..</li>`."""
    return Html("".join(f"<{tag}>{escape(text)}</{tag}>" for text in texts))


def script_json(data: object) -> Html:
    """Return JSON that cannot end the script element around it."""
    text = json.dumps(data, separators=(",", ":"), sort_keys=True)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Html(text)


def source_hash(text: str) -> str:
    """Return the hash of a script for a Content-Security-Policy, which lets no other script run."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return "sha256-" + base64.b64encode(digest).decode("ascii")


def pretty(data: object, indent: int = 0) -> str:
    """Return readable JSON: short lists and objects stay on one line.

    It parses back to the same data.
    """
    text = json.dumps(data, ensure_ascii=False, sort_keys=True)
    flat = text.encode("utf-8", "backslashreplace").decode("utf-8")
    if len(flat) + indent <= LINE_LENGTH or not isinstance(data, dict | list) or not data:
        return flat
    inner = indent + 2
    if isinstance(data, dict):
        items = sorted(cast("Mapping[str, Any]", data).items())
        rows = [f"{json.dumps(key)}: {pretty(value, inner)}" for key, value in items]
        return _block("{", rows, "}", indent)
    parts = [pretty(item, inner) for item in cast("list[Any]", data)]
    return _block("[", _pack_lines(parts, LINE_LENGTH - inner), "]", indent)


def _block(start: str, rows: list[str], end: str, indent: int) -> str:
    pad = " " * (indent + 2)
    lines = ",\n".join(pad + row for row in rows)
    return f"{start}\n{lines}\n{' ' * indent}{end}"


def _pack_lines(items: list[str], width: int) -> list[str]:
    """Put as many short items on each line as fit."""
    rows: list[str] = []
    for item in items:
        joined = f"{rows[-1]}, {item}" if rows else ""
        if joined and len(joined) <= width and "\n" not in joined:
            rows[-1] = joined
        else:
            rows.append(item)
    return rows
