"""`hijack desktop record`: a video, trajectories, or the asset pack."""

import contextlib
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hijack_data.cli.options import BriefCommand, FiniteRange, seed_option
from hijack_data.cli.terminal import echo
from hijack_data.errors import ParameterError

if TYPE_CHECKING:
    from hijack_data.types import Size

    from .embedded.desktop import EmbeddedDesktop

VIDEO = Path("desktop.mp4")


@click.command("record", cls=BriefCommand, more=("assets", "looks", "only", "port", "sizes"))
@click.argument("name", required=False)
@click.option(
    "-o",
    "--out",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE|DIR",
    help="Where the video (desktop.mp4, if not given) or the folder of trajectories goes.",
)
@click.option(
    "--seconds",
    type=FiniteRange(0.1, 86400),
    metavar="S",
    help="Length of the video; until Ctrl-C, if not given.",
)
@click.option(
    "--assets",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Record the asset pack into it.",
)
@click.option(
    "--only",
    metavar="A,B",
    help="Only these kinds of pictures of the pack, with commas between; the others stay.",
)
@click.option(
    "--sizes",
    metavar="WxH,WxH",
    help="Only screens of these sizes for the pack, such as 1920x1080,1280x720.",
)
@click.option(
    "--looks",
    metavar="A,B",
    help="Only desktops of these looks for the pack: golden, dark, bright.  [default: all]",
)
@click.option(
    "--task",
    metavar="NAME",
    help="Record a trajectory of this small task, done by its oracle, into the folder -o.",
)
@seed_option("Variant of the task.")
@click.option(
    "--person",
    is_flag=True,
    help="A person does it, on a page as that of `view`; ends with Ctrl-C.",
)
@click.option(
    "--instruction", metavar="SENTENCE", help="What the person is to do, without a --task."
)
@click.option(
    "--size",
    default="1920x1080",
    show_default=True,
    metavar="WxH",
    help="Screen for a --task without NAME.",
)
@click.option(
    "--port", default=0, metavar="N", help="Port of the page for --person; any free one if 0."
)
def record_desktop(name: str | None, **options: Any) -> None:
    """Record desktop NAME to a video, or record a trajectory, or the asset pack."""
    texts = (options["sizes"] or "").split(",")
    options["sizes"] = [parse_size(text.strip()) for text in texts if text.strip()]
    options["size"] = parse_size(options["size"])
    sys.exit(run(RecordOptions(name=name, **options)))


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
    sizes: "Sequence[Size]" = ()
    looks: str | None = None
    task: str | None = None
    seed: int = 0
    person: bool = False
    instruction: str | None = None
    size: "Size" = (1080, 1920)
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


def _refuse(rule: str, **values: object) -> None:
    for option, value in values.items():
        if value:
            name = option if option.isupper() else f"--{option}"
            raise ParameterError(f"{name} does not go with the rest: {rule}")


def _video(name: str | None, output: Path, seconds: float | None) -> int:
    from .embedded.recording import record
    from .embedded.running import attach

    if not output.parent.is_dir() or output.is_dir():
        raise ParameterError(f"-o {output}: the video is a file, in a folder that exists")
    with attach(name) as desktop:
        output.write_bytes(record(desktop.record, seconds))
    echo(f"{output} {output.stat().st_size} bytes")
    return 0


def _assets(folder: Path, options: RecordOptions) -> int:
    from .maintenance.asset_recorder import EVERY_SIZE, LOOK_NAMES, record_assets

    kinds = _split_names(options.only)
    sizes = options.sizes or EVERY_SIZE
    looks = _split_names(options.looks) or LOOK_NAMES
    failures = record_assets(folder, kinds, sizes, echo, looks)
    return 1 if failures else 0


def _split_names(text: str | None) -> list[str]:
    return [word.strip() for word in (text or "").split(",") if word.strip()]


def _oracle(folder: Path, options: RecordOptions) -> int:
    from .recording.oracle_recorder import record_task

    with _desktop(options) as desktop:
        record_task(str(options.task), options.seed, folder, desktop, echo)
    return 0


def _person(folder: Path, options: RecordOptions) -> int:
    from . import tasks
    from .recording.person_recorder import record_person
    from .recording.trajectory import EpisodeRecording, prepare, saved_at_end

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
        echo(f"to do: {trajectory.instruction}")
        with saved_at_end(trajectory, folder, echo):
            record_person(desktop, trajectory, options.port, echo)
        if task is not None and machine is not None:
            verdict = task.validate(machine)
    if verdict:
        echo(verdict.reason)
    return 0 if verdict is None or verdict.passed else 1


@contextlib.contextmanager
def _desktop(options: RecordOptions) -> "Iterator[EmbeddedDesktop]":
    """Yield the desktop of that name, or one of our own."""
    from .embedded.desktop import EmbeddedDesktop
    from .embedded.running import attach

    context = attach(options.name) if options.name else EmbeddedDesktop.up(size=options.size)
    with context as desktop:
        yield desktop


def _sites(desktop: "EmbeddedDesktop") -> Any:
    from .embedded.sites.state import SiteState

    return SiteState(desktop.record["sites"])


def parse_size(text: str) -> "Size":
    """Return `(height, width)` of a text such as 1920x1080.

    Raises:
        ParameterError: It is not WIDTHxHEIGHT.
    """
    width, _, height = text.lower().partition("x")
    if len(text) >= 20 or not _is_number(width) or not _is_number(height):
        raise ParameterError(f"--size must be WIDTHxHEIGHT, such as 1920x1080, got {text!r}")
    return int(height), int(width)


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdigit()
