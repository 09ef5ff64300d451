"""The settings that hold for every episode of an evaluation."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TypedDict

from hijack_data import extras
from hijack_data.errors import ParameterError, UnknownNameError, suggest

from ..choices import ERROR_ORDERS, LAYERS, POLICIES, DrawingLayer, ErrorOrder, Recovery
from .settle import Settle


@dataclass(frozen=True, kw_only=True)
class EvalSettings:
    """The settings of all episodes of a `CorruptedEnv`.

    Args:
        max_steps: Actions until an episode is truncated, at least 1.
        settle: When the screen counts as settled.
        recovery: What `REQUEST_REINIT` leads to: `"none"` changes nothing, `"repair"` undoes the
            effects, `"reset"` sets up the task again on a clean desktop. Requests are counted in
            any case. With the last two, a request that is the agent's first action costs no step.
        environment_errors: When the network is cut that is down from the beginning:
            `"before_setup"`, as in the paper, so that the first picture shows the browser's error
            page; or `"after_setup"`, when the task's page has been loaded. A stage that cannot set
            a task up in two parts (see `environment.stage.TwoPartStage`) always does the latter;
            the record says what was done.
        allow_code: Allow any Python code; it runs in the guest, as the desktop's user.
        log: The folder of the run; an episode is written to `log/episodes/<its id>/`. `None`
            writes nothing.
        agent: The agent's name, for the record.
        password: The password of the desktop's user; by default that which the desktop has as
            `password`, or else `"password"`.
        text_boxes: Whether the lines of text on the screen, read by OCR, count as elements that
            pop-ups and marks keep free, as in the code of the paper's authors. Reading takes 2 to
            4 s of processor time for each new screen. An accidental touch chooses among elements
            of the tree in any case.
        layer: Who draws what a plan pastes: `"picture"`, this library, on the picture; or `"dom"`,
            the browser, as nodes of the page, which are in the accessibility tree and can be
            clicked. The plans are the same.

    Raises:
        MissingDependencyError: `text_boxes` is set, and RapidOCR is not installed.
        ParameterError: `max_steps` is not an integer of at least 1.
        UnknownNameError: `recovery`, `environment_errors` or `layer` is not a known choice.
    """

    max_steps: int = 15
    settle: Settle = field(default_factory=Settle)
    recovery: Recovery = "none"
    environment_errors: ErrorOrder = "before_setup"
    allow_code: bool = False
    log: Path | str | None = None
    agent: str = "agent"
    password: str | None = None
    text_boxes: bool = False
    layer: DrawingLayer = "picture"

    def __post_init__(self) -> None:
        steps: object = self.max_steps
        if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
            raise ParameterError(f"max_steps must be an integer of at least 1, got {steps!r}")
        if self.recovery not in POLICIES:
            close = suggest(self.recovery, POLICIES)
            raise UnknownNameError(f"no recovery policy {self.recovery!r}{close}")
        if self.environment_errors not in ERROR_ORDERS:
            close = suggest(self.environment_errors, ERROR_ORDERS)
            raise UnknownNameError(f"no environment_errors {self.environment_errors!r}{close}")
        if self.layer not in LAYERS:
            raise UnknownNameError(f"no layer {self.layer!r}{suggest(self.layer, LAYERS)}")
        if self.text_boxes:
            extras.require("text_boxes", "ocr", ("rapidocr", "onnxruntime"))

    @property
    def folder(self) -> Path | None:
        """The folder of the run as a path, or `None` if nothing is written."""
        return None if self.log is None else Path(self.log)


class EvalOptions(TypedDict, total=False):
    """The fields of `EvalSettings` as keyword arguments of `CorruptedEnv`."""

    max_steps: int
    settle: Settle
    recovery: Recovery
    environment_errors: ErrorOrder
    allow_code: bool
    log: Path | str | None
    agent: str
    password: str | None
    text_boxes: bool
    layer: DrawingLayer
