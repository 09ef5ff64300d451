"""`hijack train`.

Exit codes: 0 done, 2 bad usage or configuration or a run that failed, 3 the disk is full or fails.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from hijack_data import extras
from hijack_data.cli.completion import complete_configuration
from hijack_data.cli.options import BriefCommand
from hijack_data.cli.terminal import echo
from hijack_data.file_io import write_atomic

SUMMARY = "summary.json"
TABLE = "table.md"
PLOT = "gains.svg"


@click.command(cls=BriefCommand, more=("data", "epochs", "model", "workers"))
@click.argument("config", shell_complete=complete_configuration("train"))
@click.option(
    "-o",
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Folder of the results.  [default: runs/train/NAME]",
)
@click.option(
    "--arms",
    metavar="A,B|all",
    help="What is compared, instead of CONFIG's: grpo, da_grpo, per_group, no_replay ...",
)
@click.option(
    "--seeds",
    type=click.IntRange(2, 1000),
    metavar="N",
    help="Seeds 0 to N-1, instead of CONFIG's.",
)
@click.option(
    "--epochs", type=click.IntRange(1, 10_000), metavar="N", help="Epochs, instead of CONFIG's."
)
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    default=2,
    show_default=True,
    metavar="N",
    help="Processes, of one thread each; their number changes no result.",
)
@click.option(
    "--model",
    metavar="NAME|DIR",
    help="With method sft: the model that is fine-tuned, instead of CONFIG's.",
)
@click.option(
    "--data",
    multiple=True,
    metavar="DIR",
    help="With method sft: a folder of hijack export, instead of CONFIG's; may be repeated.",
)
@click.option("--resume", is_flag=True, help="Go on in DIR, or add arms and seeds to it.")
@click.option("--dry-run", is_flag=True, help="Check the configuration, list the runs, run none.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object.")
def train(
    config: str,
    out: Path | None,
    arms: str | None,
    seeds: int | None,
    epochs: int | None,
    workers: int,
    model: str | None,
    data: tuple[str, ...],
    resume: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Train with corruptions (DA-GRPO) and without (GRPO), and compare them on unseen tasks.

    Such as: hijack train configs/train/toy.yaml --out runs/toy

    With "method: sft" in CONFIG, fine-tune a vision model on exports instead, such as: hijack train
    configs/train/sft.yaml --model DIR --data chat --out runs/sft
    """
    from .sft.settings import METHOD, read_method

    if read_method(config) == METHOD:
        _refuse(f"not for method {METHOD}", arms=arms, seeds=seeds)
        _fine_tune(
            config,
            out,
            {"model": model, "data": data, "epochs": epochs},
            resume=resume,
            dry_run=dry_run,
            as_json=as_json,
        )
        return
    _refuse(f"for method {METHOD} only", model=model, data=data or None)
    extras.require("hijack train", "train", ("torch", "gymnasium", "scipy"))
    from .split import check_split
    from .toy.settings import check_tasks, load_replication

    replication = load_replication(config)
    replication = _override(replication, arms, seeds, epochs)
    check_split(replication.training, replication.evaluation, source=replication.source)
    check_tasks(replication)
    if dry_run:
        for seed in range(replication.seeds):
            for arm in replication.arms:
                echo(f"{arm}, seed {seed}")
        return
    folder = _folder(config, out, resume)
    _run(replication, folder, workers, as_json)


def _refuse(reason: str, **options: object) -> None:
    """Refuse options that do not apply.

    Raises:
        UsageError: one of the options has a value.
    """
    for name, value in options.items():
        if value is not None:
            raise click.UsageError(f"--{name} is {reason}")


def _folder(config: str, out: Path | None, resume: bool) -> Path:
    folder = out or Path("runs") / "train" / Path(config).stem
    if folder.exists() and any(folder.iterdir()) and not resume:
        raise click.UsageError(f"{folder} is not empty; --resume goes on there, or give --out")
    return folder


def _fine_tune(
    config: str,
    out: Path | None,
    changes: dict[str, Any],
    *,
    resume: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    from .sft import fine_tuning
    from .sft.settings import load_sft

    settings = fine_tuning.override_settings(load_sft(config), **changes)
    rows = fine_tuning.read_examples(settings)
    if dry_run:
        for name, examples in rows.items():
            echo(f"{name}: {len(examples)} rows")
        return
    extras.require("hijack train with method sft", "trl", ("torch", "transformers", "trl"))
    folder = _folder(config, out, resume)
    summary = fine_tuning.fine_tune(
        settings, folder, rows=rows, resume=resume, say=lambda line: echo(line, err=True)
    )
    if as_json:
        echo(json.dumps(summary))
        return
    echo(
        f"{folder / fine_tuning.MODEL}: {summary['steps']} steps, loss {summary['first_loss']:.4g}"
        f" in the first, {summary['last_loss']:.4g} in the last"
    )


def _override(replication: Any, arms: str | None, seeds: int | None, epochs: int | None) -> Any:
    from .toy.arms import ARMS
    from .toy.settings import check_arm

    changes: dict[str, Any] = {}
    if arms is not None:
        names = list(ARMS) if arms.strip() == "all" else [name.strip() for name in arms.split(",")]
        for name in names:
            check_arm(name)
        changes["arms"] = tuple(dict.fromkeys(names))
    if seeds is not None:
        changes["seeds"] = seeds
    if epochs is not None:
        changes["epochs"] = epochs
    return replace(replication, **changes)


def _run(replication: Any, folder: Path, workers: int, as_json: bool) -> None:
    from .toy import results
    from .toy.experiment import run_replication

    def say(line: str) -> None:
        echo(line, err=True)

    try:
        scores = run_replication(replication, folder, workers=workers, say=say)
    except KeyboardInterrupt:
        echo("hijack: stopped; the same command with --resume goes on", err=True)
        raise SystemExit(130) from None
    summary = results.summarise(replication, scores)
    write_atomic(folder / SUMMARY, json.dumps(summary, indent=1) + "\n")
    tables = f"{results.arms_table(summary)}\n\n{results.conditions_table(summary)}\n"
    write_atomic(folder / TABLE, tables)
    if extras.lacking(("matplotlib",)):
        say(f"no plot was drawn, it needs matplotlib: {extras.remedy('train')}")
    else:
        results.plot(summary, folder / PLOT)
    echo(json.dumps(summary) if as_json else tables.rstrip())
