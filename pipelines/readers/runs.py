"""Runs of the live benchmark: the logs that `CorruptedEnv` writes."""

import dataclasses
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from hijack_data.actions.agent_actions import REINIT
from hijack_data.actions.input_faults import InputFault
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import HijackError
from hijack_data.runs.run_log import EPISODE, EPISODES, RECORDS, RUN, STEPS
from hijack_data.types import Action, Platform, Trajectory

from . import fields
from .base import Rejected, register
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .folder_reader import EpisodeFolder, FolderReader
from .recorded_actions import PYAUTOGUI, AlteredStep, RecordedStep, first_action, raw_action_text
from .recording_facts import RecordedTrajectory
from .safe_files import image_size, inside, parse_file, relative_name

# By the class of the desktop, as the log names it.
_PROVIDERS: dict[str, Platform] = {"EmbeddedDesktop": "linux-xfce", "OsworldDesktop": "linux"}


@register
class Runs(FolderReader):
    """Reads the folder of a run, or that of one of its episodes.

    A run has `episodes/<id>/{episode.json, steps.jsonl, frames/}`. A trajectory's id is the
    episode's; its draws are keyed by the task, as they were live, so a corruption that is planned
    again for it, with the same seed, gives the plan that the agent met.
    Each step is a clean screen and the action that the agent took on seeing it, after the
    corruption's coordinates were mapped back. If a fault of the input changed the action on its
    way, the step is an `AlteredStep`: the action is the agent's, and `extra` has what the machine
    received (`input`: `sent` and `faults`, as the log has them).

    Left out, with the reason: episodes that were broken off, are invalid or ended in an error;
    actions that were refused, or that a guard took in place of the agent; whatever comes after an
    effect, since those screens show what was done to the machine; and whatever comes after a fault
    of the input, unless the episode was solved: only then what the agent did next was right.

    Coordinates: pixels of the screen, whose size the clean screenshots have; a point outside is
    rejected.
    """

    name = "runs"
    records = STEPS
    adopts = True
    suffixes = (STEPS,)
    keys = (frozenset({"raw", "code", "image"}),)

    def recognizes(self, head: FileHead) -> bool:
        """Return whether a file is the log of an episode."""
        return head.path.name == STEPS

    def beside(self, file: Path) -> bool:
        """Return whether a file describes a run or an episode."""
        return file.name in (EPISODE, RECORDS, RUN)

    def refusal(self, source: Path) -> str:
        """Return why a run without episodes cannot be read; `""` if `source` is none."""
        if not (source / RUN).is_file() or (source / EPISODES).is_dir():
            return ""
        return (
            f"is a run without the folder {EPISODES}, which has the screens (a run of hijack score"
            " has none); give the folder where hijack bench played it"
        )

    def episode(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one episode, and everything rejected of it."""
        return _Episode(root, file).read()


@dataclass
class _Episode(EpisodeFolder):
    """One episode, while it is read.

    Args:
        touched: the effect after which no screen is clean.
        solved: whether the agent solved the task.
        lost: the first step whose action was changed on its way, if the task was not solved.
        left_out: whether steps came after it.
        guarded: the steps at which a guard acted.
    """

    touched: str = ""
    solved: bool = False
    lost: int | None = None
    left_out: bool = False
    guarded: frozenset[int] = frozenset()

    def read(self) -> Iterator[Trajectory | Rejected]:
        """Yield what is rejected, then the trajectory."""
        try:
            record = self._record()
            self.solved = record.get("score") == 1
            self.guarded = frozenset(_guarded_steps(record))
            yield from self.take_lines()
            about = _about(record)
        except FieldError as error:
            name = relative_name(self.folder / EPISODE, self.root)
            yield Rejected(name, "", error.field, error.reason)
            return
        except OSError as error:
            yield self.unreadable(error)
            return
        if self.touched:
            reason = (
                f"the screens after {self.touched} show what it did to the machine, so none of them"
                " is clean"
            )
            yield Rejected(self.records, "", "events", reason)
        if self.left_out:
            reason = (
                f"the action of step {self.lost} did not arrive as the agent did it, and the"
                " episode was not solved, so nothing says that what it did afterwards was right"
            )
            yield Rejected(self.records, "", "input", reason)
        if self.steps:
            yield RecordedTrajectory(
                steps=tuple(self.steps), source=Runs.name, **about, screen="desktop"
            )

    def _record(self) -> JsonObject:
        if not (self.folder / EPISODE).is_file():
            raise FieldError("", f"there is no {EPISODE}: the episode was broken off")
        record = parse_file(self.inside(EPISODE, ""))
        status = fields.text(record, "status")
        if status != "ok":
            problem = fields.text(record, "problem", default="")
            raise FieldError("status", f"the episode is {status}: {problem}")
        return record

    def take(self, record: JsonObject) -> None:
        """Add the step of one line, unless an effect or an unsolved fault came before it.

        Raises:
            FieldError: the line is broken, or its action was refused, or is not the agent's.
        """
        events = fields.items(record, "events")
        if events and not self.touched:
            event = fields.mapping(events[0], "events[0]")
            self.touched = fields.text(event, "effect", "events[0].effect")
        is_last = record.get("raw") is None  # an observation that no action followed
        if self.touched or is_last:
            return
        if self.lost is not None:
            self.left_out = True
            return
        if record.get("code") is None:
            error = fields.text(record, "error", default="")
            raise FieldError("code", f"the action was refused: {error}")
        step = self._step(record, fields.text(record, "code"))
        if record.get("input") is not None:
            step = altered_step(step, fields.mapping(record["input"], "input"))
            self.lost = None if self.solved else step.index
        if step.index in self.guarded:
            raise FieldError("code", "the action is that of a guard, not of the agent")
        self.steps.append(step)

    def _step(self, record: JsonObject, code: str) -> RecordedStep:
        image = inside(self.folder, fields.text(record, "image"))
        size = image_size(image)
        index = fields.step_number(record, "step")
        action = Action("other")
        dialect = SIZELESS
        if code != REINIT:
            action = first_action(code, PYAUTOGUI, size, "code")
            dialect = PYAUTOGUI
        return RecordedStep(
            index=index,
            image=os.fspath(image),
            action=action,
            action_code=raw_action_text(code, "code"),
            elements=fields.boxes(record.get("boxes") or [], size, "boxes"),
            dialect=dialect,
        )


def _guarded_steps(record: JsonObject) -> Iterator[int]:
    """Yield the steps at which a guard acted in place of the agent.

    Raises:
        FieldError: the record is damaged.
    """
    if record.get("guard") is None:
        return
    guard = fields.mapping(record["guard"], "guard")
    for entry in fields.mappings(fields.items(guard, "interventions"), "guard.interventions"):
        first = fields.step_number(entry, "step")
        yield from range(first, first + len(fields.items(entry, "actions")))


def altered_step(step: RecordedStep, entry: JsonObject) -> AlteredStep:
    """Return a step with the faults that changed its action, and what the machine received.

    Raises:
        FieldError: the entry of the log is damaged.
    """
    logged = fields.items(entry, "faults")
    try:
        faults = tuple(map(InputFault.from_data, logged))
    except HijackError as error:
        raise FieldError("input.faults", str(error)) from None
    sent = fields.text(entry, "sent", "input.sent")
    extra = raw_action_text({"input": {"sent": sent, "faults": logged}}, "input")
    values = {field.name: getattr(step, field.name) for field in dataclasses.fields(step)}
    return AlteredStep(**{**values, "extra": extra}, faults=faults)


def _about(record: JsonObject) -> dict[str, Any]:
    return {
        "id": fields.text(record, "id"),
        "instruction": fields.text(record, "instruction"),
        "apps": fields.strings(record.get("apps")),
        "sample": fields.text(record, "sample"),
        "platform": _platform(record.get("desktop")),
    }


def _platform(desktop: object) -> Platform | None:
    """Return the platform of a run's desktop; that of a machine which a user brought is unknown."""
    if not isinstance(desktop, dict):
        return None
    provider: object = cast("dict[str, Any]", desktop).get("provider")
    return _PROVIDERS.get(provider) if isinstance(provider, str) else None
