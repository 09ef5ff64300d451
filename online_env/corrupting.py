"""Corrupt a running desktop by hand, and take it back: `hijack desktop corrupt`.

What was applied is written into the desktop's run folder, so that another process can take it back.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from hijack_data._apply import apply
from hijack_data.cli.options import OutOption, seed_option
from hijack_data.corruption import Corruption, find_corruption
from hijack_data.elements import scene_from
from hijack_data.errors import ParameterError
from hijack_data.file_io import encode_png, write_atomic
from hijack_data.locking import Lock, lock
from hijack_data.plan import Plan
from hijack_data.rng import Stream
from hijack_data.safety import changed_pixels
from hijack_data.types import UInt8Array, size_text

from .desktops.protocol import Desktop
from .errors import DesktopError

if TYPE_CHECKING:
    from .effects import Applied

FILE = "corrupted.json"
SAMPLE = "by hand"

_FIELDS = {"corruption", "at", "records"}  # of an entry of the ledger


@dataclass
class AppliedPlan:
    """A plan that was applied to a desktop.

    Args:
        plan: The plan.
        before: The screen before it, uint8 RGB `[H, W, 3]`.
        after: What an agent sees after it, likewise.
        records: One record for each effect.
    """

    plan: Plan
    before: UInt8Array
    after: UInt8Array
    records: list[dict[str, Any]]

    @property
    def ok(self) -> bool:
        """Whether every probe succeeded."""
        return all(record["probes"][-1]["ok"] for record in self.records)

    @property
    def saw(self) -> str:
        """What the probes found; for a corruption of the picture, how much of it changed."""
        from .effects.descriptions import in_words

        if not self.records:
            return f"{self._change()}; the machine is as it was"
        words: list[str] = []
        for record in self.records:
            probe = record["probes"][-1]
            words.append(in_words(record["effect"], probe["facts"], probe["problem"]))
        return "; ".join(words)

    def _change(self) -> str:
        """Return how the picture differs from the screen."""
        height, width = self.before.shape[:2]
        if self.before.shape != self.after.shape:
            seen = size_text((self.after.shape[0], self.after.shape[1]))
            real = size_text((height, width))
            return f"the agent sees {seen} of the screen's {real} pixels"
        share = changed_pixels(self.before, self.after) / (height * width)
        return f"{share:.1%} of the pixels that the agent sees are changed"


def corrupt_desktop(
    desktop: Desktop,
    spec: Corruption,
    *,
    seed: int = 0,
    step: int | None = None,
    note: Callable[[list[dict[str, Any]]], object] | None = None,
) -> AppliedPlan:
    """Plan for what is on the screen, apply it to the machine and to the picture, and probe.

    `MissingCapabilityError` is raised if the machine lacks something.

    Args:
        desktop: Any desktop.
        spec: The corruption.
        seed: The seed of its draws.
        step: The step of an episode; the first at which it acts if omitted.
        note: Called with the records of the effects before they are probed, to keep them.

    Raises:
        ParameterError: The corruption does not act at `step`.
    """
    from .effects import perform

    before = desktop.screenshot()
    tree = desktop.accessibility() if spec.needs_elements else None
    scene = scene_from(before, tree=tree, detect="none")
    if step is not None and not spec.is_due(step):
        raise ParameterError(
            f"{spec.name} does not act at step {step} (step is {spec.params().get('step')}); "
            f"leave out --step, or add --set step={step}"
        )
    plan = spec.plan(scene, seed=seed, sample=SAMPLE, step=step)
    stream = Stream(seed, plan.corruption, SAMPLE, step or 0)
    done: list[Applied] = []
    try:
        for effect in plan.effects:
            applied = perform(effect, desktop, stream)
            done.append(applied)
    finally:  # those before one that fails are on the desktop, too
        if done and note is not None:
            note([applied.record for applied in done])
    for applied in done:
        applied.probe()
    after = desktop.screenshot() if done else before
    return AppliedPlan(plan, before, apply(plan, after), [applied.record for applied in done])


class Ledger:
    """What was applied to one desktop by hand and not undone yet, oldest first.

    Args:
        folder: The desktop's run folder, where it is kept in a file.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE

    def entries(self) -> list[dict[str, Any]]:
        """Return `{"corruption", "at", "records"}` each; none if the file is missing or damaged."""
        try:
            data: object = json.loads(self._path.read_bytes())
        except (OSError, ValueError, RecursionError):
            return []
        listed = cast("list[Any]", data) if isinstance(data, list) else []
        entries = [cast("dict[str, Any]", entry) for entry in listed if isinstance(entry, dict)]
        return [entry for entry in entries if _is_whole(entry)]

    def add(self, corruption: str, records: list[dict[str, Any]]) -> dict[str, Any]:
        """Add what was just applied, and return its entry."""
        entry = {"corruption": corruption, "at": time.time(), "records": records}
        with self._held():
            self._write([*self.entries(), entry])
        return entry

    def drop(self, entry: dict[str, Any]) -> None:
        """Remove what was undone."""
        with self._held():
            self._write([kept for kept in self.entries() if kept["at"] != entry["at"]])

    def _held(self) -> Lock:
        """Hold the file: a page and a command, say, may change it at the same time."""
        return lock(self._path.with_suffix(".lock"), wait=True)

    def _write(self, entries: list[dict[str, Any]]) -> None:
        write_atomic(self._path, json.dumps(entries, indent=1))


def _is_whole(entry: dict[str, Any]) -> bool:
    """Return whether an entry of a ledger is as `add` writes it."""
    if not entry.keys() >= _FIELDS:
        return False
    at, records = entry["at"], entry["records"]
    if not isinstance(entry["corruption"], str) or not isinstance(at, (int, float)):
        return False
    named = isinstance(records, list) and all(
        isinstance(record, dict) and isinstance(record.get("effect"), str)
        for record in cast("list[dict[str, Any]]", records)
    )
    return named


def refuse_twice(desktop: Desktop, spec: Corruption, ledger: Ledger, name: str) -> None:
    """Refuse a corruption that is on the desktop already and still holds.

    Args:
        desktop: The machine.
        spec: The corruption.
        ledger: What was applied to the machine by hand.
        name: The desktop's name in the message.

    Raises:
        DesktopError: It is there, and each of its effects holds.
    """
    for entry in ledger.entries():
        if entry["corruption"] == spec.name and _holds(entry, desktop):
            age = time.time() - entry["at"]
            undo = f"hijack desktop corrupt --undo {spec.name} --on {name}"
            raise DesktopError(
                f"{spec.name} is on {name} already, since {age:.0f} s, and still holds; take it"
                f" back first: {undo}"
            )


def _holds(entry: dict[str, Any], desktop: Desktop) -> bool:
    """Return whether an entry has lasting effects, and all of them hold."""
    from .effects import find as find_effect
    from .effects import resume

    lasting = [record for record in entry["records"] if find_effect(record["effect"]).lasting]
    return bool(lasting) and all(resume(record, desktop).probe().ok for record in lasting)


def undo_recorded(desktop: Desktop, name: str | None, ledger: Ledger) -> list[tuple[str, str, Any]]:
    """Undo what the ledger holds, the latest first.

    Args:
        desktop: The machine.
        name: Undo this corruption only; all if `None`.
        ledger: What was applied by hand.

    Returns:
        Corruption, kind of the effect and result (`effects.Undone`) each.
    """
    from .effects import resume

    done: list[tuple[str, str, Any]] = []
    for entry in reversed(ledger.entries()):
        if name not in (None, entry["corruption"]):
            continue
        results: list[Any] = []
        for record in reversed(entry["records"]):
            undone = resume(record, desktop).undo()
            results.append(undone)
            done.append((entry["corruption"], record["effect"], undone))
        if all(undone.ok for undone in results):
            ledger.drop(entry)
    return done


def undo_unrecorded(desktop: Desktop, spec: Corruption) -> list[tuple[str, str, Any]]:
    """Undo a corruption of which there is no record, as far as the machine itself shows it.

    Returns:
        As `undo_recorded`.

    Raises:
        ParameterError: The corruption changes only the picture.
    """
    from .effects import undo

    plan = spec.plan(scene_from(desktop.screenshot(), detect="none"), seed=0)
    if not plan.effects:
        problem = f"{spec.name} changes only what an agent sees, not the machine"
        raise ParameterError(f"{problem}: there is nothing to undo")
    return [(spec.name, effect.kind, undo(effect.kind, desktop)) for effect in plan.effects]


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
    "--output",
    "output",
    cls=OutOption,
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
    from .embedded.registry import folder
    from .embedded.running import attach

    if name is None and not undo:
        raise click.UsageError("give the NAME of a corruption (hijack list), or --undo")
    cls = None if name is None else find_corruption(name)
    with attach(desktop_name) as desktop:
        ledger = Ledger(folder(desktop.id))
        if undo:
            sys.exit(_undo(desktop, cls, ledger, as_json))
        if cls is None:  # one of the two was given, see above
            raise click.UsageError("give the NAME of a corruption")
        sys.exit(_corrupt(desktop, cls, ledger, output, as_json, options))


def _corrupt(
    desktop: Any,
    cls: type[Corruption],
    ledger: Ledger,
    output: Path | None,
    as_json: bool,
    options: dict[str, Any],
) -> int:
    from hijack_data.cli.picture_commands import parse_settings

    spec = cls(**parse_settings(cls, options["settings"]))
    refuse_twice(desktop, spec, ledger, desktop.id)
    done = corrupt_desktop(
        desktop,
        spec,
        seed=options["seed"],
        step=options["step"],
        note=lambda records: ledger.add(spec.name, records),
    )
    picture = output
    if picture is None and not done.records:
        picture = Path(f"{spec.name}.png")
    if picture is not None:
        write_atomic(picture, encode_png(done.after))
    if as_json:
        click.echo(json.dumps(_report(done, spec.name, desktop.id, picture)))
    else:
        _print(done, spec.name, desktop.id, picture)
    return 0 if done.ok else 1


def _report(done: AppliedPlan, name: str, desktop: str, picture: Path | None) -> dict[str, Any]:
    return {
        "corruption": name,
        "desktop": desktop,
        "ok": done.ok,
        "saw": done.saw,
        "digest": done.plan.digest(),
        "notes": done.plan.notes,
        "picture": None if picture is None else str(picture),
        "effects": done.records,
    }


def _print(done: AppliedPlan, name: str, desktop: str, picture: Path | None) -> None:
    from .effects import find as find_effect

    failed = "" if done.ok else "the probe is FALSE: "
    click.echo(f"{name} on {desktop}: {failed}{done.saw}")
    for note in done.plan.notes:
        click.echo(f"  note: {note}")
    if picture is not None:
        click.echo(f"  what an agent sees: {picture}")
    if any(find_effect(record["effect"]).lasting for record in done.records):
        click.echo(f"  take it back with: hijack desktop corrupt --undo {name} --on {desktop}")


def _undo(desktop: Any, cls: type[Corruption] | None, ledger: Ledger, as_json: bool) -> int:
    name = None if cls is None else cls.name
    done = undo_recorded(desktop, name, ledger)
    recorded = bool(done)
    if not recorded:
        if cls is None:
            problem = f"nothing was applied to {desktop.id} by hand"
            raise DesktopError(f"{problem}; name a corruption to clear up all the same")
        done = undo_unrecorded(desktop, cls())
    ok = all(undone.ok for _, _, undone in done)
    if as_json:
        rows: list[dict[str, Any]] = []
        for label, kind, undone in done:
            rows.append({"corruption": label, "effect": kind, **vars(undone)})
        report = {"desktop": desktop.id, "ok": ok, "recorded": recorded, "undone": rows}
        click.echo(json.dumps(report))
    else:
        _print_undone(done, desktop.id, None if recorded else name)
    return 0 if ok else 1


def _print_undone(done: list[tuple[str, str, Any]], desktop: str, unrecorded: str | None) -> None:
    from .effects.descriptions import undone_in_words

    if unrecorded is not None:
        click.echo(f"no record of {unrecorded} on {desktop}: going by what the machine shows")
    for label, kind, undone in done:
        failed = "" if undone.ok else "NOT undone: "
        words = undone_in_words(kind, undone.facts, undone.problem)
        click.echo(f"{label} on {desktop}: {failed}{words}")
