"""The base class of edits, with their input (`Frame`) and output (`EditedStep`).

An edit shows one kind of effect in a recording. To add one, subclass `Edit`, set its class
attributes and implement `apply`; that class holds everything about the look of the effect.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, TypeAlias

from hijack_data.apps import KINDS
from hijack_data.choices import PLATFORMS
from hijack_data.errors import HijackError
from hijack_data.pack import Asset, AssetPack, AssetTarget, RecordedAction
from hijack_data.plan import Effect, Op, Plan
from hijack_data.platforms import OURS
from hijack_data.rng import Stream
from hijack_data.types import (
    Action,
    Box,
    Fidelity,
    Platform,
    Scene,
    Size,
    Step,
    Trajectory,
    UInt8Array,
)

from ..errors import BuildError
from ..readers.recording_facts import RecordingFacts, ScreenKind, read_facts

WAIT = RecordedAction(Action("wait"))
NO_DESKTOP: dict[ScreenKind, str] = {
    "web page": "the pictures show a web page, not the screen around it",
    "phone": "the pictures show a phone, not the screen of a desktop",
}
SHOW_ANYWAY = (
    "--allow-platform-mismatch (in Python: allow_platform_mismatch=True) shows Xfce on it anyway"
)
SAY_XFCE = "if it is one, say so with --platform linux-xfce"
NO_PLATFORM = (
    "the recording does not say which desktop it shows, and the pictures are of an Xfce desktop; "
    f"{SAY_XFCE}; {SHOW_ANYWAY}"
)
NO_SCREEN = (
    "the recording does not say whether its pictures show a desktop, a web page or a phone; say so"
    f" with --platform ({', '.join(PLATFORMS)}), or by trajectory in agenthijack.yaml"
)
NAME_APPS = "name the applications that show with --apps, or by trajectory in agenthijack.yaml"


# The action of a row with an event: the recorded action, the action that was recorded as undoing
# the event, or waiting.
Answer: TypeAlias = Literal["keep", "undo", "wait"]


class NotApplicable(HijackError):
    """The event cannot be shown realistically at this step; the message is the reason."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A step at which something happens to the machine, with everything that an edit may use.

    Args:
        trajectory: the recording.
        step: the recorded step, whose screen it is.
        scene: the screen: elements, applications, the target of the recorded action.
        image: the clean screenshot, uint8 RGB `[H, W, 3]`; not to be modified.
        pack: the recorded pictures.
        stream: the only source of random draws.
        allow_platform_mismatch: whether the pack's desktop may be shown on a recording of another
            or an unknown platform.
        guess: whether the edit may guess what a click opens if that is not known. Always false for
            datasets.
    """

    trajectory: Trajectory
    step: Step
    scene: Scene
    image: UInt8Array
    pack: AssetPack
    stream: Stream
    allow_platform_mismatch: bool = False
    guess: bool = False

    @cached_property
    def facts(self) -> RecordingFacts:
        """What the recording states."""
        return read_facts(self.trajectory)

    @property
    def apps(self) -> frozenset[str]:
        """Applications of the recording, as far as it names any; its domain often is one."""
        return self.facts.apps

    @property
    def platform(self) -> Platform | None:
        """The platform of the recording's machine, or `None` if unknown."""
        return self.facts.platform

    @property
    def is_foreign(self) -> bool:
        """Whether the pack's desktop is not, or not known to be, that of the recording."""
        return not self.is_page and self.platform != OURS

    @property
    def is_page(self) -> bool:
        """Whether the pictures show a web page alone, without the browser and the desktop."""
        return self.facts.screen == "web page"

    def check_desktop(self) -> None:
        """Check that the recording shows a desktop like that of the pack.

        Pages, phones and pictures of unknown content are never accepted; other or unknown desktops
        are with `allow_platform_mismatch`.

        Raises:
            NotApplicable: it does not.
        """
        if self.facts.screen is None:
            raise NotApplicable(NO_SCREEN)
        no_desktop = NO_DESKTOP.get(self.facts.screen)
        if no_desktop is not None:
            raise NotApplicable(no_desktop)
        if not self.is_foreign or self.allow_platform_mismatch:
            return
        if self.platform is None:
            raise NotApplicable(NO_PLATFORM)
        reason = f"the recording shows {self.platform}, and the pictures are of an Xfce desktop"
        if self.platform == "linux":
            reason += f"; {SAY_XFCE}"
        raise NotApplicable(f"{reason}; {SHOW_ANYWAY}")


@dataclass(frozen=True, kw_only=True)
class EditedStep:
    """A step after an event, or a step that the event adds.

    Args:
        ops: the pastes onto the clean screenshot, whose size stays.
        event: what happened, one plain sentence.
        fidelity: `recorded` if every pixel is from one recorded screen, otherwise `composited`; see
            `..fidelity`.
        response: the action to take now, in pixels of the screen, and its target; `None` keeps the
            recorded one.
        inserted: whether it is a step of its own, before the recorded one.
        reminder: what an onlooker should say, or `None`.
        boxes: the clickable elements in the pasted parts, `xyxy`; with a `response`, all clickable
            elements.
        notes: remarks for the reader of the plan.
    """

    ops: tuple[Op, ...]
    event: str
    fidelity: Fidelity
    response: RecordedAction | None = None
    inserted: bool = False
    reminder: str | None = None
    boxes: tuple[Box, ...] = ()
    notes: tuple[str, ...] = ()


# Shares of the height at the top and the bottom of a screen where panels, menu bars and task bars
# are.
TOP_BAR = 0.03
BOTTOM_BAR = 0.05


def between_bars(size: Size) -> tuple[int, int]:
    """Return the rows (first, end) of a screen between its bars."""
    return int(TOP_BAR * size[0]), size[0] - int(BOTTOM_BAR * size[0])


# The role of a button in a window list, and the separator between the names of a window and of its
# application.
BUTTON = "toggle-button"
DASH = " - "


def window_buttons(desktop: Asset) -> list[AssetTarget]:
    """Return the buttons of the windows in the panel of a recorded desktop."""
    return [target for target in desktop.targets if target.role == BUTTON and DASH in target.name]


class Edit(ABC):
    """Shows one kind of effect in a recording.

    Class attributes:
        kind: the kind of the effect, as in plans.
        event: what happened, one plain sentence; `{}` is filled in for each picture.
        answer: the action of the row.
        inserted: whether the row is a step of its own, before the recorded one.
        reminder: what an onlooker should say, or `None`.
        uses_elements: whether the edit uses the positions of the screen's elements.
        version: increased when the same random draws begin to have another result.
    """

    kind: ClassVar[str]
    event: ClassVar[str]
    answer: ClassVar[Answer] = "keep"
    inserted: ClassVar[bool] = False
    reminder: ClassVar[str | None] = None
    uses_elements: ClassVar[bool] = False
    version: ClassVar[int] = 1

    @abstractmethod
    def apply(self, frame: Frame, effect: Effect) -> EditedStep:
        """Return the step after the event; see `make_step`.

        Args:
            frame: the step at which the event happens.
            effect: an effect of the plan, of this edit's kind.

        Raises:
            NotApplicable: the event cannot be shown realistically at this step.
        """

    def assumed_apps(self, pack: AssetPack, stream: Stream) -> Iterator[tuple[str, ...]]:
        """Yield applications to assume for a screenshot whose applications are unknown.

        The edit is tried with each of them in turn.
        """
        yield ()

    def make_step(
        self,
        *,
        ops: Sequence[Op],
        fidelity: Fidelity,
        response: RecordedAction | None = None,
        boxes: Sequence[Box] = (),
        notes: Sequence[str] = (),
        detail: str = "",
    ) -> EditedStep:
        """Return a step of this event.

        Args:
            ops: what is pasted.
            fidelity: see `EditedStep`.
            response: what undoes the event, for the answer `"undo"`.
            boxes: what can be clicked.
            notes: remarks for the reader of the plan.
            detail: the text for `{}` in `event`.
        """
        return EditedStep(
            ops=tuple(ops),
            event=self.event.format(detail),
            fidelity=fidelity,
            response=WAIT if self.answer == "wait" else response,
            inserted=self.inserted,
            reminder=self.reminder,
            boxes=tuple(boxes),
            notes=tuple(notes),
        )


def recorded_apps(
    pack: AssetPack, kinds: Sequence[str], stream: Stream
) -> Iterator[tuple[str, ...]]:
    """Yield the applications of the pack's pictures of these kinds, one at a time, at random."""
    names = sorted({asset.app for kind in kinds for asset in pack.pictures(kind)})
    while names:
        yield (names.pop(stream.integer(0, len(names) - 1)),)


def name_programs(apps: frozenset[str]) -> str:
    """Return the remedy for a recording that names a kind of application; `""` if it names none."""
    kinds = sorted(apps & KINDS.keys())
    if not kinds:
        return ""
    return f"; {', '.join(kinds)} may be any such program: name it in agenthijack.yaml"


def check_each_once(plan: Plan) -> None:
    """Check that a plan has each kind of effect and of input fault at most once.

    Raises:
        BuildError: it has one twice; an episode refuses that, too.
    """
    for kinds in ([effect.kind for effect in plan.effects], [f.fault for f in plan.inputs]):
        twice = next((kind for kind in kinds if kinds.count(kind) > 1), None)
        if twice is not None:
            raise BuildError(
                f"{plan.corruption} plans {twice!r} twice at one step; give the parts different"
                " steps, or leave one out"
            )
