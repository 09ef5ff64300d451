"""Jobs of Harbor: `JOB/TRIAL/result.json`, with the rewards of the verifier (Harbor 0.26)."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import shorten_list, suggest

from ..outcomes import EpisodeOutcome, OutcomeError
from .atif import is_atif, read_trajectory, trajectory_amounts
from .result_folders import (
    check_score,
    field,
    find_condition,
    has_keys,
    head,
    read_object,
    sum_amounts,
)

RESULT = "result.json"
CONFIG = "config.json"
_TRAJECTORY = ("agent", "trajectory.json")  # below the folder of a trial
_VERSIONS = (None, 1)  # of the document; files without one are of the first
_MAX_DEPTH = 3  # of a trial below the source: jobs/JOB/TRIAL
# Errors after which Harbor takes a reward as valid; newer files say so themselves (reward_valid).
_VALID_ERRORS = frozenset(
    {
        "NonZeroAgentExitCodeError",
        "AgentTimeoutError",
        "ContextWindowExceededError",
        "OutputTokenExceededError",
        "ContextLengthExceededError",
        "OutputLengthExceededError",
        "AgentSafetyRefusalError",
        "ContentPolicyViolationError",
    }
)
_NONE = type(None)


class HarborReader:
    """Reads the trials of a job, or of a folder of jobs.

    An agent is Harbor's agent with its model. A trial without a valid reward has no outcome. The
    condition is a folder named after a corruption, or `--columns condition=N`; `score=KEY` chooses
    one of several rewards. Steps are those of the agent's trajectory, if it wrote one.
    """

    fields = ("condition", "score")

    def detect(self, source: Path) -> bool:
        """Return whether a folder holds the result of a trial."""
        return source.is_dir() and next(_trials(source), None) is not None

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcome of each trial, in the order of their folders.

        Args:
            source: the folder of a job, of several, or of a trial.
            columns: the number of a folder for `condition`, the key of a reward for `score`.

        Raises:
            OutcomeError: a result has another form.
        """
        _check_ended(source)
        for path in sorted(_trials(source)):
            yield _outcome(source, path, columns)


def _trials(source: Path) -> Iterator[Path]:
    """Yield the results of trials; those of jobs have other fields."""
    for depth in range(_MAX_DEPTH):
        for path in source.glob("*/" * depth + RESULT):
            if has_keys(path, "task_name", "trial_name"):
                yield path


def _check_ended(source: Path) -> None:
    """Check that every trial has a result.

    Raises:
        OutcomeError: one has none; what it says of its agent and task has another form.
    """
    for depth in range(_MAX_DEPTH):
        for path in sorted(source.glob("*/" * depth + CONFIG)):
            if not (path.parent / RESULT).exists() and b'"trial_name"' in head(path):
                raise OutcomeError(
                    f"{path.parent}: is a trial without {RESULT}, which did not end; let Harbor"
                    " finish the job, or remove the folder"
                )


def _outcome(source: Path, path: Path, columns: Mapping[str, str]) -> EpisodeOutcome:
    result = read_object(path, "a result of Harbor")
    if result.get("schema_version") not in _VERSIONS:
        raise OutcomeError(
            f"{path}: schema_version {result['schema_version']!r} is not known; this reader knows 1"
        )
    if result.get("source") == "cua-bench":
        raise OutcomeError(f"{path}: is of a run of cua-bench; give its folder, --from cua_bench")
    agent = field(result, path, "agent_info", "name", kind=str)
    version = field(result, path, "agent_info", "version", kind=str)
    if field(result, path, "agent_info", "model_info", kind=(dict, _NONE)) is not None:
        agent += f" ({field(result, path, 'agent_info', 'model_info', 'name', kind=str)})"
    score, problem = _score(result, path, columns.get("score"))
    trajectory = path.parent.joinpath(*_TRAJECTORY)
    amounts: dict[str, float | None] = {}
    if is_atif(trajectory):
        amounts = trajectory_amounts(read_trajectory(trajectory), trajectory)
    used = result.get("agent_result")
    tokens = sum_amounts(used, path, "n_input_tokens", "n_output_tokens")
    cost = sum_amounts(used, path, "cost_usd")
    return EpisodeOutcome(
        agent=agent,
        task=field(result, path, "task_name", kind=str),
        condition=find_condition(source, path.parent, columns),
        score=score,
        problem=problem,
        version=f"{agent} {version}",
        content=field(result, path, "task_checksum", kind=str),
        steps=amounts.get("steps"),
        tokens=amounts.get("tokens") if tokens is None else tokens,
        cost=amounts.get("cost") if cost is None else cost,
    )


def _score(result: Mapping[str, Any], path: Path, key: str | None) -> tuple[float | None, str]:
    """Return the score of a trial, or `None` and why it has none.

    Raises:
        OutcomeError: there are several rewards, or one is no number in 0..1.
    """
    error = ""
    if field(result, path, "exception_info", kind=(dict, _NONE)) is not None:
        error = field(result, path, "exception_info", "exception_type", kind=str)
    verifier = field(result, path, "verifier_result", kind=(dict, _NONE))
    rewards = verifier and field(result, path, "verifier_result", "rewards", kind=(dict, _NONE))
    if not rewards:
        return None, f"has no reward ({error})" if error else "has no reward"
    is_valid = field(result, path, "reward_valid", kind=bool) if "reward_valid" in result else None
    if is_valid is False or (is_valid is None and error and error not in _VALID_ERRORS):
        return None, f"its reward is not valid ({error or 'a step failed'})"
    if key is None and len(rewards) > 1:
        raise OutcomeError(
            f"{path}: has several rewards ({shorten_list(list(rewards), 5)}); choose one with"
            " --columns score=KEY"
        )
    if key is not None and key not in rewards:
        raise OutcomeError(f"{path}: has no reward {key!r}{suggest(key, list(rewards))}")
    name = key or next(iter(rewards))
    return check_score(rewards[name], path, f"the reward {name!r}"), ""
