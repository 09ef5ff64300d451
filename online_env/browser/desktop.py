"""`BrowserDesktop`: a browser with the `Desktop` protocol, whose screen is the page in front."""

import base64
import contextlib
import io
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar, NoReturn

import numpy as np
from PIL import Image

from hijack_data.actions.pyautogui_functions import LIVE_FUNCTIONS
from hijack_data.actions.pyautogui_grammar import read_calls
from hijack_data.actions.python_source import ParsedSource
from hijack_data.errors import ActionError
from hijack_data.types import Size, UInt8Array

from ..desktops.protocol import Capability, RunResult, TaskConfig
from ..effects.base import LiveEffect
from ..environment.settle import Settle
from ..errors import DesktopError, MissingCapabilityError
from .devtools import DevToolsError
from .effects import BROWSER_EFFECTS
from .page_layer import SCRIPT, PageLayer
from .page_tree import page_tree
from .session import DOCUMENT_CHANGE_S, BrowserPage, BrowserSession

# Done once the page has done what the action set off, such as to begin to load another page.
_TURN = "new Promise(done => setTimeout(done, 0))"


class BrowserDesktop(BrowserSession):
    """A browser as a desktop; make one by `up`."""

    settle = Settle(quiet=0.06, cap=3.0, look=0.02)  # no program draws behind the browser's back
    effects: Mapping[str, LiveEffect] = BROWSER_EFFECTS
    world_scripts: ClassVar[tuple[str, ...]] = (SCRIPT,)

    @cached_property
    def page_layer(self) -> PageLayer:
        """What draws plans into the page in front, for `EvalSettings.layer`."""
        return PageLayer(self)

    @classmethod
    def up(
        cls, size: Size = (720, 960), scale: int = 1, arguments: tuple[str, ...] = ()
    ) -> "BrowserDesktop":
        """Start a browser; the arguments are those of the class."""
        return cls(size, scale, arguments)

    def __enter__(self) -> "BrowserDesktop":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Everything but files: a browser has no file system."""
        return frozenset({"firewall", "lock", "windows", "apps", "accessibility"})

    def screenshot(self) -> UInt8Array:
        """The page in front, without a pointer: uint8 RGB `[H, W, 3]`.

        Raises:
            DesktopError: The page does not answer.
        """
        self.wait_until_loaded()
        data = self._ask(self._capture)
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))
        if picture.shape[:2] != self.size:
            raise DesktopError(
                f"the browser gave a picture of {picture.shape[1]}x{picture.shape[0]} pixels, its"
                f" screen has {self.size[1]}x{self.size[0]}"
            )
        return picture

    def _capture(self, page: BrowserPage) -> str:
        """The picture of a page as PNG in base64."""
        params = {"format": "png", "optimizeForSpeed": True, "captureBeyondViewport": False}
        try:
            return self.call("Page.captureScreenshot", page, **params)["data"]
        except DevToolsError:  # between two documents
            time.sleep(DOCUMENT_CHANGE_S)
            self.wait_until_loaded()
            return self.call("Page.captureScreenshot", page, **params)["data"]

    def accessibility(self) -> str:
        """The accessibility tree of the page in front, in OSWorld's XML dialect."""
        self.wait_until_loaded()
        return self._ask(lambda page: self.read_tree(page, self.scale))

    def read_tree(self, page: BrowserPage, scale: float) -> str:
        """The accessibility tree of a page, with `scale` pixels for each CSS pixel."""
        nodes: list[Mapping[str, Any]] = []
        for frame in self.frame_ids(page):
            nodes += self.call("Accessibility.getFullAXTree", page, frameId=frame)["nodes"]
        snapshot = self.call("DOMSnapshot.captureSnapshot", page, computedStyles=["visibility"])
        view = self.call("Page.getLayoutMetrics", page)["cssVisualViewport"]
        view_size = view["clientHeight"], view["clientWidth"]
        return page_tree(snapshot, nodes, self.title(page), scale, view_size)

    def run(self, code: str) -> RunResult:
        """Carry out pyautogui calls as input events; the code is read, and never run."""
        self.acted = True
        try:
            for call in read_calls(ParsedSource(code.strip()), LIVE_FUNCTIONS):
                self.input.perform(call)
        except ActionError as error:
            return RunResult("error", error=str(error), returncode=1)
        self.examine(_TURN)
        self.wait_until_loaded()
        self.task_is_over()
        notices, self.notices = self.notices, []
        return RunResult("success", "".join(f"{notice}\n" for notice in notices), returncode=0)

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Refuse: a browser runs no programs.

        Raises:
            MissingCapabilityError: Always.
        """
        _refuse("run a program")

    def read_file(self, path: str) -> bytes:
        """Refuse: a browser has no files.

        Raises:
            MissingCapabilityError: Always.
        """
        _refuse(f"read {path}")

    def write_file(self, path: str, data: bytes) -> None:
        """Refuse: a browser has no files.

        Raises:
            MissingCapabilityError: Always.
        """
        _refuse(f"write {path}")

    def reset(self, task: TaskConfig | None = None) -> None:
        """Begin with a fresh profile.

        Args:
            task: `url` and `scripts`, as in `begin`; `None` opens an empty page.

        Raises:
            DesktopError: The page does not load.
        """
        config = task or {}
        self.begin(str(config.get("url", "")), tuple(config.get("scripts", ())))


def _refuse(operation: str) -> NoReturn:
    raise MissingCapabilityError(
        f"a browser cannot {operation}: it is no desktop with programs and files"
    )


@contextlib.contextmanager
def browser(size: Size) -> Iterator[BrowserDesktop]:
    """Yield a browser: the provider `browser` of benchmarks."""
    with BrowserDesktop.up(size) as desktop:
        yield desktop
