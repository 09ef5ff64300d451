"""A gate for releases: scores that must not be too low, and a JUnit file for CI systems.

`ReleaseGate.read` checks the options of `gate_options` before anything is run, and
`ReleaseGate.conclude` judges a run.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hijack_data.cli.terminal import echo
from hijack_data.errors import HijackError, ParameterError, UnknownNameError, shorten_list, suggest
from hijack_data.plan import CLEAN
from hijack_data.runs.own_files import refuse_own_file

from ..results import scores
from ..results.reading import Run
from . import junit
from .gate_options import (
    CLEAN_FIRST,
    EXAMPLE,
    KNOWN,
    OF_AGENT,
    OPTION,
    OVER_CORRUPTIONS,
    PAIRED,
    RETENTION_LOW,
)
from .named_scores import REFERENCE_AGENTS
from .unplayable import counted_records

ROUNDING = 1e-9  # tolerance for rounding errors in sums of scores


@dataclass(frozen=True, kw_only=True)
class ScoreGate:
    """A score that must not be below a threshold.

    Args:
        score: One of `KNOWN`.
        label: The condition; empty for a score of the whole agent.
        agent: The agent.
        least: The threshold: -1 to 1 for `delta`, 0 to 1 for all others.
    """

    score: str
    label: str
    agent: str
    least: float

    @property
    def name(self) -> str:
        """The score as it is written in `--fail-under`, without the agent."""
        return f"{self.score}.{self.label}" if self.label else self.score

    def __str__(self) -> str:
        return f"{self.agent}:{self.name}={self.least:g}"


@dataclass(frozen=True)
class GateVerdict:
    """The result of a gate.

    Args:
        gate: The gate.
        value: Its score; `None` if there is none.
        lacking: The conditions without a value, if the score needs all.
    """

    gate: ScoreGate
    value: float | None
    lacking: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether the score is there and high enough."""
        return self.value is not None and self.value >= self.gate.least - ROUNDING

    def __str__(self) -> str:
        score_name = f"{self.gate.name} of {self.gate.agent}"
        if self.value is None:
            missing = shorten_list(self.lacking or (self.gate.label,))
            cause = "no episode counts"
            if self.gate.score in ("ci_low", RETENTION_LOW) and not scores.can_infer():
                cause = "scipy is not installed"
            elif self.gate.score in ("retention", RETENTION_LOW):
                cause = "no episode counts, or none succeeds clean"
            return f"{score_name} cannot be computed, {cause}: {missing} ({self.gate})"
        value = f"{self.value:.3f}"
        least = f"{self.gate.least:g}"
        if self.passed:
            return f"{score_name} is {value}, at least {least}"
        if float(value) >= float(least):  # rounded, it would not be below
            value = repr(self.value)
            least = repr(self.gate.least)
        return f"{score_name} is {value}, below {least}"


@dataclass(frozen=True, kw_only=True)
class ReleaseGate:
    """The gates of a run, and the file for their results.

    Args:
        gates: The gates, one for each score and agent.
        junit: The file to write; `None` for none.
        agents: The agents of the run, in the order of its tables.
        labels: Its conditions, likewise.
    """

    gates: tuple[ScoreGate, ...] = ()
    junit: Path | None = None
    agents: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()

    @classmethod
    def read(
        cls, texts: Sequence[str], junit: Path | None, agents: Sequence[str], labels: Sequence[str]
    ) -> "ReleaseGate":
        """Check the options of a command against the agents and conditions of the run.

        Args:
            texts: The values of `--fail-under`.
            junit: The value of `--junit`.
            agents: The agents of the run.
            labels: Its conditions, the clean one included.

        Raises:
            UnknownNameError: No score, agent or condition of that name; the message suggests one.
            ParameterError: The threshold is not in 0..1, or the run cannot have that score.
            HijackError: The file of `--junit` cannot be written there.
        """
        gates: list[ScoreGate] = []
        for text in texts:
            gates += _read_gate(text, agents, labels)
        if junit is not None:
            _check_writable(junit)
        return cls(gates=tuple(gates), junit=junit, agents=tuple(agents), labels=tuple(labels))

    def verdicts(self, run: Run) -> list[GateVerdict]:
        """Judge the gates on the episodes of a run so far."""
        groups = scores.group_records(counted_records(run))
        table = scores.rows_by_group(groups, self.agents, self.labels)
        return [_judge(gate, table, groups, self.labels) for gate in self.gates]

    def conclude(self, run: Run) -> bool:
        """Print a line on each gate to standard error, and write the JUnit file.

        Returns:
            Whether all gates are passed.

        Raises:
            HijackError: The file cannot be written.
        """
        verdicts = self.verdicts(run)
        for verdict in verdicts:
            words = "gate passed" if verdict.passed else "hijack: gate failed"
            echo(f"{words}: {verdict}", err=True)  # a report may be on stdout
        if self.junit is not None:
            cases = [
                junit.GateCase(name=str(v.gate), problem="" if v.passed else str(v))
                for v in verdicts
            ]
            junit.write(self.junit, run, cases)
        return all(verdict.passed for verdict in verdicts)


def _read_gate(text: str, agents: Sequence[str], labels: Sequence[str]) -> list[ScoreGate]:
    """Return the gates of one `--fail-under`.

    A gate without an agent applies to every agent; yardsticks are exempt if there are other agents.

    Raises:
        ParameterError: The text is not SCORE=X, or the number is out of range.
        UnknownNameError: There is no such score or agent.
    """
    score_name, equals, number = text.rpartition("=")
    if not equals:
        raise ParameterError(f"{OPTION} {text}: write SCORE=X, {EXAMPLE}")
    # Names of agents may hold colons (my_agent.py:MyAgent), those of scores do not.
    agent, colon, score_name = score_name.strip().rpartition(":")
    score, _, label = score_name.partition(".")
    if score not in KNOWN:
        raise UnknownNameError(f"{OPTION} {text}: no score {score!r}{suggest(score, KNOWN)}")
    if colon and agent not in agents:
        raise UnknownNameError(f"{OPTION} {text}: no agent {agent!r}{suggest(agent, agents)}")
    if not label and score in CLEAN_FIRST:
        label = CLEAN
    _check_label(text, score, label, labels)
    least = _threshold(text, score, number)
    contestants = [name for name in agents if name not in REFERENCE_AGENTS]
    agents_judged = [agent] if colon else contestants or agents
    return [ScoreGate(score=score, label=label, agent=name, least=least) for name in agents_judged]


def _check_label(text: str, score: str, label: str, labels: Sequence[str]) -> None:
    """Check that a run with these conditions has the score.

    Raises:
        UnknownNameError: It has no such condition.
        ParameterError: The score needs conditions that it does not have.
    """
    if label and score in OF_AGENT:
        raise ParameterError(f"{OPTION} {text}: {score} has no conditions; write {score}=X")
    if label == CLEAN and score in PAIRED:
        raise ParameterError(f"{OPTION} {text}: {score} compares a corruption with {CLEAN}")
    if label and label not in labels:
        raise UnknownNameError(
            f"{OPTION} {text}: the run has no condition {label!r}{suggest(label, labels)}"
        )
    if score in PAIRED and CLEAN not in labels:
        raise ParameterError(
            f"{OPTION} {text}: {score} needs the clean condition; add it to --corruptions"
        )
    over = score in OVER_CORRUPTIONS or score in PAIRED
    if over and all(name == CLEAN for name in labels):
        raise ParameterError(f"{OPTION} {text}: the run has no corruption")


def _threshold(text: str, score: str, number: str) -> float:
    """Return the number of a gate.

    Raises:
        ParameterError: The text is not a number, or the number is out of range.
    """
    low = -1.0 if score == "delta" else 0.0
    try:
        least = float(number)
    except ValueError:
        least = math.nan
    if not low <= least <= 1:
        raise ParameterError(
            f"{OPTION} {text}: {number.strip()!r} must be a number from {low:g} to 1 (80 % is 0.8)"
        )
    return least


def _judge(
    gate: ScoreGate,
    table: Sequence[scores.ScoreRow],
    groups: scores.GroupedRecords,
    labels: Sequence[str],
) -> GateVerdict:
    """Judge a gate on the table of a run, and on the scores that it was made from."""
    agent_rows = [row for row in table if row["agent"] == gate.agent]
    column = "success" if gate.score in OF_AGENT else gate.score
    if gate.score == RETENTION_LOW:
        played = [row["corruption"] for row in agent_rows if row["corruption"] != CLEAN]
        by_label = {label: _retention_low(gate.agent, [label], groups) for label in played}
    else:
        by_label = {row["corruption"]: row[column] for row in agent_rows}
    if gate.label:
        return GateVerdict(gate, by_label.get(gate.label))
    needed_labels = list(labels)
    if gate.score in PAIRED:
        needed_labels.remove(CLEAN)
    # If a condition is missing, the mean of the others would pass for the mean of all.
    lacking = tuple(label for label in needed_labels if by_label.get(label) is None)
    if lacking:
        return GateVerdict(gate, None, lacking)
    if gate.score in OF_AGENT:
        (summary,) = scores.summaries(agent_rows)
        return GateVerdict(gate, summary[OF_AGENT[gate.score]])
    if gate.score == RETENTION_LOW:
        return GateVerdict(gate, _retention_low(gate.agent, needed_labels, groups))
    return GateVerdict(gate, _overall_score(gate, needed_labels, groups))


def _overall_score(
    gate: ScoreGate, labels: Sequence[str], groups: scores.GroupedRecords
) -> float | None:
    """Return the retention or the difference over all corruptions together."""
    if groups.paired:
        clean_scores, corrupted_scores, _ = scores.pooled_pairs(gate.agent, labels, groups)
    else:
        (clean_scores, _), (corrupted_scores, _) = scores.pooled_samples(gate.agent, labels, groups)
    if not len(clean_scores) or not len(corrupted_scores):
        return None
    counts_apart = len(clean_scores) / len(corrupted_scores)  # 1 for pairs
    if gate.score == "retention":
        total = sum(clean_scores)
        return sum(corrupted_scores) / total * counts_apart if total else None
    return (sum(corrupted_scores) * counts_apart - sum(clean_scores)) / len(clean_scores)


def _retention_low(
    agent: str, labels: Sequence[str], groups: scores.GroupedRecords
) -> float | None:
    """Return the lower end of the 95 % interval of the retention over some corruptions."""
    if not scores.can_infer():
        return None
    from ..results.statistics import retention_interval, unpaired_retention_interval

    if groups.paired:
        cases = scores.pooled_pairs(agent, labels, groups)
        interval = retention_interval(*cases) if len(cases[0]) else None
    else:
        clean, corrupted = scores.pooled_samples(agent, labels, groups)
        has_both = len(clean[0]) and len(corrupted[0])
        interval = unpaired_retention_interval(clean, corrupted) if has_both else None
    return None if interval is None else interval.low


def _check_writable(path: Path) -> None:
    """Check that a file can be made, before hours of work are lost to a typing error.

    A missing folder is no problem, since it is created with the file.

    Raises:
        HijackError: The file cannot be made.
    """
    if path.is_dir():
        raise HijackError(f"--junit {path}: is a folder; name a file")
    refuse_own_file(path, "--junit")
    folder = path.absolute().parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise HijackError(f"--junit {path}: {folder} is not a folder that can be written")
