"""One episode: the order of events.

An agent's action is mapped back through the coordinates, checked, and run in the guest. Then
`Observer` takes the next observation, until the agent or a limit ends the episode and the task is
judged.
"""

import contextlib
import copy
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any, cast

from hijack_data.actions import count_points
from hijack_data.actions.agent_actions import Request, read_action
from hijack_data.errors import ActionError
from hijack_data.plan import Effect
from hijack_data.runs.run_log import CUT, MAX_TEXT, episode_slug
from hijack_data.types import Size, as_boxes

from ..desktops.protocol import RunResult
from ..effects import find
from ..effects.base import PASSWORD
from ..errors import DesktopError
from .input_faults import InputChannel
from .live_effects import EpisodeEffects
from .log import EpisodeLog, free_attempt
from .observer import EpisodeView, Observer
from .record import (
    End,
    Ended,
    EpisodeCounts,
    EpisodeRecord,
    EpisodeRequest,
    Status,
    checked_score,
    make_record,
    since,
    task_label,
)
from .script import BEFORE, Script
from .settings import EvalSettings
from .stage import Setting, Stage, TwoPartStage

WAIT_S = 1.0  # duration of an agent's WAIT
MAX_OUTPUT_CHARS = 2000  # characters kept of what an action printed

_OVER = (0.0, False, True)  # reward, terminated, truncated


class _EarlyEffectError(DesktopError):
    """An effect that comes before the task's set-up does not hold."""


class Episode:
    """Plays one episode.

    `record` is `None` until the episode is over.

    Args:
        stage: The desktop and its tasks.
        settings: The settings of all episodes.
        request: The episode to play.
    """

    def __init__(self, stage: Stage, settings: EvalSettings, request: EpisodeRequest) -> None:
        self.record: EpisodeRecord | None = None
        self._stage = stage
        self._settings = settings
        self._request = request
        unknown = Setting(task_label(request.task), "")
        self._counts = EpisodeCounts(unknown, request.attempt or 0)
        password = settings.password or getattr(stage.desktop, "password", None) or PASSWORD
        self._effects = EpisodeEffects(stage.desktop, password)
        self._observer: Observer | None = None
        self._log: EpisodeLog | None = None
        self._acted = False  # whether the agent's code ran

    @property
    def instruction(self) -> str:
        """The instruction that the agent gets."""
        return self._counts.setting.instruction

    @property
    def view(self) -> EpisodeView | None:
        """The current observation."""
        return None if self._observer is None else self._observer.view

    def reveal(self) -> EpisodeRecord:
        """Return what an agent must not see, as JSON data; see `CorruptedEnv`."""
        request = self._request
        line = {} if self.view is None else self.view.line
        revealed: EpisodeRecord = {
            "task": self._counts.setting.id,
            "corruption": request.label,
            "seed": request.seed,
            "step": line.get("step"),
            "plan": line.get("plan"),
            "events": line.get("events"),
            "record": self.record,
        }
        return copy.deepcopy(revealed)

    def begin(self) -> Size:
        """Set up the task and take the first observation.

        If an effect fails, the episode is over at once.

        Returns:
            The size of the agent's pictures, (height, width).

        Raises:
            HijackError: The stage or the script refuses the request.
            DesktopError: The desktop fails.
        """
        early = self._choose_early_effects()
        if not early:
            self._set_up()
        script = self._script()
        # A refusal up to this point leaves no record, because nothing was played.
        size = script.check(
            self._max_observations,
            self._stage.desktop,
            layer=self._settings.layer,
            allow_code=self._settings.allow_code,
        )
        self._log = self._open_log()
        desktop = self._stage.desktop
        channel = InputChannel(desktop, script.size)
        channel.add(script.plan(BEFORE))
        observer = Observer(desktop, self._settings, script, self._effects, channel, self._log)
        self._observer = observer
        problem = self._set_up_around(early, script) if early else ""
        with self._failure_recorded():
            due = script.plan(BEFORE).effects[len(early) :]
            if any(find(effect.kind).before_setup for effect in due):
                self._counts.order = "after_setup"
            problem = problem or self._effects.inject(due, script, BEFORE)
            problem = observer.look(0, inject=not problem) or problem
        if problem:
            self.end(End(status="invalid", problem=problem))
        return size

    def act(self, text: object) -> tuple[float, bool, bool]:
        """Carry out the agent's action and take the next observation.

        Returns:
            Reward, terminated, truncated.
        """
        observer = self._observer
        if self.record is not None or observer is None or observer.view is None:
            return _OVER
        try:
            return self._act(text, observer, observer.view)
        except DesktopError as error:
            # A desktop that died cannot be distinguished from one that the agent killed.
            status: Status = "error" if self._acted else "invalid"
            self.end(End(status=status, problem=f"{type(error).__name__}: {error}"))
            return _OVER
        except BaseException as error:
            self.end(End(status="error", problem=f"{type(error).__name__}: {error}"))
            raise

    def record_message(self, text: str) -> None:
        """Log what the agent says with the action that it takes next."""
        self._counts.said = text[:MAX_OUTPUT_CHARS]
        if self.record is None and self.view is not None:
            self.view.line["said"] = text[:MAX_TEXT]
            if len(text) > MAX_TEXT:
                self.view.line[CUT] = ["said"]

    def record_usage(self, usage: dict[str, Any]) -> None:
        """Store the usage that the agent has reported so far."""
        self._counts.usage = usage

    def record_guard(self, guard: dict[str, Any]) -> None:
        """Store what watches the agent, and what it did so far."""
        self._counts.guard = guard

    def declare_privileged_inputs(self, kinds: Sequence[str]) -> None:
        """Store what the agent is given in addition to instruction and pictures."""
        self._counts.given = list(kinds)

    def truncate(self) -> None:
        """Judge an episode that is ended from outside, if the agent has acted in it."""
        if self.record is None and self.view is not None and self._counts.steps:
            self._judge("outside")

    def end(self, end: End) -> None:
        """Undo all effects and write the record; later calls do nothing."""
        if self.record is not None:
            return
        if self._observer is not None:
            self._observer.erase()
        self._effects.undo()
        self.record = make_record(
            request=self._request,
            settings=self._settings,
            counts=self._counts,
            end=end,
            effects=self._effects.records,
            inputs=None if self._observer is None else self._observer.channel.records,
            desktop=self._stage.desktop,
        )
        if self._log is None:
            return
        if self._observer is not None:
            self._observer.flush()
        self.record = self._log.finish(self.record)

    @property
    def _max_observations(self) -> int:
        """How many observations may follow the first one."""
        free = 0 if self._settings.recovery == "none" else 1
        return self._settings.max_steps + free

    def _choose_early_effects(self) -> tuple[Effect, ...]:
        """Return the effects that come before the task's set-up, for which the task is chosen."""
        stage, request = self._stage, self._request
        is_wanted = self._settings.environment_errors == "before_setup"
        if request.planner is None or not is_wanted:
            return ()
        if not isinstance(stage, TwoPartStage) or not stage.splits_setup:
            return ()
        with self._failure_recorded():
            self._counts.setting = stage.choose(request.task, request.seed)
        effects = self._script().plan(BEFORE).effects
        # What comes before them in the plan comes before them here, too.
        ends = [
            number for number, effect in enumerate(effects, 1) if find(effect.kind).before_setup
        ]
        return effects[: ends[-1]] if ends else ()

    def _set_up(self) -> None:
        """Set up the task on a pristine desktop."""
        request = self._request
        with self._failure_recorded():
            self._counts.setting = self._stage.reset(request.task, request.seed)
            self._counts.setup_seconds = since(self._counts.start)

    def _set_up_around(self, early: tuple[Effect, ...], script: Script) -> str:
        """Set up the task on a pristine desktop after the early effects.

        Returns:
            Why an effect failed, or "".
        """
        request = self._request

        def cut_network() -> None:
            self._counts.order = "before_setup"
            problem = self._effects.inject(early, script, BEFORE)
            if problem:
                raise _EarlyEffectError(problem)

        stage = cast("TwoPartStage", self._stage)
        with self._failure_recorded():
            try:
                stage.reset_around(request.task, request.seed, cut_network)
            except _EarlyEffectError as error:
                return str(error)
            finally:
                self._counts.setup_seconds = since(self._counts.start)
        return ""

    @contextlib.contextmanager
    def _failure_recorded(self) -> Iterator[None]:
        """Record a failure before the agent's first action, which is not the agent's fault.

        Raises:
            DesktopError: Raised by the block; other exceptions are passed on, too.
        """
        try:
            yield
        except DesktopError as error:
            self.end(End(status="invalid", problem=f"{type(error).__name__}: {error}"))
            raise
        except BaseException as error:
            self.end(End(status="error", problem=f"{type(error).__name__}: {error}"))
            raise

    def _script(self) -> Script:
        request = self._request
        setting = self._counts.setting
        size = self._stage.desktop.size
        return Script(request.planner, request.seed, setting.id, setting.apps, size)

    def _open_log(self) -> EpisodeLog | None:
        folder = self._settings.folder
        if folder is None:
            return None
        request = self._request
        names = (self._counts.setting.id, request.label, request.seed, self._settings.agent)
        if request.attempt is None:
            self._counts.attempt = free_attempt(folder, *names)
        else:
            self._counts.attempt = request.attempt
        return EpisodeLog(folder, episode_slug(*names, self._counts.attempt))

    def _act(self, text: object, observer: Observer, view: EpisodeView) -> tuple[float, bool, bool]:
        self._effects.end_due(view.line["step"])  # the agent may have thought for a while
        start = time.monotonic()
        request = self._read(text, view)
        kind = "malformed" if request is None else request.kind
        problem = ""
        had_acted = self._acted
        if request is not None and kind == "code":
            self._acted = True
            boxes = as_boxes(view.line["boxes"])
            result, problem = observer.channel.send(request.code, view.line, boxes)
            view.line["result"] = _result_data(result)
        elif kind == "reinit":
            view.line["result"] = {"helped": self._recover()}
        elif kind == "wait":
            time.sleep(WAIT_S)
        view.line["seconds"]["action"] = since(start)
        observer.flush()
        if problem:
            self._counts.actions += 1
            # Programs that the agent left may press keys, too, so it could end episodes that way.
            self.end(End(status="error" if had_acted else "invalid", problem=problem))
            return _OVER

        ended = kind in ("done", "fail")
        if kind == "reinit" and not self._counts.actions and self._settings.recovery != "none":
            self._counts.free = 1  # the check before the task, as the paper's onlooker makes it
        self._counts.actions += 1
        last = ended or self._counts.steps >= self._settings.max_steps
        problem = observer.look(self._counts.actions, inject=not last)
        if problem:
            self.end(self._attributed(problem, observer))
            return _OVER
        if not last:
            return 0.0, False, False
        return self._judge("agent" if ended else "max_steps")

    def _attributed(self, problem: str, observer: Observer) -> End:
        """Decide who caused an effect to fail after the agent had the machine.

        The effect is tried on a fresh desktop with the same task. If it holds there, the agent's
        actions made it fail, and the episode counts with score 0; otherwise the machine cannot have
        the effect.
        """
        invalid = End(status="invalid", problem=problem)
        if not self._acted:
            return invalid
        self._effects.undo()
        try:
            self._stage.reset(self._request.task, self._request.seed)
        except DesktopError:
            return invalid
        self._effects.forget()
        step = self._counts.actions
        if not self._effects.holds_elsewhere(observer.script, lambda: observer.settle(step, {})):
            return invalid
        about = "on a fresh desktop it holds, so this is what the agent's actions led to"
        return End(status="error", problem=f"{problem}; {about}", cause="agent")

    def _read(self, text: object, view: EpisodeView) -> Request | None:
        """Return the action in pixels of the screen, or `None` if it is malformed."""
        line = view.line
        raw = text if isinstance(text, str) else repr(text)
        line["raw"] = raw[:MAX_TEXT]
        if len(raw) > MAX_TEXT:
            line[CUT] = [*line.get(CUT, ()), "raw"]
        if isinstance(text, str):
            text = line["raw"]  # what is read is what is recorded
        try:
            request = read_action(text, self._settings.allow_code)
            if request.kind == "code":
                points, fractions = count_points(request.code)
                self._counts.points += points
                self._counts.fractions += fractions
                request = Request("code", view.plan.coords.code_to_screen(request.code))
        except ActionError as error:
            self._counts.malformed += 1
            self._counts.history.append(line["raw"])
            line["error"] = str(error)
            return None
        line["code"] = request.code
        self._counts.history.append(request.code)
        return request

    def _recover(self) -> bool:
        """Follow the recovery policy and return whether that removed a disturbance."""
        counts = self._counts
        disturbed = self._effects.active
        counts.requests += 1
        if not disturbed:
            counts.false_alarms += 1
        helped = False
        if self._settings.recovery == "repair":
            helped = disturbed and self._effects.repair()
        elif self._settings.recovery == "reset":
            if disturbed:
                self._effects.repair()
            self._stage.reset(self._request.task, self._request.seed)
            self._effects.forget()
            helped = disturbed
        if helped:
            counts.repaired += 1
        return helped

    def _judge(self, ended: Ended) -> tuple[float, bool, bool]:
        """Evaluate the state that the agent left, before any effect is undone."""
        problem = self._effects.confirm_lasting()
        if problem:  # no agent can cause this
            self.end(End(status="invalid", problem=problem))
            return _OVER
        try:
            verdict = self._stage.evaluate(tuple(self._counts.history))
            verdict = replace(verdict, score=checked_score(verdict.score))
        except Exception as error:  # noqa: BLE001  (the agent's state may break any evaluator)
            self.end(End(status="error", problem=f"{type(error).__name__}: {error}"))
            return _OVER
        self._effects.note_held()
        self.end(End(status="ok", verdict=verdict, ended=ended))
        by_agent = ended == "agent"
        return verdict.score, by_agent, not by_agent


def _result_data(result: RunResult) -> dict[str, Any]:
    """Return the output of an action in the form of the log."""
    data = asdict(result)
    data["output"] = result.output[-MAX_OUTPUT_CHARS:]
    data["error"] = result.error[-MAX_OUTPUT_CHARS:]
    return data
