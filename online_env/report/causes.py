"""Why disturbed episodes were lost: rules over the records and steps of a run.

An episode is lost if the same case (agent, task, seed) scored more in the clean condition. It is
disturbed if the agent acted on a picture that was changed, or after an effect or a fault of its
input that a probe proved. Only episodes that are both are explained, by the first rule of `RULES`
that applies; one that no rule explains is `unexplained`. Two actions are the same if their points
differ by at most `SAME_POINT_PX`.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, cast

from hijack_data import actions
from hijack_data.corruption import CORRUPTIONS
from hijack_data.errors import HijackError
from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import EPISODES, STEPS
from hijack_data.types import Action, Point, in_box

from ..results import scores
from ..results.intervals import TOLERANCE
from ..results.reading import ResultRecord, Run
from .app_success import record_app
from .identity import corruptions_by_label
from .model import DisturbedCount, LossCause

SAME_POINT_PX = 8  # half of the square by which a point is judged as a target
MALFORMED_SHARE = 0.5  # of the actions after the disturbance
UNEXPLAINED = "unexplained"
Line: TypeAlias = Mapping[str, Any]
# How an episode was lost: whether the rule applies, and the step where it turned if that is known.
RuleOutcome: TypeAlias = tuple[bool, int | None]
NO: RuleOutcome = (False, None)


class _StepsMissingError(HijackError, LookupError):
    """The steps of an episode are needed, and are not there."""


class CauseRule(NamedTuple):
    """A cause of lost episodes.

    Attributes:
        cause: its name.
        meaning: when it applies.
        fields: what it reads of record and steps.
        test: returns whether it applies, and the step where the episode turned.
    """

    cause: str
    meaning: str
    fields: str
    test: Callable[["_LostCase"], RuleOutcome]


@dataclass(frozen=True)
class _Episode:
    """The record of an episode with its steps.

    Attributes:
        record: of `records.jsonl`.
        folder: of the run.
    """

    record: ResultRecord
    folder: Path

    @cached_property
    def lines(self) -> tuple[Line, ...] | None:
        """The observations on which the agent acted; `None` if they cannot be read."""
        path = self.folder / EPISODES / str(self.record.get("id")) / STEPS
        try:
            with path.open(encoding="utf-8") as file:
                lines = [json.loads(line) for line in file]
        except (OSError, ValueError, RecursionError):
            return None
        if not all(isinstance(line, dict) and isinstance(line.get("step"), int) for line in lines):
            return None
        return tuple(line for line in lines if isinstance(line.get("raw"), str))

    @property
    def effects(self) -> Iterator[tuple[int, Mapping[str, Any]]]:
        """The effects that a probe proved, each with the observation that shows it first."""
        for entry in _objects(self.record.get("effects")):
            probes = _objects(_mapping(entry.get("record")).get("probes"))
            if isinstance(entry.get("step"), int) and any(p.get("ok") is True for p in probes):
                yield max(0, entry["step"]), entry

    @property
    def faults(self) -> Iterator[int]:
        """The observations that show first what a proved fault of the agent's input led to."""
        for entry in _objects(self.record.get("inputs")):
            step = entry.get("step")
            if isinstance(step, int) and _mapping(entry.get("probe")).get("ok") is True:
                yield step + 1

    @property
    def actions(self) -> int:
        """How many actions the agent took."""
        return _count(self.record.get("steps")) + _count(self.recovery.get("free"))

    @property
    def recovery(self) -> Mapping[str, Any]:
        """The requests for re-initialisation."""
        return _mapping(self.record.get("recovery"))

    @property
    def last_step(self) -> int | None:
        """The step of the last action."""
        return self.actions - 1 if self.actions else None

    @property
    def words(self) -> list[str]:
        """The actions as they ran; those that could not be read as they were written."""
        return [str(line.get("code") or line["raw"]) for line in self.lines or ()]

    def first_disturbed(self, can_draw: bool) -> int | None:
        """Return the first step at which the agent acted on something disturbed.

        Args:
            can_draw: whether the corruption may change pictures, which only steps tell.

        Returns:
            `None` if there is none.

        Raises:
            _StepsMissingError: it is not known, for want of the steps.
        """
        acting = [*(step for step, _ in self.effects), *self.faults]
        steps = [step for step in acting if step < max(1, self.actions)]
        if self.lines is not None:
            steps += [
                line["step"]
                for line in self.lines
                if line.get("seen_sha256") != line.get("image_sha256")
            ]
        elif can_draw and 0 not in steps:
            raise _StepsMissingError(
                f"{self.folder}: the steps of {self.record.get('id')} are missing"
            )
        return min(steps, default=None)


@dataclass(frozen=True, kw_only=True)
class _LostCase:
    """A lost episode.

    Attributes:
        episode: of the corrupted condition.
        clean: of the same case.
        start: the first step that was disturbed.
    """

    episode: _Episode
    clean: _Episode
    start: int

    @property
    def late(self) -> Sequence[Line]:
        """The observations from the disturbance on."""
        return [line for line in self.episode.lines or () if line["step"] >= self.start]

    @cached_property
    def requests(self) -> list[tuple[int, bool]]:
        """The steps of requests for re-initialisation, and whether each helped."""
        return [
            (line["step"], line["result"].get("helped") is True)
            for line in self.episode.lines or ()
            if isinstance(line.get("result"), dict) and "helped" in line["result"]
        ]

    @property
    def ended_early(self) -> bool:
        """Whether the agent ended with fewer actions than it needed clean."""
        is_ended = self.episode.record.get("ended") == "agent"
        return is_ended and self.episode.actions < self.clean.actions


def _failed(case: _LostCase) -> RuleOutcome:
    return case.episode.record["status"] == "error", case.episode.last_step


def _malformed(case: _LostCase) -> RuleOutcome:
    if case.episode.lines is None:
        count = _count(case.episode.record.get("malformed"))
        return count > 0 and count >= case.episode.actions, case.start
    wrong = [line["step"] for line in case.late if line.get("error") is not None]
    clean_share = _count(case.clean.record.get("malformed")) / max(1, case.clean.actions)
    share = len(wrong) / max(1, len(case.late))
    if not wrong or share < MALFORMED_SHARE or share <= clean_share:
        return NO
    return True, wrong[0]


def _wrong_recovery(case: _LostCase) -> RuleOutcome:
    recovery = case.episode.recovery
    if recovery.get("policy") == "reset" and recovery.get("false_alarms"):
        return True, next((step for step, helped in case.requests if not helped), None)
    clean_points = [_point(word) for word in case.clean.words]
    if case.clean.lines is None:
        return NO
    for line in case.late:
        point = _point(str(line.get("code") or ""))
        if point is None or not any(in_box(box, point) for box in _windows(line)):
            continue
        if not any(clean is not None and _are_near(point, clean) for clean in clean_points):
            return True, line["step"]
    return NO


def _recovered_late(case: _LostCase) -> RuleOutcome:
    helped = [step for step, is_helped in case.requests if is_helped]
    if helped:
        is_late = helped[0] > case.start or case.episode.record.get("ended") == "max_steps"
        return is_late, helped[0]
    lasting = [entry["held_at_end"] for _, entry in case.episode.effects if "held_at_end" in entry]
    is_gone = bool(lasting) and not any(lasting)
    return is_gone or bool(case.episode.recovery.get("repaired")), None


def _never_saw(case: _LostCase) -> RuleOutcome:
    if case.episode.lines is None or case.clean.lines is None:
        return NO
    words, clean_words = case.episode.words, case.clean.words
    is_same = len(words) == len(clean_words) and all(map(_are_same, words, clean_words))
    return is_same, case.start


def _stopped_early(case: _LostCase) -> RuleOutcome:
    return case.ended_early, case.episode.last_step


def _went_on(case: _LostCase) -> RuleOutcome:
    recovery = case.episode.recovery
    if _count(recovery.get("requests")) > _count(recovery.get("false_alarms")):
        return True, next((step for step, _ in case.requests if step >= case.start), None)
    words, clean_words = case.episode.words, case.clean.words
    start = case.start
    if not 0 < start < min(len(words), len(clean_words)):
        return NO
    was_same = all(map(_are_same, words[:start], clean_words[:start]))
    return was_same and not _are_same(words[start], clean_words[start]), start


def _out_of_steps(case: _LostCase) -> RuleOutcome:
    is_out = case.episode.record.get("ended") == "max_steps"
    return is_out and case.clean.record.get("ended") == "agent", case.episode.last_step


RULES = (
    CauseRule(
        "failed",
        "the agent raised, or its actions made the effect or the judge fail",
        "status, steps",
        _failed,
    ),
    CauseRule(
        "malformed",
        "half of the actions from the disturbance on, or more, could not be read, and a greater"
        " share than clean",
        "error of steps; malformed, steps",
        _malformed,
    ),
    CauseRule(
        "wrong recovery",
        "it had the desktop reset while nothing was disturbed, or pointed into a pop-up where it"
        " never points clean",
        "recovery; plan, code of steps, clean and corrupted",
        _wrong_recovery,
    ),
    CauseRule(
        "recovered too late",
        "a request for re-initialisation helped, but not as the first action, or the steps ran out;"
        " or the agent left no effect in place",
        "recovery, effects.held_at_end, ended; result of steps",
        _recovered_late,
    ),
    CauseRule(
        "never saw it",
        "its actions are those of its clean episode",
        "raw, code of steps, clean and corrupted",
        _never_saw,
    ),
    CauseRule(
        "stopped early",
        "it ended with fewer actions than clean",
        "ended, steps, recovery.free, clean and corrupted",
        _stopped_early,
    ),
    CauseRule(
        "saw it and went on",
        "it asked for re-initialisation in vain; or its actions were those of its clean episode"
        " until the disturbance, and not at it",
        "recovery; raw, code of steps, clean and corrupted",
        _went_on,
    ),
    CauseRule(
        "out of steps",
        "the limit of steps ended it, and not the clean episode",
        "ended, clean and corrupted",
        _out_of_steps,
    ),
)
CAUSES = (*(rule.cause for rule in RULES), UNEXPLAINED)


@dataclass(frozen=True, kw_only=True)
class LostEpisode:
    """A disturbed episode that was lost.

    Attributes:
        record: of `records.jsonl`.
        cause: one of `CAUSES`.
        turn: the step where it turned, if that is known.
    """

    record: ResultRecord
    cause: str
    turn: int | None


def loss_causes(
    run: Run, groups: scores.GroupedRecords
) -> tuple[list[DisturbedCount], list[LossCause]]:
    """Return how many episodes were disturbed and lost, and the causes of those that were both.

    Args:
        run: a run of `hijack bench`, or the episodes logged by an environment.
        groups: its records.

    Returns:
        A row for each agent that played corrupted episodes, and a row for each agent, condition,
        application and cause. None of a run whose records have no effects: of `hijack score`, or of
        another harness.
    """
    counts, episodes = find_lost(run, groups)
    turns: dict[tuple[str, str, str, str], list[int | None]] = {}
    for lost in episodes:
        record = lost.record
        key = record["agent"], record["corruption"], record_app(record), lost.cause
        turns.setdefault(key, []).append(lost.turn)
    rows = [
        LossCause(
            agent=agent,
            corruption=label,
            app=app,
            cause=cause,
            n=len(steps),
            turns=tuple(sorted(step for step in steps if step is not None)),
        )
        for (agent, label, app, cause), steps in turns.items()
    ]
    return counts, rows


def find_lost(
    run: Run, groups: scores.GroupedRecords
) -> tuple[list[DisturbedCount], list[LostEpisode]]:
    """Return the counts of `loss_causes`, and each episode that was disturbed and lost."""
    if not run.is_live:
        return [], []
    names = corruptions_by_label(run.config)
    counts: dict[str, dict[str, int]] = {}
    episodes: list[LostEpisode] = []
    for (agent, label), cell in groups.scored.items():
        if label == CLEAN:
            continue
        count = counts.setdefault(agent, dict.fromkeys(("n", "disturbed", "unknown", "lost"), 0))
        can_draw = _can_draw(names.get(label, label))
        clean_scores = groups.scored.get((agent, CLEAN), {})
        for case, score in cell.items():
            record = groups.last[agent, label][case]
            if record.get("unplayable"):
                continue
            count["n"] += 1
            episode = _Episode(record, run.folder)
            try:
                start = episode.first_disturbed(can_draw)
            except _StepsMissingError:
                count["unknown"] += 1
                continue
            if start is None:
                continue
            count["disturbed"] += 1
            if case not in clean_scores or clean_scores[case] <= score + TOLERANCE:
                continue
            count["lost"] += 1
            clean = _Episode(groups.last[agent, CLEAN][case], run.folder)
            cause, step = _explain(_LostCase(episode=episode, clean=clean, start=start))
            episodes.append(LostEpisode(record=record, cause=cause, turn=step))
    return [DisturbedCount(agent=agent, **count) for agent, count in counts.items()], episodes


def _explain(case: _LostCase) -> tuple[str, int | None]:
    """Return the cause of a loss, and the step where the episode turned."""
    for rule in RULES:
        applies, step = rule.test(case)
        if applies:
            return rule.cause, step
    return UNEXPLAINED, None


def _can_draw(name: str) -> bool:
    """Return whether a corruption may change pictures; one that is not known here may."""
    if name not in CORRUPTIONS:
        return True
    cls = CORRUPTIONS[name]
    return not cls.effects and not cls.inputs


def _are_same(first: str, second: str) -> bool:
    """Return whether two actions are the same but for a few pixels."""
    if first == second:
        return True
    actions = _parse(first), _parse(second)
    if actions[0] is None or actions[1] is None or "other" in (actions[0].type, actions[1].type):
        return False
    before, after = actions[0], actions[1]
    if _without_points(before) != _without_points(after):
        return False
    pairs = ((before.point, after.point), (before.end, after.end))
    return all(
        first_value == second_value
        or (
            first_value is not None
            and second_value is not None
            and _are_near(first_value, second_value)
        )
        for first_value, second_value in pairs
    )


def _without_points(action: Action) -> tuple[object, ...]:
    return action.type, action.text, action.keys, action.amount


def _are_near(first: Point, second: Point) -> bool:
    return all(abs(a - b) <= SAME_POINT_PX for a, b in zip(first, second, strict=True))


def _parse(code: str) -> Action | None:
    try:
        return actions.parse_pyautogui(code, None)
    except (HijackError, RecursionError):
        return None


def _point(code: str) -> Point | None:
    action = _parse(code) if code else None
    return None if action is None else action.point


def _windows(line: Line) -> list[tuple[int, int, int, int]]:
    """Return the boxes of the pop-ups in an observation, in pixels of the screen."""
    operations = _objects(_mapping(line.get("plan")).get("ops"))
    if any(operation.get("op") != "paste" for operation in operations):
        return []  # the places are of a picture of another size
    try:
        return [
            (x, y, x + operation["sprite"]["size"][0], y + operation["sprite"]["size"][1])
            for operation in operations
            if operation["sprite"].get("draw") == "window"
            for x, y in operation["at"]
        ]
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        return []  # a damaged line, which `hijack verify` names


def _mapping(value: object) -> Mapping[str, Any]:
    return cast("Mapping[str, Any]", value) if isinstance(value, dict) else {}


def _count(value: object) -> int:
    return int(value) if isinstance(value, int | float) else 0


def _objects(value: object) -> list[Mapping[str, Any]]:
    entries = cast("list[Any]", value) if isinstance(value, list) else []
    return [entry for entry in entries if isinstance(entry, dict)]
