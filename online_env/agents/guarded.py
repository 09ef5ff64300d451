"""A guard around any agent: the paper's onlooker (section 5), apart from the agent that acts.

An `Onlooker` gets pictures, the instruction and actions, never the injected corruption. It checks
the first screen, says after each step what happened, and may act in place of the agent: wait, close
what is in the way, or ask for re-initialisation. `Guarded` puts it between agent and desktop. The
agent may be an object or run in a process of its own; the guard is always outside of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from hijack_data.actions.agent_actions import REINIT
from hijack_data.types import UInt8Array

from .base import Observation

MAX_NOTE_CHARS = 2000  # of a reminder or a summary that is put into an agent's instruction
_SUMS = ("requests", "retries", "input_tokens", "output_tokens", "usd", "seconds")


@dataclass(frozen=True, kw_only=True)
class Notice:
    """What an onlooker says of a picture.

    Args:
        kind: the name of what is wrong; "" if nothing is.
        reminder: what to tell the agent about it.
        summary: what the last action did.
        unexpected: what changed meanwhile that the action cannot have caused.
        actions: what the guard does now, in place of the agent; empty to let the agent act.
    """

    kind: str = ""
    reminder: str = ""
    summary: str = ""
    unexpected: str = ""
    actions: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class PastStep:
    """The last step.

    Args:
        picture: what was seen before it, uint8 RGB `[H, W, 3]`.
        text: what the agent wrote, with its actions.
        actions: what was done: pyautogui code, `WAIT`, ...
        is_guards: whether the guard acted, and not the agent.
    """

    picture: UInt8Array
    text: str
    actions: tuple[str, ...]
    is_guards: bool = False


class Onlooker(Protocol):
    """What watches an agent."""

    @property
    def name(self) -> str:
        """For the record: `rules` or `model`."""
        ...

    @property
    def checks(self) -> bool:
        """Whether the first screen is checked."""
        ...

    @property
    def reinits(self) -> bool:
        """Whether the guard asks once for re-initialisation if the check finds an error."""
        ...

    @property
    def settings(self) -> Mapping[str, Any]:
        """For the record, as JSON data."""
        ...

    @property
    def usage(self) -> Mapping[str, Any] | None:
        """What it has used so far; `None` if somebody else counts that."""
        ...

    def reset(self) -> None:
        """Forget the episode."""
        ...

    def begin_step(self) -> None:
        """A new picture has come; called before `check` and `watch`."""
        ...

    def check(self, picture: UInt8Array, instruction: str) -> Notice:
        """Check the screen before the agent's first action (the paper's initial check)."""
        ...

    def watch(self, instruction: str, step: PastStep, picture: UInt8Array) -> Notice:
        """Say what happened in a step, given the picture after it (the paper's d_t)."""
        ...


class Guarded:
    """An agent that an onlooker watches; itself an agent.

    Before the agent's first action the onlooker checks the screen. If something is wrong, the guard
    asks once for re-initialisation and looks again; if it is still wrong, the guard acts if it
    knows how, and the agent is reminded otherwise. After each step the onlooker says what happened.
    An agent with `take_notice` (`chat.agent.ChatAgent`) gets the notice; the others get reminder
    and summary with their instruction.

    Args:
        agent: anything with `predict(instruction, obs)`: an `Agent`, or a `RunningAgent`.
        onlooker: what watches it.
    """

    def __init__(self, agent: Any, onlooker: Onlooker) -> None:
        self._agent = agent
        self.onlooker = onlooker
        self._forget()

    def __getattr__(self, name: str) -> Any:
        # What the agent has beside `predict`: `follow` and `uses_plan`, `prepare`, `check_ready`;
        # not what would answer past the guard.
        if name.startswith("_") or name == "predict_batch":
            raise AttributeError(name)
        return getattr(self._agent, name)

    def reset(self) -> None:
        """Forget the episode."""
        reset = getattr(self._agent, "reset", None)
        if reset is not None:
            reset()
        self.onlooker.reset()
        self._forget()

    @property
    def usage(self) -> Mapping[str, Any] | None:
        """The usage of the agent and of the onlooker together."""
        usage = getattr(self._agent, "usage", None)
        return joint_usage(usage if isinstance(usage, Mapping) else None, self.onlooker.usage)

    @property
    def guard_record(self) -> dict[str, Any]:
        """What the record of the episode says of the guard, as JSON data.

        `interventions` has the step, what was wrong (`kind`), and the actions in place of the
        agent's; without actions, the agent was reminded.
        """
        return {
            "name": self.onlooker.name,
            "settings": dict(self.onlooker.settings),
            "interventions": [dict(intervention) for intervention in self._interventions],
        }

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[Any]]:
        """Return the guard's words and actions, or those of the agent.

        Args:
            instruction: the task in words.
            obs: `obs["screenshot"]` is uint8 RGB `[H, W, 3]`.
        """
        picture: UInt8Array = obs["screenshot"]
        self.onlooker.begin_step()
        if self._needs_check():
            notice = self.onlooker.check(picture, instruction)
            self._checks += 1
            self._reminder = notice.reminder
            if notice.reminder and self._checks == 1 and self.onlooker.reinits:
                asking = replace(notice, actions=(REINIT,))
                return self._intervene(asking)
        elif self._last is not None:
            notice = self.onlooker.watch(instruction, self._last, picture)
        else:
            notice = Notice()
        if notice.actions:
            self._reminder = ""
            answer = self._intervene(notice)
            self._remember(picture, answer, is_guards=True)
            return answer
        return self._ask(instruction, obs, notice)

    def _ask(self, instruction: str, obs: Observation, notice: Notice) -> tuple[str, Sequence[Any]]:
        """Let the agent act."""
        if notice.kind:
            self._note(notice)
        notice = replace(notice, reminder=notice.reminder or self._reminder)
        picture = obs["screenshot"].copy()  # which the agent may modify
        if getattr(self._agent, "take_notice", None) is None:
            instruction = add_notice(instruction, notice)
        else:
            self._agent.take_notice(notice)
        answer = self._agent.predict(instruction, obs)
        self._remember(picture, answer)
        return answer

    def _remember(
        self, picture: UInt8Array, answer: tuple[str, Sequence[Any]], *, is_guards: bool = False
    ) -> None:
        words, actions = answer
        texts = tuple(action if isinstance(action, str) else repr(action) for action in actions)
        # The words of a model hold its actions already, in its own dialect.
        is_whole = getattr(self._agent, "words_have_actions", False)
        text = words if is_whole else "\n".join([words, *texts]).strip()
        self._last = PastStep(picture=picture, text=text, actions=texts, is_guards=is_guards)
        self._steps += max(len(actions), 1)  # an empty list counts as a malformed action

    def _intervene(self, notice: Notice) -> tuple[str, Sequence[str]]:
        """Return the guard's actions."""
        self._note(notice)
        return f"Reminder: {notice.reminder}", list(notice.actions)

    def _note(self, notice: Notice) -> None:
        actions = list(notice.actions)
        self._interventions.append({"step": self._steps, "kind": notice.kind, "actions": actions})
        if actions == [REINIT]:
            self._steps += 1

    def _needs_check(self) -> bool:
        """Return whether nobody has acted yet and the first check is not finished."""
        if self._last is not None or not self.onlooker.checks:
            return False
        has_asked = bool(self._reminder) and self.onlooker.reinits
        return self._checks == 0 or (has_asked and self._checks == 1)

    def _forget(self) -> None:
        self._checks = 0
        self._steps = 0
        self._reminder = ""
        self._last: PastStep | None = None
        self._interventions: list[dict[str, Any]] = []


def joint_usage(
    usage: Mapping[str, Any] | None, guard_usage: Mapping[str, Any] | None
) -> dict[str, Any] | None:
    """Return the usage of an agent and its guard: sums, with the guard's own part as `guard`.

    A cost in USD that either of them does not know is not known (`None`).
    """
    if guard_usage is None:
        return None if usage is None else dict(usage)
    total = {} if usage is None else dict(usage)
    if "requests" in guard_usage:
        before = total if "requests" in total else {}
        for key in _SUMS:
            unsaid = None if key == "usd" else 0
            values = [part.get(key, unsaid) for part in (before, guard_usage) if part]
            total[key] = None if None in values else round(sum(values), 9)
    return {**total, "guard": dict(guard_usage)}


def add_notice(instruction: str, notice: Notice) -> str:
    """Return an instruction with what an onlooker says as lines after it."""
    lines = {
        "Your last step": notice.summary,
        "Not your doing": notice.unexpected,
        "Reminder": notice.reminder,
    }
    parts = [f"{name}: {text[:MAX_NOTE_CHARS]}" for name, text in lines.items() if text]
    return "\n\n".join([instruction, *parts])
