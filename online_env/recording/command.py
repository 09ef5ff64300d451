"""`hijack desktop record`: a video, trajectories, or the asset pack."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from hijack_data.errors import ParameterError
from hijack_data.types import Size

from ..embedded.desktop import EmbeddedDesktop

VIDEO = Path("desktop.mp4")


@dataclass(frozen=True, kw_only=True)
class RecordOptions:
    """The options of `hijack desktop record`.

    Args:
        name: The desktop; the only one, or one of our own, if omitted.
        output: The video's file, or the folder that a trajectory is added to.
        seconds: How long a video is; until Ctrl-C if omitted.
        assets: The asset pack's folder.
        only: Kinds of pictures for the pack, separated by commas.
        sizes: Sizes of screens for the pack, (height, width).
        looks: Looks of the desktop for the pack, separated by commas.
        task: The task of a trajectory.
        seed: The seed of its variant.
        person: Whether a person acts instead of the task's oracle.
        instruction: What the person is to do, without a task.
        size: (height, width) of a desktop of our own.
        port: Where the person's page is served; 0 picks a free port.
    """

    name: str | None = None
    output: Path | None = None
    seconds: float | None = None
    assets: Path | None = None
    only: str | None = None
    sizes: Sequence[Size] = ()
    looks: str | None = None
    task: str | None = None
    seed: int = 0
    person: bool = False
    instruction: str | None = None
    size: Size = (1080, 1920)
    port: int = 0


def run(options: RecordOptions) -> int:
    """Record what the options ask for, and return the exit code.

    Raises:
        ParameterError: Options do not go together, or `-o` is missing.
    """
    if options.assets is not None:
        _refuse(
            "--assets makes its own desktops and folder",
            NAME=options.name,
            output=options.output,
            seconds=options.seconds,
            task=options.task,
            person=options.person,
            instruction=options.instruction,
        )
        return _assets(options.assets, options)
    _refuse("it is for --assets", only=options.only, sizes=options.sizes, looks=options.looks)
    if options.task is None and not options.person:
        _refuse("it is for --person", instruction=options.instruction)
        return _video(options.name, options.output or VIDEO, options.seconds)
    _refuse("it is for videos", seconds=options.seconds)
    if options.output is None:
        raise ParameterError("-o is missing: the folder that the trajectory is added to")
    if options.person:
        return _person(options.output, options)
    _refuse("it is for --person", instruction=options.instruction)
    return _oracle(options.output, options)


def _refuse(why: str, **given: object) -> None:
    for option, value in given.items():
        if value:
            name = option if option.isupper() else f"--{option}"
            raise ParameterError(f"{name} does not go with the rest: {why}")


def _video(name: str | None, output: Path, seconds: float | None) -> int:
    from ..embedded.recording import record
    from ..embedded.running import attach

    if not output.parent.is_dir() or output.is_dir():
        raise ParameterError(f"-o {output}: the video is a file, in a folder that exists")
    with attach(name) as desktop:
        output.write_bytes(record(desktop.record, seconds))
    click.echo(f"{output} {output.stat().st_size} bytes")
    return 0


def _assets(folder: Path, options: RecordOptions) -> int:
    from .assets import EVERY_SIZE, LOOK_NAMES, record_assets

    kinds = _words(options.only)
    sizes = options.sizes or EVERY_SIZE
    looks = _words(options.looks) or LOOK_NAMES
    lost = record_assets(folder, kinds, sizes, click.echo, looks)
    return 1 if lost else 0


def _words(text: str | None) -> list[str]:
    return [word.strip() for word in (text or "").split(",") if word.strip()]


def _oracle(folder: Path, options: RecordOptions) -> int:
    from .oracle import record_task

    with _desktop(options) as desktop:
        record_task(str(options.task), options.seed, folder, desktop, click.echo)
    return 0


def _person(folder: Path, options: RecordOptions) -> int:
    from .. import tasks
    from .person_recorder import record_person
    from .trajectory import EpisodeRecording, kept, prepare

    if bool(options.task) == bool(options.instruction):
        raise ParameterError(
            "--person needs either --task NAME or --instruction TEXT, which says what is to be done"
        )
    prepare(folder)
    verdict = None
    with _desktop(options) as desktop:
        if options.task:
            task = tasks.get(options.task, options.seed)
            machine = tasks.Machine(desktop, _sites(desktop))
            task.setup(machine)
            trajectory = EpisodeRecording(f"{task.id}-person", task.instruction, task.apps)
        else:
            task = None
            machine = None
            trajectory = EpisodeRecording("person", str(options.instruction), ())
        click.echo(f"to do: {trajectory.instruction}")
        with kept(trajectory, folder, click.echo):
            record_person(desktop, trajectory, options.port, click.echo)
        if task is not None and machine is not None:
            verdict = task.validate(machine)
    if verdict:
        click.echo(verdict.reason)
    return 0 if verdict is None or verdict.passed else 1


@contextlib.contextmanager
def _desktop(options: RecordOptions) -> Iterator[EmbeddedDesktop]:
    """Yield the desktop of that name, or one of our own."""
    from ..embedded.running import attach

    chosen = attach(options.name) if options.name else EmbeddedDesktop.up(size=options.size)
    with chosen as desktop:
        yield desktop


def _sites(desktop: EmbeddedDesktop) -> Any:
    from ..embedded.sites.state import SiteState

    return SiteState(desktop.record["sites"])
