"""`hijack list` and `hijack show`: which corruptions there are, and their parameters."""

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from .completion import complete
from .terminal import console, echo

if TYPE_CHECKING:
    from rich.table import Table

    from ..corruption import Corruption


def describe_all() -> list[dict[str, Any]]:
    """Return everything about all corruptions as JSON data."""
    from ..corruption import SETS, corruption_names, find_corruption

    names = [name for of in ("all", *SETS) for name in corruption_names(of)]
    return [describe(find_corruption(name)) for name in names]


def describe(cls: "type[Corruption]") -> dict[str, Any]:
    """Return everything about a corruption as JSON data."""
    from .. import params as p
    from ..corruption import SETS

    spec = cls()
    rows: list[dict[str, Any]] = []
    for key, (meta, default) in p.parameters(cls).items():
        value = p.to_json(default)
        rows.append({"name": key, "default": value, "accepts": meta.accepts, "doc": meta.doc})
    levels = [{key: p.to_json(value) for key, value in level.items()} for level in cls.severities]
    return {
        "name": cls.name,
        "id": spec.id,
        "category": cls.category,
        "scope": cls.scope,
        "acts": acts(spec),
        "paper": cls.paper,
        "set": next((of for of, names in SETS.items() if cls.name in names), ""),
        "summary": cls.summary(),
        "parameters": rows,
        "severities": levels,
    }


def _source(info: dict[str, Any]) -> str:
    """Return where a corruption comes from: the paper, a named set, or a plug-in."""
    return info["paper"] or (f"set {info['set']}" if info["set"] else "plug-in")


def acts(spec: "Corruption") -> str:
    """Return in words at which steps a corruption acts."""
    from ..params import Every

    match spec.steps:
        case None:
            return "every step"
        case Every(every=every):
            return f"every {every} steps"
        case -1:
            return "before the episode"
        case int() as step:
            return f"step {step}"
        case several:
            return "steps " + ", ".join(map(str, several))


def markdown(rows: list[dict[str, Any]]) -> str:
    """Return the reference page of all corruptions, for `docs/corruptions.md`."""
    parts = [
        "# Corruptions\n",
        "Made by `hijack list --markdown`. `color` takes a CSS name, `#rrggbb` or `[r, g, b]`.\n",
    ]
    for row in rows:
        parts += _section(row)
    return "\n".join(parts)


def _section(row: dict[str, Any]) -> Iterator[str]:
    """Yield the lines on one corruption."""
    kind = row["category"].replace("_", " ")
    source = _source(row)
    yield f"## `{row['name']}`\n\n{row['summary']}\n"
    yield f"{kind}; acts on the {row['scope']}, {row['acts']}; {source}.\n"
    yield "| parameter | default | accepts | meaning |\n|---|---|---|---|"
    for item in row["parameters"]:
        default = json.dumps(item["default"])
        accepts = item["accepts"].replace("|", "or")
        yield f"| `{item['name']}` | `{default}` | {accepts} | {item['doc']} |"
    levels: list[str] = []
    for number, level in enumerate(row["severities"], 1):
        text = _changes(level) or "defaults"
        levels.append(f"{number} {text}")
    yield f"\nSeverity: {'; '.join(levels)}.\n" if levels else ""


def _changes(level: dict[str, Any]) -> str:
    """Return the parameters that a severity changes, as text."""
    changes: list[str] = []
    for key, value in level.items():
        text = json.dumps(value)
        changes.append(f"{key}={text}")
    return ", ".join(changes)


@click.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--markdown", "as_markdown", is_flag=True, help="Print the reference page.")
def list_command(as_json: bool, as_markdown: bool) -> None:
    """List all corruptions: the paper's nine, plug-ins, the set everyday."""
    rows = describe_all()
    if as_markdown:
        echo(markdown(rows), nl=False)
        return
    if as_json:
        echo(json.dumps(rows, indent=1))
        return
    from rich.markup import escape

    table = _table("name", "acts on", "when", "what it does")
    for row in rows:
        cells = (row["name"], row["scope"], row["acts"], row["summary"])
        table.add_row(*map(escape, cells))
    console().print(table)


@click.command()
@click.argument("name", shell_complete=complete("hijack_data.corruption:corruption_names"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(name: str, as_json: bool) -> None:
    """Show one corruption: its parameters, defaults, ranges and severity levels."""
    from rich.markup import escape

    from ..corruption import find_corruption

    info = describe(find_corruption(name))
    if as_json:
        echo(json.dumps(info, indent=1))
        return
    out = console()
    paper = escape(_source(info))
    out.print(f"[bold]{info['name']}[/]  ({info['id']}; {paper})")
    out.print(escape(info["summary"]))
    category = escape(info["category"].replace("_", " "))
    out.print(f"{category}; acts on the {info['scope']}, {info['acts']}\n")
    table = _table("parameter", "default", "accepts", "meaning")
    for row in info["parameters"]:
        cells = (row["name"], _default_text(row["default"]), row["accepts"], row["doc"])
        table.add_row(*map(escape, cells))
    out.print(table)
    for level, changes in enumerate(info["severities"], 1):
        text = _changes(changes) or "the defaults"
        out.print(f"severity {level}: {text}", markup=False)


def _table(*columns: str) -> "Table":
    from rich.table import Table

    return Table(*columns, box=None, header_style="bold", pad_edge=False)


def _default_text(default: Any) -> str:
    """Return a default in one line."""
    if not isinstance(default, str):
        return json.dumps(default)
    return repr(default) if "\n" in default else default
