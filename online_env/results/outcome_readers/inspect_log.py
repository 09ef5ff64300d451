"""Logs of Inspect, `.eval` or JSON, through its public functions."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from hijack_data.choices import CLEAN
from hijack_data.errors import short_repr, shorten_list, suggest

from ...extra import require
from ..outcomes import EpisodeOutcome, OutcomeError

_HEAD_BYTES = 512
_GRADES = {"C": 1.0, "I": 0.0, "P": 0.5}  # Inspect's letters: correct, incorrect, partial
# Where a sample says what it is, unless --columns does: keys of its metadata, the log's metadata
# or the arguments of the task.
_KEYS: Mapping[str, Sequence[str]] = {
    "task": ("task",),
    "condition": ("condition", "corruption"),
    "seed": ("seed",),
    "agent": ("agent",),
}


class InspectReader:
    """Reads logs of Inspect; an agent is a model, a task a sample, and epochs repeat it.

    A sample that ended with an error, that was not scored or is invalidated has no outcome. Steps
    are turns; tokens and cost are those of the evaluated model, without the models that grade.
    """

    fields = ("task", "condition", "agent", "score", "seed")

    def detect(self, source: Path) -> bool:
        """Return whether a file is a log, or a folder holds some."""
        if source.is_dir():
            return any(source.glob("*.eval"))
        return _is_log(source)

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcomes of the samples of a log, or of all logs of a folder.

        Args:
            source: the file or folder.
            columns: keys of metadata or task arguments by field; for `score`, the name of a scorer.

        Raises:
            OutcomeError: a log cannot be read, a folder has more logs below, or a score is no
                number in 0..1.
        """
        require("a log of Inspect", ("inspect_ai",))
        from inspect_ai.log import read_eval_log

        for path in _find_logs(source):
            try:
                log = read_eval_log(path)
            except (OSError, ValueError, KeyError, RuntimeError, BadZipFile) as error:
                reason = " ".join(str(error).split())[:200]
                raise OutcomeError(f"{path}: is no log of Inspect ({reason})") from None
            if not log.samples:
                raise OutcomeError(f"{path}: holds no samples (its status is {log.status})")
            planned = len(log.eval.dataset.sample_ids or ()) * (log.eval.config.epochs or 1)
            if log.status != "success" and not 0 < planned <= len(log.samples):
                raise OutcomeError(
                    f"{path}: holds {len(log.samples)} of {planned or 'an unknown number of'}"
                    f" samples (its status is {log.status}); finish it with inspect eval-retry"
                )
            for sample in log.samples:
                yield _outcome(path, log, sample, columns)


def _is_log(path: Path) -> bool:
    if path.suffix == ".json" and path.is_file():
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
        return b'"status"' in head and b'"eval"' in head and b'"format"' not in head
    return path.suffix == ".eval"


def _find_logs(source: Path) -> Sequence[Path]:
    """Return the logs of a folder in both formats, or the one that the source is.

    Raises:
        OutcomeError: folders below it hold further logs, which would be left out.
    """
    if not source.is_dir():
        return [source]
    logs = sorted(path for path in source.rglob("*") if _is_log(path))
    below = next((path.parent for path in logs if path.parent != source), None)
    if below is not None:
        raise OutcomeError(
            f"{source}: {below} holds logs, too; give each folder with logs as a source"
        )
    return logs


def _outcome(path: Path, log: Any, sample: Any, columns: Mapping[str, str]) -> EpisodeOutcome:
    location = f"{path}: sample {sample.id}"
    score, problem = _score(sample, columns.get("score"), location)
    seed = _value(log, sample, "seed", columns, location)
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int)):
        raise OutcomeError(f"{location}: the seed {short_repr(seed)} is no whole number")
    is_repeated = (log.eval.config.epochs or 1) > 1
    if seed is None or is_repeated:
        seed = sample.epoch - 1 if seed is None else None  # both: numbered in their order
    task = _value(log, sample, "task", columns, location)
    agent, condition = (
        _value(log, sample, name, columns, location) for name in ("agent", "condition")
    )
    usage = sample.model_usage.get(log.eval.model)
    return EpisodeOutcome(
        agent=log.eval.model if agent is None else str(agent),
        task=f"{log.eval.task}/{sample.id}" if task is None else str(task),
        condition=CLEAN if condition is None else str(condition),
        score=score,
        seed=seed,
        problem=problem,
        version=f"inspect_ai {log.eval.packages.get('inspect_ai', 'of no stated version')}",
        content=_content(log, sample) if task is None else "",
        steps=sample.turn_count,
        tokens=None if usage is None else float(usage.total_tokens),
        cost=None if usage is None else usage.total_cost,
    )


def _content(log: Any, sample: Any) -> str:
    """Return what identifies a sample: a number that Inspect gave says little without its input."""
    version = f"version {log.eval.task_version}"
    if not isinstance(sample.id, int):
        return version
    digest = hashlib.sha256(repr(sample.input).encode(errors="replace")).hexdigest()
    return f"{version}, input {digest[:8]}"


def _value(log: Any, sample: Any, field: str, columns: Mapping[str, str], location: str) -> Any:
    """Return what a sample or its log says of a field; `None` if nothing does.

    Raises:
        OutcomeError: the key that was stated is nowhere, or names nothing.
    """
    mappings = (sample.metadata or {}, log.eval.metadata or {}, log.eval.task_args or {})
    keys = (columns[field],) if field in columns else _KEYS[field]
    for key in keys:
        for mapping in mappings:
            if mapping.get(key) not in (None, ""):
                return mapping[key]
            if field in columns and key in mapping:
                raise OutcomeError(f"{location}: {key} names no {field}")
    if field in columns:
        keys_in_log = [key for mapping in mappings for key in mapping]
        raise OutcomeError(
            f"{location}: neither metadata nor task arguments have {columns[field]!r}"
            f"{suggest(columns[field], keys_in_log)}"
        )
    return None


def _score(sample: Any, scorer: str | None, location: str) -> tuple[float | None, str]:
    """Return the score of a sample, or why there is none.

    Raises:
        OutcomeError: there are several scorers and none was chosen, or a value is no score.
    """
    if sample.invalidation is not None:
        return None, f"is invalidated: {sample.invalidation.reason or 'no reason'}"[:200]
    if sample.error is not None:
        return None, f"ended with an error: {sample.error.message[:200]}"
    scores = sample.scores or {}
    if scorer is not None and scorer not in scores and scores:
        raise OutcomeError(f"{location}: has no scorer {scorer!r}{suggest(scorer, list(scores))}")
    if scorer is None and len(scores) > 1:
        raise OutcomeError(
            f"{location}: has several scorers ({shorten_list(list(scores))}); choose one with"
            " --columns score=NAME"
        )
    if not scores:
        return None, "was not scored"
    value = scores[scorer or next(iter(scores))].value
    number = _GRADES.get(value) if isinstance(value, str) else value
    if isinstance(number, bool):
        return float(number), ""
    if isinstance(number, int | float) and isnan(number):
        return None, "was not scored"
    if not isinstance(number, int | float) or not 0 <= number <= 1:
        raise OutcomeError(
            f"{location}: the score {short_repr(value)} is none of C, I and P and no number in 0..1"
        )
    return float(number), ""
