"""Runs a supervised fine-tuning with TRL's `SFTTrainer`."""

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from hijack_data import extras
from hijack_data.errors import ParameterError, UnknownNameError, suggest
from hijack_data.file_io import make_folder, write_atomic

from ..errors import TrainError
from .chat_rows import ChatRow, check_rows, read_rows
from .settings import SftSettings

SUMMARY = "summary.json"
MODEL = "model"
CHECKPOINTS = "checkpoints"
RUN = "run.json"  # what the checkpoints were trained with
# Fields of the settings that may change when a run is resumed: the rows have a digest.
_FREE = ("data", "evaluation", "osworld_split", "epochs", "source")


def read_examples(settings: SftSettings) -> dict[str, list[ChatRow]]:
    """Return the examples of each folder, after the leak check.

    Raises:
        DatasetError: a folder is not an export, or a row is damaged.
        LeakError: a row is of a task that is held out or reported.
        ParameterError: there is no folder, or no example in all of them.
    """
    if not settings.data:
        raise ParameterError(f"{settings.source}: data names no folder; give some with --data DIR")
    examples: dict[str, list[ChatRow]] = {}
    for folder in settings.folders:
        rows = read_rows(folder)
        check_rows(
            rows, settings.evaluation, source=str(folder), osworld_split=settings.osworld_split
        )
        examples[str(folder)] = rows
    if not any(examples.values()):
        raise ParameterError(f"{', '.join(examples)}: there are no examples")
    return examples


def fine_tune(
    settings: SftSettings,
    out: Path,
    *,
    rows: dict[str, list[ChatRow]] | None = None,
    resume: bool = False,
    say: Callable[[str], object] = lambda _: None,
) -> dict[str, Any]:
    """Fine-tune a model, save it to `out/model`, and return the summary.

    The loss is that of the answers; questions and pictures are only read.

    Args:
        settings: what is trained on what.
        out: the folder of the results.
        rows: what `read_examples` returned; it is read if omitted.
        resume: go on from the last checkpoint in it.
        say: called with a line on what is read.

    Raises:
        TrainError: the loss is not finite, the model cannot be loaded or is not made for pictures,
            or there is no checkpoint of this run to go on from.
    """
    rows = read_examples(settings) if rows is None else rows
    for folder, examples in rows.items():
        say(f"{folder}: {len(examples)} rows")
    all_rows = [row for examples in rows.values() for row in examples]
    identity = _identity(settings, all_rows)
    trainer = _trainer(settings, all_rows, out)
    checkpoint = _last_checkpoint(out, identity) if resume else None
    if checkpoint is None:
        make_folder(out)
        write_atomic(out / RUN, json.dumps(identity, indent=1) + "\n")
    trainer.train(resume_from_checkpoint=checkpoint)
    trainer.save_model(str(out / MODEL))
    losses = [
        {"step": entry["step"], "loss": entry["loss"]}
        for entry in trainer.state.log_history
        if "loss" in entry
    ]
    summary = {
        "method": "sft",
        "model": settings.model,
        "rows": {folder: len(examples) for folder, examples in rows.items()},
        "settings": {**asdict(settings), "trl": dict(settings.trl)},
        "steps": int(trainer.state.global_step),
        "first_loss": losses[0]["loss"] if losses else None,
        "last_loss": losses[-1]["loss"] if losses else None,
        "losses": losses,
    }
    write_atomic(out / SUMMARY, json.dumps(summary, indent=1) + "\n")
    return summary


def _trainer(settings: SftSettings, rows: list[ChatRow], out: Path) -> Any:
    from transformers import AutoModelForImageTextToText, AutoProcessor

    from ..adapters.finite_callback import FiniteCallback

    config = _config(settings, out)
    try:
        processor = AutoProcessor.from_pretrained(settings.model)
        model = AutoModelForImageTextToText.from_pretrained(settings.model)
    except (OSError, ValueError, KeyError) as error:
        reason = str(error).splitlines()[0]
        raise TrainError(f"model {settings.model!r} cannot be loaded: {reason}") from error
    images = getattr(processor, "image_processor", None)
    if images is None:
        raise TrainError(f"model {settings.model!r} takes no pictures: it has no image processor")
    if settings.max_pixels is not None:
        _limit_pixels(images, settings.max_pixels)
    trl: Any = extras.load("trl", "method sft", "trl")
    return trl.SFTTrainer(
        model=model,
        args=config,
        train_dataset=_dataset(rows),
        processing_class=processor,
        callbacks=[FiniteCallback()],
    )


def _limit_pixels(images: Any, max_pixels: int) -> None:
    """Have an image processor of Qwen's kind scale pictures to at most `max_pixels` pixels.

    Raises:
        ParameterError: its sizes are not such limits.
    """
    least = getattr(images.size, "shortest_edge", None)
    if least is None or getattr(images.size, "longest_edge", None) is None:
        raise ParameterError(
            f"max_pixels: the image processor has sizes of another kind ({images.size}); set it to"
            " null, and scale the pictures of the dataset"
        )
    images.size = type(images.size)(shortest_edge=min(least, max_pixels), longest_edge=max_pixels)


def _config(settings: SftSettings, out: Path) -> Any:
    """Return TRL's configuration.

    Raises:
        UnknownNameError: `trl` has a field that TRL does not know, or one that is a key of ours.
    """
    trl: Any = extras.load("trl", "method sft", "trl")
    fixed: dict[str, Any] = {
        "output_dir": str(out / CHECKPOINTS),
        "num_train_epochs": settings.epochs,
        "per_device_train_batch_size": settings.batch,
        "gradient_accumulation_steps": settings.accumulation,
        "learning_rate": settings.learning_rate,
        "seed": settings.seed,
        "remove_unused_columns": False,  # they are made when a row is asked for
        "completion_only_loss": True,
    }
    defaults: dict[str, Any] = {
        "max_length": None,  # TRL's 1024 would cut through the pictures
        "logging_steps": 1,
        "report_to": [],
        "save_strategy": "epoch",
    }
    names = {config_field.name for config_field in fields(trl.SFTConfig)}
    for name in settings.trl:
        if name in fixed:
            raise UnknownNameError(f"{settings.source}: trl: {name} is set by the keys beside trl")
        if name not in names:
            raise UnknownNameError(
                f"{settings.source}: trl: SFTConfig has no {name!r}{suggest(name, sorted(names))}"
            )
    return trl.SFTConfig(**{**defaults, **settings.trl, **fixed})


def _dataset(rows: list[ChatRow]) -> Any:
    """Return a dataset that opens pictures when an example is asked for."""
    from datasets import Dataset

    def open_rows(batch: dict[str, list[int]]) -> dict[str, list[Any]]:
        examples = [rows[number].example() for number in batch["number"]]
        return {name: [example[name] for example in examples] for name in examples[0]}

    return Dataset.from_dict({"number": list(range(len(rows)))}).with_transform(open_rows)


def _identity(settings: SftSettings, rows: list[ChatRow]) -> dict[str, Any]:
    """Return what a run is trained with, as JSON data: it may only be resumed with the same."""
    values = {name: value for name, value in asdict(settings).items() if name not in _FREE}
    texts = [[row.question, row.answer, row.trajectory, len(row.pictures)] for row in rows]
    digest = hashlib.sha256(json.dumps(texts).encode()).hexdigest()
    return json.loads(json.dumps({**values, "trl": dict(settings.trl), "rows": digest}))


def _last_checkpoint(out: Path, identity: dict[str, Any]) -> str:
    """Return the last checkpoint of a run.

    Raises:
        TrainError: there is none, or its run was another one.
    """
    from transformers.trainer_utils import get_last_checkpoint

    folder = out / CHECKPOINTS
    checkpoint = get_last_checkpoint(str(folder)) if os.path.isdir(folder) else None
    if checkpoint is None:
        raise TrainError(f"{folder}: there is no checkpoint to go on from; leave out --resume")
    path = out / RUN
    try:
        stored = dict(json.loads(path.read_bytes()))
    except (OSError, ValueError, TypeError) as error:
        raise TrainError(
            f"{path}: what the checkpoints were trained with cannot be read ({error}); begin again"
            " in another folder"
        ) from None
    if stored != identity:
        keys = [key for key, value in identity.items() if stored.get(key) != value]
        raise TrainError(
            f"{path}: the checkpoints are those of another run; it differs in {', '.join(keys)}."
            " Give those as they were, or another folder"
        )
    return checkpoint


def override_settings(
    settings: SftSettings, *, model: str | None, data: tuple[str, ...], epochs: int | None
) -> SftSettings:
    """Return the settings with what the command line says instead."""
    changes: dict[str, Any] = {"model": model, "data": data or None, "epochs": epochs}
    values = {name: value for name, value in changes.items() if value is not None}
    return replace(settings, **values)
