"""A certificate: an agent keeps at least so much of its clean success, with so much confidence.

It is computed from the records of a run alone, so that anybody who has them computes it again
(`hijack verify certificate.json --run RUN`). It states the distribution of disturbances that it is
about, the method and why it was chosen, and digests of what it was computed from. Results of other
harnesses do not say what their conditions did, so whoever certifies declares it.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from hijack_data.corruption import find_corruption
from hijack_data.errors import (
    HijackError,
    ParameterError,
    UnknownNameError,
    quantity,
    short_repr,
    shorten_list,
    suggest,
)
from hijack_data.file_io import read_versioned_json
from hijack_data.plan import CLEAN
from hijack_data.runs.privileged_inputs import collect_privileged_inputs, describe_privileged_inputs
from hijack_data.runs.run_log import GIVEN_KINDS, RECORDS, file_digest, sha256_hex

from ..choices import CONFIDENCE
from ..extra import require
from ..results import reading
from ..results.mean_bounds import clopper_pearson_lower, gaffke_retention_bound
from ..results.outcomes import READ_WITH, RESULTS, collect_run
from ..results.reading import Run
from ..results.records import difference
from ..results.stop_rule import StopRule, settle_bets
from ..results.task_retention import TaskRetention, score_tasks
from .identity import agent_names, corruption_entries, run_identity, severity_level
from .model import ReportError
from .unplayable import counted_records

FORMAT = "agenthijack-certificate"
VERSION = 1
DIGITS = 4  # of the bound, which is rounded down
WEIGHT_DIGITS = 9
CLOPPER_PEARSON = "clopper-pearson"
GAFFKE = "gaffke"
BETTING = "betting"
REASONS: Mapping[str, str] = {
    CLOPPER_PEARSON: (
        "each task is one independent trial, solved or not: exact, over the tasks that were solved"
        " clean (one that only the corrupted episode solves does not count)"
    ),
    GAFFKE: (
        "tasks repeat under several conditions or seeds, or scores are partial: tasks are the"
        " cases, and Gaffke's bound holds for few of them, also where all agree"
    ),
    BETTING: (
        "the run could end after any task: a confidence sequence by betting holds at all times"
    ),
}


class CertificateError(ReportError):
    """A certificate that cannot be made or read; the message has the remedy."""


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """A condition of the declared distribution.

    Attributes:
        condition: its label.
        corruption: the name of the corruption; `None` in results of other harnesses.
        severity: the level, 1 to 5, whose parameters it has; `None` if it has those of no level.
        parameters: those of the corruption, all of them.
        weight: its share of the distribution.
    """

    condition: str
    corruption: str | None
    severity: int | None
    parameters: Mapping[str, Any]
    weight: float


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """A one-sided bound of the retention of an agent.

    Attributes:
        statement: it, in words.
        agent: the agent.
        retention_at_least: the bound, rounded down.
        confidence: the level, between 0.5 and 1.
        method: `clopper-pearson`, `gaffke` or `betting`.
        reason: why this method.
        retention: the estimate, which the bound is below.
        clean: mean clean score of the tasks.
        corrupted: mean corrupted score, weighted.
        distribution: of the disturbances.
        declaration: what the conditions of results of other harnesses are, in the words of whoever
            certifies; empty for a run of this library, which says so itself.
        conditions_left_out: those that the run has, and the distribution does not.
        tasks: how many tasks, the independent cases.
        seeds: of variants and of the corruptions' draws.
        episodes: how many have a score.
        missing: ids of those without one, which count as lost.
        missing_as_lost: whether this was asked for, or stated before the run.
        until_retention: when the run was to end, if it could end early.
        run: its name.
        read_with: how results of other harnesses were read, as `collect_run` takes it; `None` for a
            run of this library.
        head_sha256: of `run.json`; empty for results of other harnesses.
        records_sha256: of `records.jsonl`, likewise.
        scores_sha256: of all scores that were used, one line each.
        versions: of Python, the system and the packages that played it.
    """

    statement: str
    agent: str
    retention_at_least: float
    confidence: float
    method: str
    reason: str
    retention: float
    clean: float
    corrupted: float
    distribution: tuple[Disturbance, ...]
    declaration: str
    conditions_left_out: tuple[str, ...]
    tasks: int
    seeds: tuple[int, ...]
    episodes: int
    missing: tuple[str, ...]
    missing_as_lost: bool
    until_retention: Mapping[str, Any] | None
    run: str
    read_with: Mapping[str, Any] | None
    head_sha256: str
    records_sha256: str
    scores_sha256: str
    versions: Mapping[str, str]

    def to_data(self) -> dict[str, Any]:
        """Return the certificate as JSON data, with its format and version."""
        data = {"format": FORMAT, "version": VERSION, **asdict(self)}
        return json.loads(json.dumps(data, allow_nan=False))


def certify(
    run: Run,
    *,
    agent: str = "",
    weights: Mapping[str, float] | None = None,
    confidence: float = CONFIDENCE,
    missing_as_lost: bool = False,
    declaration: str = "",
) -> Certificate:
    """Return a certificate of a run.

    Args:
        run: a complete run with a clean condition, of this library or of `collect_run`.
        agent: its name; may be left out if the run has one.
        weights: of the conditions that the distribution has, above 0; `None` for all, equally.
        confidence: the level, between 0.5 and 1.
        missing_as_lost: count an episode without a score as solved if it is clean, and as lost if
            it is not, instead of refusing the run.
        declaration: what the conditions did, in words; for results of other harnesses alone, which
            do not say it.

    Raises:
        CertificateError: the run is not complete, its disturbances are not declared, a task was
            not played under all conditions, or no task is solved clean.
        UnknownNameError: the run has no such agent or condition.
        ParameterError: a number is out of range.
        MissingDependencyError: scipy is not installed.
    """
    require("a certificate", ("scipy",))
    if not 0.5 < confidence < 1:
        raise ParameterError(f"confidence must be above 0.5 and below 1, got {confidence!r}")
    _check_complete(run)
    declared = _check_declaration(run, declaration)
    name = _choose_agent(run, agent)
    rule = StopRule.read(run.config)
    if rule is not None:
        if weights is not None or confidence != CONFIDENCE:
            raise CertificateError(
                f"{run.folder}: the run could end early, at the confidence and with the weights"
                " that it stated before; leave out --weights and --confidence"
            )
        confidence, missing_as_lost = rule.confidence, True
    shares = _shares(run, weights)
    tasks, bound, method = _bound(run, rule, name, shares, confidence)
    if tasks.missing and not missing_as_lost:
        raise CertificateError(
            f"{run.folder}: {len(tasks.missing)} cases have no score, such as"
            f" {shorten_list(tasks.missing, 3)}; play them again, or count them as lost with"
            " --missing-as-lost, which can only lower the retention"
        )
    least = math.floor(bound * 10**DIGITS) / 10**DIGITS
    distribution = tuple(_disturbances(run, shares))
    identity = run_identity(run)
    return Certificate(
        statement=(
            f"{name}{_helpers(run, name)} keeps at least {100 * least:.2f} % of its clean success,"
            f" with {100 * confidence:g} % confidence, over"
            f" {shorten_list(list(shares), len(shares))} ({len(tasks.tasks)} tasks"
            f"{_left_out(run, tasks)})" + (f": {declared}" if declared else "")
        ),
        agent=name,
        retention_at_least=least,
        confidence=confidence,
        method=method,
        reason=REASONS[method],
        retention=round(tasks.estimate, 6),
        clean=round(float(tasks.clean.mean()), 6),
        corrupted=round(float(tasks.corrupted.mean()), 6),
        distribution=distribution,
        declaration=declared,
        conditions_left_out=tuple(label for label in _labels(run) if label not in shares),
        tasks=len(tasks.tasks),
        seeds=identity.seeds,
        episodes=tasks.episodes,
        missing=tasks.missing,
        missing_as_lost=missing_as_lost,
        until_retention=None if rule is None else rule.to_data(),
        run=identity.name,
        read_with=run.config.get(READ_WITH),
        head_sha256=identity.head_sha256,
        records_sha256=file_digest(run.folder / RECORDS) or "" if identity.head_sha256 else "",
        scores_sha256=_scores_digest(run, name, shares),
        versions=identity.versions,
    )


def read_certificate(path: Path) -> dict[str, Any]:
    """Return the data of a certificate.

    Raises:
        CertificateError: the file is not one, is of a newer version, or lacks a field.
    """
    data = read_versioned_json(
        path,
        format=FORMAT,
        version=VERSION,
        description="a certificate (hijack certify RUN -o certificate.json)",
        error=CertificateError,
    )
    names = ["format", "version", *(entry.name for entry in fields(Certificate))]
    odd = sorted(set(names) ^ set(data))
    if odd:
        raise CertificateError(f"{path}: field {odd[0]!r} is unknown or missing")
    return data


def read_certified_run(path: Path, sources: Sequence[Path]) -> Run:
    """Return the run that a certificate is about, read as it was when it was certified.

    Args:
        path: the certificate.
        sources: the folder of the run, or the results of another harness.

    Raises:
        CertificateError: the file is not a certificate, or is about one run of this library.
        HijackError: the run cannot be read.
    """
    read_with = read_certificate(path)["read_with"]
    if read_with is None:
        if len(sources) > 1:
            raise CertificateError(f"{path}: is about one run; give its folder alone with --run")
        return reading.read(sources[0])
    reader, columns, clean = _check_read_with(path, read_with)
    return collect_run(sources, reader=reader, columns=columns, clean=clean)


def _check_read_with(path: Path, data: Any) -> tuple[str | None, dict[str, str], str]:
    """Return reader, columns and clean condition of results of other harnesses.

    Raises:
        CertificateError: they have another form.
    """
    match data:
        case {"reader": None | str() as reader, "columns": {**columns}, "clean": str() as clean}:
            if len(data) == 3 and all(isinstance(name, str) for name in columns.values()):
                return reader, columns, clean
    raise CertificateError(
        f"{path}: read_with must hold reader, columns and clean, got {short_repr(data)}"
    )


def certificate_problems(path: Path, run: Run) -> list[str]:
    """Return how a certificate differs from the one that the records of its run give, by field.

    Args:
        path: the certificate.
        run: the run; its name may be another.

    Raises:
        CertificateError: the file is not a certificate.
    """
    data = read_certificate(path)
    try:
        weights = {
            str(entry["condition"]): float(entry["weight"]) for entry in data["distribution"]
        }
        early = data["until_retention"] is not None
        computed = certify(
            run,
            agent=str(data["agent"]),
            weights=None if early else weights,
            confidence=CONFIDENCE if early else float(data["confidence"]),
            missing_as_lost=data["missing_as_lost"] is True,
            declaration=str(data["declaration"]),
        ).to_data()
    except (TypeError, ValueError, KeyError) as error:
        return [f"{path}: cannot be computed from {run.folder}: {error}"]
    differing = [
        difference(data[key], computed[key], key)
        for key in computed
        if key != "run" and data[key] != computed[key]
    ]
    return [f"{path}: {text}" for text in differing]


def _check_complete(run: Run) -> None:
    """Check that everything that was to be played is there.

    Raises:
        CertificateError: something is missing or damaged.
    """
    if run.damaged:
        broken = run.damaged[0]
        raise CertificateError(
            f"{run.folder / broken.file}:{broken.line}: {broken.problem}; a damaged run is not"
            " certified"
        )
    if run.missing:
        raise CertificateError(
            f"{run.folder}: {run.missing} of {run.planned} planned episodes are missing; play them"
            " with --resume, since a run that ends when its results please proves nothing"
        )
    if not run.records:
        raise CertificateError(f"{run.folder}: holds no episodes")


def _check_declaration(run: Run, declaration: str) -> str:
    """Return the declaration of the disturbances, on one line.

    Raises:
        CertificateError: it is missing, or the run says itself what its conditions are.
    """
    text = " ".join(declaration.split())
    is_foreign = run.config.get("kind") == RESULTS
    if is_foreign and not text:
        raise CertificateError(
            f"{run.folder}: results of another harness do not say what their conditions did, and a"
            " certificate is about nothing else; declare it in words with --distribution, such as"
            ' "marks: 10 random lines a screenshot, drawn anew for each task"'
        )
    if text and not is_foreign:
        raise CertificateError(
            f"{run.folder}: is a run of this library, whose run.json says what its conditions are;"
            " leave out --distribution"
        )
    if is_foreign and not getattr(run.records, "paired", True):
        raise CertificateError(
            f"{run.folder}: a certificate compares the same tasks; leave out --unpaired"
        )
    if run.config.get("left_out_by_common_tasks") is not None:
        raise CertificateError(
            f"{run.folder}: a certificate counts every task; leave out --common-tasks"
        )
    return text


def _choose_agent(run: Run, agent: str) -> str:
    """Return the agent.

    Raises:
        CertificateError: none is named, and the run has several.
        UnknownNameError: the run has no such agent.
    """
    agents = list(dict.fromkeys([*agent_names(run.config), *(r["agent"] for r in run.records)]))
    if agent and agent not in agents:
        raise UnknownNameError(f"--agent: no agent {agent!r} in the run{suggest(agent, agents)}")
    if not agent and len(agents) > 1:
        raise CertificateError(
            f"{run.folder}: has several agents; say which: --agent {' or '.join(agents)}"
        )
    return agent or agents[0]


def _helpers(run: Run, agent: str) -> str:
    """Return what an agent had that others do not, as words after its name; "" for nothing.

    An agent with a guard, or with the plan of its task, keeps more than it does alone.
    """
    input_sets = collect_privileged_inputs(r for r in run.records if r["agent"] == agent)
    kinds = [kind for kind in GIVEN_KINDS if any(kind in inputs for inputs in input_sets)]
    words = [f"given {describe_privileged_inputs(kinds)}"] if kinds else []
    if run.config.get("guard"):
        words.append(f"watched by the guard {run.config['guard']}")
    return f" ({', '.join(words)})" if words else ""


def _left_out(run: Run, tasks: TaskRetention) -> str:
    """Return which tasks and rows count for nothing, as words after the number of tasks."""
    unplayable = run.config.get("unplayable")
    parts: list[str] = []
    if unplayable and run.config.get("unplayable_score") is None:
        parts.append(f", without {len(unplayable)} that could not be played")
    if tasks.unshared:
        parts.append(f", without {quantity(tasks.unshared, 'row')} that not every condition has")
    return "".join(parts)


def _labels(run: Run) -> list[str]:
    """Return the conditions of a run other than the clean one."""
    listed = [label for label, _, _ in corruption_entries(run.config)]
    labels = dict.fromkeys([*listed, *(record["corruption"] for record in run.records)])
    return [label for label in labels if label != CLEAN]


def _shares(run: Run, weights: Mapping[str, float] | None) -> dict[str, float]:
    """Return the share of each condition in the distribution; they add up to 1.

    Raises:
        CertificateError: the run has no corruption.
        UnknownNameError: the run has no such condition.
        ParameterError: a weight is not a number above 0.
    """
    labels = _labels(run)
    if not labels:
        raise CertificateError(f"{run.folder}: has only the clean condition; nothing can be lost")
    if weights is None:
        return {label: round(1 / len(labels), WEIGHT_DIGITS) for label in labels}
    for label, weight in weights.items():
        if label not in labels:
            raise UnknownNameError(f"--weights: no condition {label!r}{suggest(label, labels)}")
        if not 0 < weight < math.inf:
            raise ParameterError(f"--weights: {label} must be above 0, got {weight!r}")
    if not weights:
        raise ParameterError("--weights: name a condition, such as marks=1")
    total = math.fsum(weights.values())
    if abs(total - 1) < len(weights) * 10**-WEIGHT_DIGITS:  # of a certificate: rounded already
        total = 1.0
    shares = {
        label: round(weights[label] / total, WEIGHT_DIGITS) for label in labels if label in weights
    }
    if not all(shares.values()):
        raise ParameterError(
            f"--weights: a share below 1e-{WEIGHT_DIGITS} is none; leave out its condition"
        )
    return shares


def _bound(
    run: Run, rule: StopRule | None, agent: str, shares: Mapping[str, float], confidence: float
) -> tuple[TaskRetention, float, str]:
    """Return the tasks' scores, the bound and the method.

    Raises:
        CertificateError: no task is solved clean.
    """
    try:
        if rule is not None:
            bets, episodes, missing = settle_bets(run.config, run.episodes, run.records)
            tasks = TaskRetention(
                tasks=tuple(str(number) for number in range(len(bets.clean))),
                clean=bets.clean,
                corrupted=bets.corrupted,
                episodes=episodes,
                missing=missing,
                repeats=True,
            )
            return tasks, bets.bound(confidence), BETTING
        tasks = score_tasks(counted_records(run), agent, shares)
        if tasks.is_binary and tasks.clean.any():
            successes = int(tasks.corrupted[tasks.clean == 1].sum())
            trials = int(tasks.clean.sum())
            return tasks, clopper_pearson_lower(successes, trials, confidence), CLOPPER_PEARSON
        return tasks, gaffke_retention_bound(tasks.clean, tasks.corrupted, confidence), GAFFKE
    except ParameterError as error:
        raise CertificateError(f"{run.folder}: {error}") from None


def _disturbances(run: Run, shares: Mapping[str, float]) -> Iterator[Disturbance]:
    entries = {label: (name, values) for label, name, values in corruption_entries(run.config)}
    for label, weight in shares.items():
        name, values = entries.get(label, (label, {}))
        # Another harness may have a name of ours. The parameters of a log or a dataset may be
        # unknown: then the label alone is there, or nothing.
        is_known = run.config.get("kind") != RESULTS and label in entries
        is_known = is_known and not (run.is_scored and label in run.config["corruptions"])
        try:
            find_corruption(name)
        except HijackError:
            is_known = False
        yield Disturbance(
            condition=label,
            corruption=name if is_known else None,
            severity=severity_level(name, values) if is_known else None,
            parameters=values,
            weight=weight,
        )


def _scores_digest(run: Run, agent: str, shares: Mapping[str, float]) -> str:
    """Return the SHA-256 of the scores of an agent under clean and the distribution."""
    lines = sorted(
        json.dumps([r["task"], r.get("task_seed"), r["corruption"], r["seed"], r.get("score")])
        for r in run.last_attempts
        if r["agent"] == agent and r["corruption"] in (CLEAN, *shares)
    )
    return sha256_hex("\n".join(lines).encode())
