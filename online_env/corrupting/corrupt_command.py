"""`hijack desktop corrupt`."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hijack_data.cli.options import seed_option
from hijack_data.cli.terminal import echo
from hijack_data.file_io import write_atomic

from ..errors import DesktopError
from .ledger import Ledger

if TYPE_CHECKING:
    from hijack_data.corruption import Corruption

    from .desktop_corruption import AppliedPlan


@click.command()
@click.argument("name", required=False)
@click.option(
    "--on", "desktop_name", metavar="ID", help="The desktop's id; the only one, if not given."
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a parameter; may be repeated.",
)
@seed_option()
@click.option(
    "--step",
    type=int,
    metavar="N",
    help="Step of an episode.  [default: the first at which it acts]",
)
@click.option(
    "-o",
    "--out",
    "output",
    type=click.Path(dir_okay=False, writable=True, path_type=Path),
    metavar="OUT.png",
    help="Save what an agent sees then.  [default for the visual ones: NAME.png]",
)
@click.option(
    "--undo", is_flag=True, help="Take back corruption NAME, or all that were applied by hand."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def corrupt(
    name: str | None,
    desktop_name: str | None,
    undo: bool,
    as_json: bool,
    output: Path | None,
    **options: Any,
) -> None:
    """Corrupt a running desktop, such as: hijack desktop corrupt network_error.

    Prints what the probe saw on the machine. Exit code 1: the probe is false, or something could
    not be taken back.
    """
    from ..embedded.running import attach
    from ..embedded.runtime.registry import folder

    cls = _find_corruption(name, undo)
    with attach(desktop_name) as desktop:
        ledger = Ledger(folder(desktop.id))
        if undo or cls is None:
            sys.exit(_undo(desktop, cls, ledger, as_json))
        sys.exit(_corrupt(desktop, cls, ledger, output, as_json, options))


def _find_corruption(name: str | None, undo: bool) -> "type[Corruption] | None":
    """Return the corruption of that name; `None` for all that are to be undone.

    Raises:
        UsageError: There is neither a name nor --undo.
    """
    if name is not None:
        from hijack_data.corruption import find_corruption

        return find_corruption(name)
    if not undo:
        raise click.UsageError("give the NAME of a corruption (hijack list), or --undo")
    return None


def _corrupt(
    desktop: Any,
    cls: "type[Corruption]",
    ledger: Ledger,
    output: Path | None,
    as_json: bool,
    options: dict[str, Any],
) -> int:
    from hijack_data.cli.picture_plans import parse_settings

    from .desktop_corruption import corrupt_desktop, refuse_twice

    spec = cls(**parse_settings(cls, options["settings"]))
    refuse_twice(desktop, spec, ledger, desktop.id)
    applied = corrupt_desktop(
        desktop,
        spec,
        seed=options["seed"],
        step=options["step"],
        note=lambda records: ledger.add(spec.name, records),
    )
    picture = output
    if picture is None and not applied.records:
        picture = Path(f"{spec.name}.png")
    if picture is not None:
        from hijack_data.picture_io import encode_png

        write_atomic(picture, encode_png(applied.after))
    if as_json:
        echo(json.dumps(_report(applied, spec.name, desktop.id, picture)))
    else:
        _print(applied, spec.name, desktop.id, picture)
    return 0 if applied.ok else 1


def _report(
    applied: "AppliedPlan", name: str, desktop: str, picture: Path | None
) -> dict[str, Any]:
    return {
        "corruption": name,
        "desktop": desktop,
        "ok": applied.ok,
        "saw": applied.saw,
        "digest": applied.plan.digest(),
        "notes": applied.plan.notes,
        "picture": None if picture is None else str(picture),
        "effects": applied.records,
    }


def _print(applied: "AppliedPlan", name: str, desktop: str, picture: Path | None) -> None:
    from ..effects import find as find_effect

    failed = "" if applied.ok else "the probe is FALSE: "
    echo(f"{name} on {desktop}: {failed}{applied.saw}")
    for note in applied.plan.notes:
        echo(f"  note: {note}")
    if picture is not None:
        echo(f"  what an agent sees: {picture}")
    if any(find_effect(record["effect"]).lasting for record in applied.records):
        echo(f"  take it back with: hijack desktop corrupt --undo {name} --on {desktop}")


def _undo(desktop: Any, cls: "type[Corruption] | None", ledger: Ledger, as_json: bool) -> int:
    from .desktop_corruption import undo_recorded, undo_unrecorded

    name = None if cls is None else cls.name
    results = undo_recorded(desktop, name, ledger)
    recorded = bool(results)
    if not recorded:
        if cls is None:
            problem = f"nothing was applied to {desktop.id} by hand"
            raise DesktopError(f"{problem}; name a corruption to clear up all the same")
        results = undo_unrecorded(desktop, cls())
    ok = all(undone.ok for _, _, undone in results)
    if as_json:
        rows: list[dict[str, Any]] = []
        for label, kind, undone in results:
            rows.append({"corruption": label, "effect": kind, **vars(undone)})
        report = {"desktop": desktop.id, "ok": ok, "recorded": recorded, "undone": rows}
        echo(json.dumps(report))
    else:
        _print_undone(results, desktop.id, None if recorded else name)
    return 0 if ok else 1


def _print_undone(
    results: list[tuple[str, str, Any]], desktop: str, unrecorded: str | None
) -> None:
    from ..effects.descriptions import undone_in_words

    if unrecorded is not None:
        echo(f"no record of {unrecorded} on {desktop}: going by what the machine shows")
    for label, kind, undone in results:
        failed = "" if undone.ok else "NOT undone: "
        words = undone_in_words(kind, undone.facts, undone.problem)
        echo(f"{label} on {desktop}: {failed}{words}")
