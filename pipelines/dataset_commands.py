"""`hijack build`, `inspect`, `verify`, `sign`, `stats` and `export`.

A command imports what it needs when it runs: `--help` answers at once.
"""

import dataclasses
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hijack_data.choices import LABEL_POLICIES, OUTPUTS, PLATFORMS
from hijack_data.cli.completion import complete, complete_configuration
from hijack_data.cli.options import BriefCommand, seed_option
from hijack_data.cli.terminal import console, echo

from .choices import BOXES, COORDINATES, DIALECTS, EXPORTS, LOCAL, ONLOOKER, SAMPLE

if TYPE_CHECKING:
    from .building.build_report import Findings


class Meter:
    """A progress bar on a terminal, a plain line now and then elsewhere."""

    def __init__(self, quiet: bool) -> None:
        self.bar: Any = None
        self.task: Any = None
        self.quiet = quiet
        self.last = 0

    def __call__(self, completed: int, total: int, text: str) -> None:
        """Show that `completed` of `total` are done."""
        if self.quiet:
            return
        if sys.stderr.isatty():
            self._draw(completed, total)
        elif completed == total or completed - self.last >= max(100, total // 10):
            self.last = completed
            echo(f"{completed} of {total} {text}", err=True)

    def _draw(self, completed: int, total: int) -> None:
        if self.bar is None:
            from rich.progress import Progress

            self.bar = Progress(console=console(stderr=True))
            self.bar.start()
            self.task = self.bar.add_task("rows", total=total)
        self.bar.update(self.task, completed=completed, total=total)

    def close(self) -> None:
        """Close the progress bar and restore the terminal."""
        if self.bar is not None:
            self.bar.stop()


@click.command(
    cls=BriefCommand,
    more=(
        "apps",
        "assets",
        "boxes",
        "clean",
        "coordinates",
        "engine",
        "episode_key",
        "allow_platform_mismatch",
        "label_policy",
        "limit",
        "platform",
        "ray_address",
        "splits",
        "strict",
        "as_json",
    ),
)
@click.argument("source", nargs=-1, required=True, metavar="SOURCE...")
@click.option("-o", "--out", required=True, metavar="DIR", help="The folder to make.")
@click.option(
    "--config",
    metavar="YAML",
    shell_complete=complete_configuration("datasets", "corruptions"),
    help="A configuration file, or a packaged name such as `visual`.",
)
@click.option(
    "--corruptions",
    metavar="A,B|all|clean",
    shell_complete=complete("hijack_data.corruption:corruption_names", "all", "clean"),
    help="Such as marks:number=10,severity=4,subtitle.  [default: the four visual ones]",
)
@click.option(
    "--seed", type=int, metavar="N", help="Random seed.  [default: 0, or the configuration's]"
)
@click.option(
    "--format",
    "format_",
    metavar="NAME",
    shell_complete=complete("pipelines.readers.base:READERS"),
    help="Reader, such as jsonl or FILE.py:CLASS.  [default: detected]",
)
@click.option(
    "--coordinates",
    type=click.Choice(COORDINATES),
    help="Space of the coordinates, if the recording does not name it.",
)
@click.option(
    "--boxes", type=click.Choice(BOXES), help="Form of the boxes, if it cannot be detected."
)
@click.option(
    "--episode-key",
    metavar="FIELD",
    help="Field of a row that names its episode, for --splits of tables of single steps.",
)
@click.option(
    "--label-policy",
    type=click.Choice(LABEL_POLICIES),
    help="Treatment of samples with a hidden target.",
)
@click.option(
    "--clean/--no-clean",
    default=None,
    help="Whether to write the uncorrupted rows too.  [default: clean]",
)
@click.option(
    "--lazy/--materialised", default=None, help="Store plans, or pixels.  [default: materialised]"
)
@click.option(
    "--assets",
    metavar="DIR",
    help="Recorded pictures for corruptions of the machine.  [default: shipped]",
)
@click.option(
    "--apps",
    metavar="A,B",
    help="Applications on the screen, if the source names none: chrome,vscode.",
)
@click.option(
    "--platform",
    metavar="NAME",
    help=f"The machine, if the source does not name it: {', '.join(PLATFORMS)}.",
)
@click.option(
    "--allow-platform-mismatch",
    is_flag=True,
    help="Show an Xfce desktop in recordings of other platforms (fidelity `foreign`).",
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Processes.",
)
@click.option(
    "--engine",
    metavar="NAME",
    default=LOCAL,
    show_default=True,
    help="This machine, or a cluster (ray).",
)
@click.option(
    "--ray-address",
    metavar="ADDRESS",
    help="A running Ray cluster, `auto` for the one of this machine.",
)
@click.option("--limit", type=int, metavar="N", help="Read the first N trajectories only.")
@click.option(
    "--splits",
    metavar="SHARES",
    help="Shares of the episodes, such as train=0.9,test=0.1.  [default: all is train]",
)
@click.option("--dry-run", is_flag=True, help="Write nothing; report what would be written.")
@click.option(
    "--overwrite", is_flag=True, help="Replace the existing dataset once the new one is complete."
)
@click.option("--strict", is_flag=True, help="Stop at the first input that cannot be read.")
@click.option("--resume", is_flag=True, help="Continue a build that was stopped.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def build(
    source: tuple[str, ...], as_json: bool, format_: str | None, lazy: bool | None, **options: Any
) -> None:
    """Build a Hugging Face dataset from recorded trajectories."""
    from .building.build import build as build_dataset

    meter = Meter(as_json)
    options["output"] = None if lazy is None else OUTPUTS[lazy]
    try:
        report = build_dataset(
            source, options.pop("out"), format=format_, progress=meter, **options
        )
    except KeyboardInterrupt:
        meter.close()
        echo("hijack: stopped; the same command with --resume goes on", err=True)
        raise SystemExit(130) from None
    finally:
        meter.close()
    _end(report.to_data() if as_json else report.lines(), report.exit_code)


def _end(result: Any, code: int) -> None:
    text = "\n".join(result) if isinstance(result, list) else json.dumps(result)
    echo(text)
    raise SystemExit(code)


@click.command(
    cls=BriefCommand, more=("assets", "boxes", "coordinates", "allow_platform_mismatch", "seed")
)
@click.argument("source", nargs=-1, required=True, metavar="SOURCE...")
@click.option(
    "--format",
    "format_",
    metavar="NAME",
    shell_complete=complete("pipelines.readers.base:READERS"),
    help="Reader of all files.  [default: detected for each file]",
)
@click.option(
    "--coordinates",
    type=click.Choice(COORDINATES),
    help="Space of the coordinates, if the recording does not state it.",
)
@click.option(
    "--boxes", type=click.Choice(BOXES), help="Order of a box's numbers, if it is not stated."
)
@click.option("--apps", metavar="A,B", help="Applications shown, if the source names none.")
@click.option("--platform", metavar="NAME", help="The machine, if the source names none.")
@click.option(
    "--allow-platform-mismatch",
    is_flag=True,
    help="Show an Xfce desktop in recordings of other platforms.",
)
@click.option(
    "--corruptions",
    metavar="A,B|all",
    default="all",
    show_default=True,
    shell_complete=complete("hijack_data.corruption:corruption_names", "all"),
    help="Which to try.",
)
@click.option(
    "--sample",
    type=int,
    default=SAMPLE,
    show_default=True,
    metavar="N",
    help="Trajectories of each format to try them on; 0: none.",
)
@seed_option()
@click.option(
    "--assets",
    metavar="DIR",
    help="Recorded pictures for corruptions of the machine.  [default: shipped]",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def inspect(source: tuple[str, ...], format_: str | None, as_json: bool, **options: Any) -> None:
    """Show the content of recordings, and the result of a build, without building."""
    from .inspection import inspect_source

    findings = inspect_source(source, format=format_, **options)
    if as_json:
        echo(json.dumps(findings.to_data()))
    else:
        console().print(*findings.tables(), sep="\n")
    raise SystemExit(findings.exit_code)


@click.command()
@click.argument("folder", metavar="DIR")
@click.option(
    "--source",
    multiple=True,
    metavar="RECORDINGS",
    help=(
        "Of a dataset: make all rows again from what it was built from; may be given more than"
        " once."
    ),
)
@click.option("--key", metavar="PUB", help="Of a run: the SSH public key that must have signed it.")
@click.option(
    "--run",
    "runs",
    multiple=True,
    metavar="RUN",
    help="Of a certificate.json: the run or results that it is about.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def verify(
    folder: str, source: tuple[str, ...], key: str | None, runs: tuple[str, ...], as_json: bool
) -> None:
    """Check every byte, picture, plan and label of a dataset, or of a run."""
    from .proof.rebuild import is_run, rebuild
    from .proof.run_checks.certificate import check_certificate
    from .proof.verify import verify as verify_dataset

    if Path(folder).is_file() or runs:
        if not runs:
            raise click.UsageError(f"{folder}: a certificate is computed again with --run RUN")
        if source or key is not None:
            raise click.UsageError("--source and --key do not go with a certificate")
        report: Findings = check_certificate(Path(folder), list(map(Path, runs)))
    elif is_run(folder):
        if source:
            raise click.UsageError("--source goes with a dataset; a run holds its own recordings")
        report = rebuild(folder, key)
    else:
        if key is not None:
            raise click.UsageError("--key is for runs: a dataset is not signed")
        report = verify_dataset(folder, source=source or None)
    _end(
        {"ok": report.ok, **dataclasses.asdict(report)} if as_json else report.lines(),
        report.exit_code,
    )


@click.command()
@click.argument("runs", type=click.Path(path_type=Path))
@click.option(
    "--key", metavar="KEY", required=True, help="SSH key, made by: ssh-keygen -t ed25519 -f KEY."
)
def sign(runs: Path, key: str) -> None:
    """Sign a run for its recipients, after verifying it: hijack sign RUNS --key KEY."""
    from hijack_data.file_io import unwritable
    from hijack_data.runs import seal

    from .proof.rebuild import rebuild

    seal.check_key(key)
    try:
        (runs / seal.SEAL).unlink(missing_ok=True)
    except OSError as error:
        raise unwritable(runs / seal.SEAL, error) from None
    report = rebuild(runs)
    if not report.ok or report.records is not None:
        reason = "its steps are not there" if report.ok else "hijack verify finds problems"
        echo("\n".join([*report.lines(), f"not signed: {reason}"]))
        raise SystemExit(1)
    seal.sign(runs, key)
    echo(f"{runs / seal.SEAL}: signed by {seal.signer(runs)}")


@click.command()
@click.argument("folder", metavar="DIR")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("-o", "--out", metavar="OUT.html", help="Write a page with pictures, too.")
def stats(folder: str, as_json: bool, out: str | None) -> None:
    """Show the figures of a dataset: counts, visible targets, changed pixels."""
    from hijack_data.file_io import write_atomic

    from .dataset.stats import stats as stats_of
    from .dataset.stats_page import page

    statistics = stats_of(folder)
    if out is not None:
        write_atomic(out, page(folder, statistics))
    if as_json:
        echo(json.dumps(statistics.to_data()))
    else:
        console().print(*statistics.tables(), *([f"page: {out}"] if out else []), sep="\n")


@click.command()
@click.argument("folder", metavar="DIR")
@click.option(
    "--to",
    required=True,
    metavar="NAME",
    shell_complete=complete("pipelines.exports:FORMATS", ONLOOKER),
    help=f"The format ({', '.join([*EXPORTS, ONLOOKER])}, FILE.py:CLASS).",
)
@click.option("-o", "--out", required=True, metavar="FOLDER", help="The folder to make.")
@click.option(
    "--dialect",
    type=click.Choice(DIALECTS),
    default=DIALECTS[0],
    show_default=True,
    help="How actions are written.",
)
@click.option("--keep-hidden", is_flag=True, help="Export steps whose target is hidden, too.")
@click.option(
    "--balance",
    type=float,
    metavar="N",
    help="onlooker: frames without a reminder for each with one.  [default: 1]",
)
@click.option("--split", metavar="NAME", help="The split, of a dataset that has several.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def export(folder: str, as_json: bool, **options: Any) -> None:
    """Export a dataset as chat rows, verl Parquet, WebDataset tar files or onlooker data."""
    from .exports import export as export_dataset

    meter = Meter(as_json)
    try:
        report = export_dataset(folder, options.pop("out"), progress=meter, **options)
    finally:
        meter.close()
    _end(report.to_data() if as_json else report.lines(), report.exit_code)
