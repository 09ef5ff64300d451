"""Observations: wait for the screen, apply due effects, take the picture, corrupt and log it."""

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hijack_data import apply
from hijack_data.elements.interactive_nodes import boxes_from_tree
from hijack_data.elements.ocr import boxes_from_ocr
from hijack_data.errors import ElementsError
from hijack_data.plan import Effect, Plan
from hijack_data.runs.page_layer import LAYER
from hijack_data.types import BoxArray, UInt8Array, as_boxes

from ..desktops.protocol import Desktop
from ..errors import DesktopError, MissingCapabilityError
from .input_faults import InputChannel
from .live_effects import EpisodeEffects
from .log import EpisodeLog
from .record import since
from .script import Script
from .settings import EvalSettings
from .settle import Settled, wait_until_settled


@dataclass(frozen=True, kw_only=True)
class EpisodeView:
    """One observation: the agent's picture, its plan, and the line of the log that it begins."""

    picture: UInt8Array
    plan: Plan
    line: dict[str, Any]


class Observer:
    """Takes the observations of one episode; `view` is the latest.

    Args:
        desktop: The machine.
        settings: What holds for every episode.
        script: The plans of this episode.
        effects: The effects of this episode.
        channel: Where the faults of the plans wait for the agent's actions.
        log: Where frames and lines go; `None` writes nothing.
    """

    def __init__(
        self,
        desktop: Desktop,
        settings: EvalSettings,
        script: Script,
        effects: EpisodeEffects,
        channel: InputChannel,
        log: EpisodeLog | None,
    ) -> None:
        self.view: EpisodeView | None = None
        self._desktop = desktop
        self._settings = settings
        self.script = script
        self._effects = effects
        self.channel = channel
        self._log = log
        self._written = 0  # lines of the log
        self._read: tuple[UInt8Array, BoxArray] | None = None  # the screen read last, and its text
        self._drawn = False  # whether the page has nodes of a plan

    def look(self, step: int, *, inject: bool) -> str:
        """Take observation `step` and return why a due effect failed, or "".

        Args:
            step: The number of the observation.
            inject: Whether to apply effects that are due now.
        """
        problem = ""
        seconds: dict[str, float] = {}
        self._effects.end_due(step)
        self.erase()
        self._effects.refresh()
        settled, boxes = self.settle(step, seconds)
        start = time.monotonic()
        plan = self.script.plan(step, boxes)
        effect_boxes: BoxArray | None = None  # on which effects were planned, before they acted
        if inject and (plan.effects or self._effects.has_due()):
            effect_boxes = boxes
            problem = self._inject(plan.effects, step)
            seconds["effects"] = since(start)
            settled, boxes = self.settle(step, seconds)
            start = time.monotonic()
            plan = self.script.plan(step, boxes)
        # The effects are probed before the picture and again after it, so it shows them.
        effect_problem = "" if problem else self._effects.confirm()
        if effect_problem:
            problem = self._effects.repeat(self.script)
            seconds["effects"] = seconds.get("effects", 0.0) + since(start)
            settled, boxes = self.settle(step, seconds)
            start = time.monotonic()
            plan = self.script.plan(step, boxes)
            problem = problem or self._effects.confirm()
        if effect_problem and problem:
            problem = f"{effect_problem}; applied once more: {problem}"
        clean = settled.frame
        corrupted, layer_facts, layer_problem = self._corrupt(plan, clean)
        problem = problem or layer_problem
        frames = {} if self._log is None else self._log.frames(step, clean, corrupted)
        facts = self._facts(plan, settled, boxes) | layer_facts
        if effect_boxes is not None:
            facts["effect_boxes"] = effect_boxes.tolist()
        line = {"step": step, **frames, **facts, "seconds": seconds}
        self.view = EpisodeView(picture=corrupted, plan=plan, line=line)
        self.channel.add(plan)
        seconds["corrupt"] = since(start)
        return problem

    def erase(self) -> None:
        """Remove the nodes of the last plan from the page; a page that is gone has none."""
        if self._drawn:
            self._drawn = False
            with contextlib.suppress(DesktopError):  # the picture that follows shows what is left
                self._page_layer.erase()

    @property
    def _page_layer(self) -> Any:
        """Draws into the page of a browser, and of no other desktop."""
        return getattr(self._desktop, "page_layer")  # noqa: B009  (`Script.check` requires it)

    def _corrupt(self, plan: Plan, clean: UInt8Array) -> tuple[UInt8Array, dict[str, Any], str]:
        """Return the agent's picture, what proves a drawn page, and why there is no proof."""
        if not plan.ops:
            return clean, {}, ""
        if self._settings.layer == "picture":
            return apply(plan, clean), {}, ""
        self._drawn = True
        problem = self._page_layer.draw(plan)
        picture = self._desktop.screenshot()
        if problem:
            return picture, {}, f"the plan cannot be drawn into the page: {problem}"
        probe = self._page_layer.probe(plan, picture)
        return picture, {LAYER: probe.facts}, probe.problem

    def settle(self, step: int, seconds: dict[str, float]) -> tuple[Settled, BoxArray]:
        """Wait for the screen to settle, and read its elements if the plan depends on them.

        With `text_boxes`, the lines of text are among the elements of a step without effects. The
        effects of a step are planned on what can be clicked.

        Args:
            step: The number of the observation.
            seconds: Receives how long each part took.

        Raises:
            DesktopError: The size of the screen changed, or its tree cannot be read.
        """
        start = time.monotonic()
        with_tree = self.script.needs_tree(step) or self.channel.needs_elements
        settled = wait_until_settled(self._desktop, self._settings.settle, with_tree)
        seconds["settle"] = since(start) + seconds.get("settle", 0.0)
        seconds["tree"] = settled.tree_seconds
        if settled.frame.shape[:2] != self.script.size:
            height, width = settled.frame.shape[:2]
            before = self.script.size[::-1]
            raise DesktopError(f"the screen is {width}x{height} now, it was {before} at first")
        if settled.tree is None:
            return settled, as_boxes(None)
        start = time.monotonic()
        try:
            boxes = boxes_from_tree(settled.tree, self.script.size).boxes
        except ElementsError as error:
            message = f"the accessibility tree of the desktop cannot be read: {error}"
            raise DesktopError(message) from None
        if self._settings.text_boxes and not self.script.plan(step, boxes).effects:
            boxes = as_boxes(np.concatenate([boxes, self._text_boxes(settled.frame)]))
        seconds["boxes"] = since(start)
        return settled, boxes

    def _text_boxes(self, frame: UInt8Array) -> BoxArray:
        """Return the boxes of the lines of text; a screen that did not change is not read again."""
        if self._read is None or not np.array_equal(self._read[0], frame):
            self._read = (frame, boxes_from_ocr(frame).boxes)
        return self._read[1]

    def flush(self) -> None:
        """Write the line of the current observation, unless it is written already."""
        if self._log is None or self.view is None:
            return
        if self.view.line["step"] >= self._written:
            self._written += 1
            self._log.line(self.view.line)

    def _inject(self, effects: Sequence[Effect], step: int) -> str:
        try:
            return self._effects.inject(effects, self.script, step)
        except MissingCapabilityError as error:
            if self.view is None:  # nothing was played yet, so the caller must see the error
                raise
            return str(error)

    def _facts(self, plan: Plan, settled: Settled, boxes: BoxArray) -> dict[str, Any]:
        """Return the log's fields about the screen; the action is filled in later."""
        data = plan.to_data()
        return {
            "plan": data,
            "plan_digest": data["digest"],
            "boxes": boxes.tolist(),
            "apps": list(self.script.apps),
            "raw": None,
            "code": None,
            "error": None,
            "events": self._effects.events(),
            "result": None,
            "still": settled.in_time,
        }
