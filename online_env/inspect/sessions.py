"""Episodes of a benchmark as samples of Inspect: each has a desktop of its own.

Desktops are kept out of Inspect's store, whose content is logged. Whatever blocks runs in a thread.
"""

import base64
import threading
from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from typing import Any

import anyio
import anyio.to_thread
import numpy as np
from PIL import Image

from hijack_data.actions.agent_actions import ACTION_WORDS
from hijack_data.coords import CoordMap
from hijack_data.errors import HijackError
from hijack_data.png import encode
from hijack_data.types import Size, UInt8Array

from ..agents.adapters.action_codes import unreadable_action
from ..bench.config import Bench
from ..bench.workers import open_stage
from ..environment import CorruptedEnv
from ..errors import DesktopError

_POLL_S = 0.1  # s between two looks for a free desktop


class Session:
    """One episode, on a desktop that ends with it.

    Args:
        bench: The benchmark.
        model: The model's name, for the record.
        display_size: (height, width) in which the model is shown every picture; `None` leaves them.
    """

    def __init__(self, bench: Bench, model: str, display_size: Size | None) -> None:
        self._bench = bench
        self._model = model
        self._display_size = display_size
        self._stack = ExitStack()
        self._env: CorruptedEnv | None = None
        self._obs: dict[str, Any] = {}

    @property
    def record(self) -> dict[str, Any] | None:
        """What really happened; `None` until the episode is over."""
        return None if self._env is None else self._env.record

    @property
    def instruction(self) -> str:
        """What the model is asked to do."""
        return self._obs["instruction"]

    @property
    def size(self) -> Size:
        """(height, width) of the picture that the model sees."""
        height, width = self._obs["screenshot"].shape[:2]
        return self._display_size or (height, width)

    def begin(self, task: str, label: str, seed: int) -> None:
        """Start a desktop and the episode.

        If the desktop fails then, the episode is over and `record` says so. What
        refuses the episode raises its own error.

        Args:
            task: The name of a task.
            label: The label of a corruption of the benchmark.
            seed: Decides the task's variant and the corruption's draws.

        Raises:
            DesktopError: The desktop failed before there was a record.
        """
        bench = self._bench
        stage = self._stack.enter_context(open_stage(bench, None))
        env = CorruptedEnv(stage, settings=bench.settings(self._model))
        self._stack.callback(env.close)
        self._env = env
        options = {"task": task, "corruption": bench.planners[label], "label": label}
        try:
            self._obs, _ = env.reset(seed=seed, options=options)
        except DesktopError:
            if env.record is None:
                raise
        env.declare_privileged_inputs(())  # a model of Inspect's sees instruction and pictures

    def act(self, code: str) -> None:
        """Take an action, in pixels of the picture that the model sees; one step."""
        env = self._require_env()
        self._obs, *_ = env.step(self._map_code(code))

    def record_message(self, said: str) -> None:
        """Log the model's words with its next action."""
        self._require_env().record_message(said)

    def cut_off(self, why: str) -> None:
        """End an episode that a limit of Inspect's ended; it is judged as it stands."""
        env = self._require_env()
        env.truncate()
        if env.record is None:  # it took no action
            env.abandon(why)

    def picture(self, region: tuple[int, int, int, int] | None = None) -> str:
        """Return the picture, or a region of it in the same size, as a data address (PNG).

        Args:
            region: left, top, right, bottom in pixels of the picture that the model sees.
        """
        picture: UInt8Array = self._obs["screenshot"]
        if region is not None:
            picture = _zoom(picture, region, self.size)
        if picture.shape[:2] != self.size:
            picture = _resize(picture, self.size)
        text = base64.b64encode(encode(picture)).decode("ascii")
        return f"data:image/png;base64,{text}"

    def close(self) -> None:
        """End the episode and the desktop; calling it again does nothing."""
        self._stack.close()

    def _require_env(self) -> CorruptedEnv:
        if self._env is None:
            raise HijackError("the episode has not begun: call begin first")
        return self._env

    def _map_code(self, code: str) -> str:
        """Return code in pixels of the observation; what cannot be mapped, as what is refused."""
        height, width = self._obs["screenshot"].shape[:2]
        coords = CoordMap(self.size, (height, width))
        if coords.is_identity or code in ACTION_WORDS:
            return code
        try:
            return coords.code_to_screen(code)
        except HijackError as error:
            return unreadable_action(error)


def _resize(picture: UInt8Array, size: Size) -> UInt8Array:
    height, width = size
    image = Image.fromarray(picture).resize((width, height), Image.Resampling.LANCZOS)
    return np.asarray(image)


def _zoom(picture: UInt8Array, region: tuple[int, int, int, int], size: Size) -> UInt8Array:
    """Return a region, given in pixels of `size`, enlarged as far as it fits into `size`.

    Raises:
        HijackError: The region shows nothing of the screen.
    """
    height, width = picture.shape[:2]
    [(left, top, right, bottom)] = CoordMap(size, (height, width)).boxes_to_screen([region])
    cut = picture[top:bottom, left:right]
    if not cut.size:
        raise HijackError(f"the region {list(region)} shows nothing of the screen")
    scale = min(size[0] / cut.shape[0], size[1] / cut.shape[1])
    room = np.zeros((*size, 3), np.uint8)
    inner = (max(1, int(cut.shape[0] * scale)), max(1, int(cut.shape[1] * scale)))
    room[: inner[0], : inner[1]] = _resize(cut, inner)
    return room


class Sessions:
    """The episodes that are under way, by the samples' ids, at most so many at a time.

    Args:
        max_desktops: How many desktops there are at a time.
    """

    def __init__(self, max_desktops: int) -> None:
        self._free_desktops = threading.Semaphore(max_desktops)
        self._by_sample: dict[str, Session] = {}

    def __getitem__(self, sample: str) -> Session:
        return self._by_sample[sample]

    async def open(self, sample: str, session: Session, begin: Callable[[], None]) -> None:
        """Wait for a free desktop, and begin an episode in a thread."""
        while not self._free_desktops.acquire(blocking=False):
            await anyio.sleep(_POLL_S)
        self._by_sample[sample] = session
        try:
            await in_thread(begin)
        except BaseException:
            with anyio.CancelScope(shield=True):
                await self.close(sample)
            raise

    async def close(self, sample: str) -> None:
        """End the episode of a sample, if it has one."""
        session = self._by_sample.pop(sample, None)
        if session is None:
            return
        try:
            await in_thread(session.close)
        finally:
            self._free_desktops.release()


def in_thread(function: Callable[..., Any], *values: Any) -> Awaitable[Any]:
    """Call what blocks in a thread."""
    return anyio.to_thread.run_sync(function, *values)
