"""Studies of AgentLab and BrowserGym: a folder with `summary_info.json` for each experiment.

The name of the folder says agent, task and seed (`DATE_AGENT_on_TASK_SEED`); `exp_args.pkl` says so
too, but a pickle of somebody else is code, and is not opened.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..outcomes import EpisodeOutcome, OutcomeError
from .result_folders import check_score, field, find_condition, read_object, sum_amounts

SUMMARY = "summary_info.json"
ARGUMENTS = "exp_args.pkl"
_TOKENS = ("stats.cum_input_tokens", "stats.cum_output_tokens")
_COST = "stats.cum_cost"
_JOINT = "_on_"
# Older versions append six digits of a hash, newer ones a number where a name is taken.
_NAME = re.compile(
    r"\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d_(?P<agent>.+)_on_(?P<task>.+?)_(?P<seed>\d+)(_[0-9a-f]{6})?"
)
_TWO_NUMBERS = re.compile(r"_\d+_\d+$")


class AgentLabReader:
    """Reads the experiments of a study, or of a folder of studies.

    The score is `cum_reward`. An experiment that ended with an error, or that did not end, has no
    outcome; those that AgentLab ran again (`_...`) are left out, as AgentLab does. The condition is
    a folder named after a corruption, or `--columns condition=N`. AgentLab writes 0 tokens and 0
    USD where it does not know them, so these say nothing.
    """

    fields = ("condition",)

    def detect(self, source: Path) -> bool:
        """Return whether a folder holds an experiment of AgentLab."""
        return source.is_dir() and next(_experiments(source), None) is not None

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcome of each experiment, in the order of their folders.

        Args:
            source: the folder of a study, of several, or of an experiment.
            columns: the number of a folder for `condition`.

        Raises:
            OutcomeError: the name of a folder or its summary has another form.
        """
        for folder in sorted(_experiments(source)):
            agent, task, seed = _parse_name(folder)
            path = folder / SUMMARY
            summary = _read_summary(path)
            score, problem = _score(summary, path)
            yield EpisodeOutcome(
                agent=agent,
                task=task,
                condition=find_condition(source, folder, columns),
                score=score,
                seed=seed,
                problem=problem,
                steps=sum_amounts(summary, path, "n_steps"),
                tokens=sum_amounts(summary, path, *_TOKENS) or None,
                cost=sum_amounts(summary, path, _COST) or None,
            )


def _experiments(source: Path) -> Iterator[Path]:
    """Yield the folders of experiments, without those that AgentLab hides."""
    folders = {path.parent: None for name in (ARGUMENTS, SUMMARY) for path in source.rglob(name)}
    for folder in folders:
        if not folder.name.startswith(("_", ".")):
            yield folder


def _parse_name(folder: Path) -> tuple[str, str, int]:
    """Return agent, task and seed from the name of a folder.

    Raises:
        OutcomeError: they cannot be told.
    """
    name = folder.resolve().name
    match = _NAME.fullmatch(name)
    if match is None:
        raise OutcomeError(
            f"{folder}: the name is not DATE_AGENT{_JOINT}TASK_SEED, as AgentLab names experiments"
        )
    if name.count(_JOINT) > 1 or _TWO_NUMBERS.search(name):
        raise OutcomeError(
            f"{folder}: the name does not tell where agent, task and seed end; rename it to"
            f" DATE_AGENT{_JOINT}TASK_SEED with one {_JOINT!r} and one number at its end"
        )
    return match["agent"], match["task"], int(match["seed"])


def _read_summary(path: Path) -> dict[str, Any] | None:
    """Return a summary; `None` if the experiment has none."""
    if not path.exists() or not path.stat().st_size:
        return None
    return read_object(path, "a summary of AgentLab")


def _score(summary: Mapping[str, Any] | None, path: Path) -> tuple[float | None, str]:
    """Return the score of an experiment, or `None` and why it has none.

    Raises:
        OutcomeError: the summary has another form.
    """
    if summary is None:
        return None, f"has no {SUMMARY}"
    error = field(summary, path, "err_msg", kind=(str, type(None)))
    reward = field(summary, path, "cum_reward", kind=(int, float))
    if error:
        return None, f"ended with an error: {error[:200]}"
    if not (summary.get("terminated") or summary.get("truncated")):
        return None, "did not end"
    return check_score(reward, path, "cum_reward"), ""
