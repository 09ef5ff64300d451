"""Ask an agent about the rows of a dataset, and turn its answers into records.

The agent gets nothing but pictures and, for steps, the instruction. Each row is an episode of its
own: `reset()` comes before it, and an agent without `reset` is made again.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

from hijack_data.errors import HijackError, ParameterError
from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import GIVEN, ROW, VERSION
from hijack_data.types import AIMING, Action, Box, Size, check_aim

from ..agents.agent_calls import AgentAnswer, AgentError, RunningAgent
from ..agents.guarded import Guarded, Onlooker
from ..agents.guards import make_onlooker
from ..choices import Question
from ..errors import AgentSetupError
from ..results.reading import ResultRecord
from .answers import StepAnswer, read_answer
from .cases import Case
from .dataset_rows import DamagedRowError, RowData, RowFeed, picture_scale
from .onlookers import is_reminder, overlap
from .outlines import Outline, target_outline
from .rules import Distance, ExpectedStep, compare, unanswered

MAX_TEXT_CHARS = 2000  # characters of a text in a record
Scored: TypeAlias = dict[str, Any]
MAX_STARTS = 3  # times in a row that an agent which was made may fail to be made again


@dataclass(frozen=True, kw_only=True)
class AskSettings:
    """The settings by which an agent is asked about rows.

    Args:
        agent: its name.
        question: what it is asked.
        near: how far a click may be off where no box is known.
        batch: rows that `predict_batch` is given at a time.
        in_process: whether a user's agent runs in this process, for debugging.
        guard: what watches the agent; "" for nothing.
        privileged_inputs: what the agent is given beside instruction and pictures, for the records.
    """

    agent: str
    question: Question
    near: Distance
    batch: int = 8
    in_process: bool = False
    guard: str = ""
    privileged_inputs: tuple[str, ...] = ()


class RowAsker:
    """Asks one agent about rows.

    Args:
        settings: how the rows are put.
        feed: the rows.
        start: returns a running agent, also to replace one that died.

    Raises:
        AgentSetupError: the agent cannot be made.
    """

    def __init__(
        self, settings: AskSettings, feed: RowFeed, start: Callable[[], RunningAgent]
    ) -> None:
        self._settings = settings
        self._feed = feed
        self._start = start
        self._failed_starts = MAX_STARTS - 1  # the first failure is final
        self._agent = self._start_agent()
        self._is_used = False
        self._onlooker = make_onlooker(settings.guard, settings.agent) if settings.guard else None
        self._guard_record: dict[str, Any] | None = None

    @property
    def batch(self) -> int:
        """How many rows the agent takes at a time."""
        batched = "predict_batch" in self._agent.traits.methods and self._onlooker is None
        return self._settings.batch if batched and self._settings.question == "steps" else 1

    def close(self) -> None:
        """End the agent."""
        self._agent.close()

    def ask_row(self, case: Case) -> ResultRecord:
        """Put one row to the agent."""
        row = self._row(case)
        if isinstance(row, DamagedRowError):
            return self._damaged_record(case, row)
        self._restart_if_dead()
        start = time.perf_counter()
        try:
            self._reset_agent()
            answer = self._answer(row)
        except AgentError as error:
            return self._failed_record(case, row, error, time.perf_counter() - start)
        return self._judge(case, row, answer, time.perf_counter() - start)

    def ask_rows(self, cases: Sequence[Case]) -> list[ResultRecord]:
        """Put rows to `predict_batch`.

        Raises:
            AgentError: it raises, or does not return an answer for each row.
        """
        rows = [self._row(case) for case in cases]
        readable = [row for row in rows if not isinstance(row, DamagedRowError)]
        self._restart_if_dead()
        start = time.perf_counter()
        answers = iter(self._batch(readable) if readable else [])
        seconds = (time.perf_counter() - start) / max(1, len(readable))
        records: list[ResultRecord] = []
        for case, row in zip(cases, rows, strict=True):
            if isinstance(row, DamagedRowError):
                records.append(self._damaged_record(case, row))
                continue
            records.append(self._judge(case, row, next(answers), seconds))
        return records

    def _row(self, case: Case) -> RowData | DamagedRowError:
        """Return a row, with what it asks for under `wanted` if steps are scored."""
        try:
            row = self._feed.row(case.number)
        except DamagedRowError as error:
            return error
        if self._settings.question != "steps":
            return row
        try:
            return {**row, "wanted": expected_step(row)}
        except HijackError as error:
            remedy = "mend the recording and build the dataset again"
            return DamagedRowError(f"{self._feed.folder}: row {case.row!r}: {error}; {remedy}")

    def _start_agent(self) -> RunningAgent:
        while True:
            try:
                agent = self._start()
            except AgentError as error:
                self._failed_starts += 1
                if self._failed_starts >= MAX_STARTS:
                    details = "\n".join([str(error), *error.frames[-1:]])
                    name = self._settings.agent
                    raise AgentSetupError(f"{name}: cannot be made: {details}") from error
            else:
                self._failed_starts = 0
                return agent

    def _restart_if_dead(self) -> None:
        """Start the agent again if it died, or hangs."""
        if not self._agent.alive:
            self._agent.close()
            self._agent = self._start_agent()
            self._is_used = False

    def _reset_agent(self) -> None:
        """Let the agent forget the last row."""
        if "reset" in self._agent.traits.methods:
            self._agent.reset()
        elif self._is_used:
            self._agent.make()
        self._is_used = True

    def _answer(self, row: RowData) -> Any:
        if self._settings.question == "reminders":
            return self._agent.check(row["screenshot"])
        if self._settings.question == "summaries":
            return self._agent.summarise(row["before"], row["action_text"], row["after"])
        obs = {"screenshot": row["screenshot"]}
        if self._onlooker is None:
            return self._agent.predict(row["instruction"], obs)
        return self._ask_guarded(self._onlooker, row["instruction"], obs)

    def _ask_guarded(self, onlooker: Onlooker, instruction: str, obs: dict[str, Any]) -> Any:
        """Return the answer of the guard to a first screen, or that of the agent.

        Raises:
            AgentError: The agent or its guard fails.
        """
        self._guard_record = None
        onlooker.reset()
        guarded = Guarded(self._agent, onlooker)
        try:
            answer = guarded.predict(instruction, obs)
        except AgentError:
            raise
        except Exception as error:
            raise AgentError(f"{type(error).__name__} in its guard: {error}") from error
        self._guard_record = guarded.guard_record
        return answer

    def _batch(self, rows: Sequence[RowData]) -> list[AgentAnswer]:
        self._reset_agent()
        instructions = [row["instruction"] for row in rows]
        return self._agent.predict_batch(instructions, [row["screenshot"] for row in rows])

    def _judge(self, case: Case, row: RowData, answer: Any, seconds: float) -> ResultRecord:
        if self._settings.question == "reminders":
            scored = _reminder(case.needed, answer)
        elif self._settings.question == "summaries":
            scored = _summary(row, answer)
        else:
            words, actions = answer
            size = row["screenshot"].shape[:2]
            scored = _step(row["wanted"], read_answer(words, actions, size), self._settings.near)
        guard = {} if self._guard_record is None else {"guard": self._guard_record}
        return self._record(case, row, seconds) | scored | guard

    def _failed_record(
        self, case: Case, row: RowData, error: AgentError, seconds: float
    ) -> ResultRecord:
        failed = failure(f"the agent: {error}", error.frames)
        return self._record(case, row, seconds) | failed

    def _damaged_record(self, case: Case, error: DamagedRowError) -> ResultRecord:
        record = empty_record(case, self._settings)
        return record | {
            "status": "invalid",
            "problem": str(error)[:MAX_TEXT_CHARS],
            "cause": "machine",
        }

    def _record(self, case: Case, row: RowData, seconds: float) -> ResultRecord:
        about = {
            "instruction": row["instruction"],
            "fidelity": row["fidelity"],
            "image_sha256": row.get("image_sha256"),
            "target_visible": row.get("target_visible"),
            "seconds": round(seconds, 4),
        }
        return empty_record(case, self._settings) | about


def empty_record(case: Case, settings: AskSettings) -> ResultRecord:
    """Return the record of a case before anything is known of the answer."""
    about = {"needed": case.needed} if settings.question == "reminders" else {}
    return {
        **about,
        "version": VERSION,
        "id": case.id(settings.agent),
        "agent": settings.agent,
        "task": case.task,
        "task_seed": case.variant,
        "corruption": case.corruption,
        "seed": case.seed,
        "attempt": 0,
        ROW: case.row,
        "question": settings.question,
        "status": "ok",
        "score": None,
        "reason": "",
        "problem": "",
        "steps": 1,
        "seconds": 0.0,
        "malformed": 0,
        GIVEN: list(settings.privileged_inputs),  # rows have no task and no plan
    }


def failure(problem: str, frames: Sequence[str] = ()) -> Scored:
    """Return the fields of a record whose agent failed."""
    return {
        "status": "error",
        "problem": problem[:MAX_TEXT_CHARS],
        "cause": "agent",
        "traceback": list(frames),
    }


def expected_step(row: RowData) -> ExpectedStep:
    """Return what a row asks for.

    Raises:
        ParameterError: its action lies outside its own target, its outline is none, or no point of
            the picture is in its target.
    """
    recorded: dict[str, Any] = row["action"]
    keys = recorded["keys"]
    action = Action(**{**recorded, "keys": tuple(keys) if keys else None})
    scale = (1.0, 1.0) if row["corruption"] == CLEAN else picture_scale(row)
    box = _box(row["target_box"])
    polygon = target_outline(row["extra"], scale)
    if not polygon:
        check_aim(action, box)
    size = row["height"], row["width"]
    _check_target(action, box, polygon, size)
    return ExpectedStep(
        action=action,
        size=size,
        box=box,
        polygon=polygon,
        scale=scale,
        helpless=row["reminder"] is not None,
    )


def _check_target(action: Action, box: Box | None, polygon: Outline, size: Size) -> None:
    """Check that an answer can hit what a row aims at.

    Raises:
        ParameterError: no point of the picture is in it.
    """
    if action.type not in AIMING or (box is None and not polygon):
        return
    height, width = size
    if polygon:
        has_area = not _on_one_line(polygon)
        xs, ys = zip(*polygon, strict=True)
        bounds = min(xs), min(ys), max(xs), max(ys)
    else:
        bounds = cast("Box", box)
        has_area = bounds[0] < bounds[2] and bounds[1] < bounds[3]
    overlaps = bounds[0] < width and bounds[1] < height and bounds[2] > 0 and bounds[3] > 0
    if not has_area or not overlaps:
        raise ParameterError(
            f"no point of the picture of {width}x{height} pixels is in the target {bounds} (x1, y1,"
            " x2, y2), so every answer would be wrong"
        )


def _on_one_line(polygon: Outline) -> bool:
    first, *others = dict.fromkeys(polygon)
    if not others:
        return True
    dx, dy = others[0][0] - first[0], others[0][1] - first[1]
    return all(dx * (y - first[1]) == dy * (x - first[0]) for x, y in others)


def _box(value: Sequence[int] | None) -> Box | None:
    return cast("Box", tuple(value)) if value else None


def _step(expected: ExpectedStep, answer: StepAnswer, near: Distance) -> Scored:
    if answer.action is None:
        verdict = unanswered(expected, answer.problem)
    else:
        verdict = compare(expected, answer.action, near)
    return {
        "score": float(verdict.right),
        "reason": verdict.reason[:MAX_TEXT_CHARS],
        "wanted": expected.action.type,
        "parts": verdict.parts,
        "off": verdict.off,
        "malformed": int(answer.action is None),
        "last_action": answer.text[:MAX_TEXT_CHARS],
        "said": answer.words[:MAX_TEXT_CHARS],
        "more": answer.further_actions,
    }


def _reminder(needed: bool, answer: str | None) -> Scored:
    has_reminder = is_reminder(answer)
    reason = ""
    if has_reminder != needed:
        reason = (
            "a reminder that was not needed" if has_reminder else "no reminder, and one was needed"
        )
    return {
        "score": float(has_reminder == needed),
        "reason": reason,
        "given": has_reminder,
        "said": (answer or "")[:MAX_TEXT_CHARS],
    }


def _summary(row: RowData, answer: str) -> Scored:
    return {
        "score": round(overlap(answer, row["summary"]), 4),
        "wanted": row["summary"][:MAX_TEXT_CHARS],
        "said": answer[:MAX_TEXT_CHARS],
    }
