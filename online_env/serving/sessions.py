"""A client's session: episodes, one after the other, each on a lent desktop.

OpenEnv's interface to it is in `openenv_env`; this module does not depend on OpenEnv.
"""

import threading
from dataclasses import dataclass, replace
from typing import Any

from hijack_data.errors import HijackError
from hijack_data.types import Size, UInt8Array

from ..agents.adapters.action_codes import PYAUTOGUI, read_action_codes
from ..environment import CorruptedEnv
from ..errors import DesktopError, MissingCapabilityError
from .drawing import EpisodeChoice
from .errors import DesktopLostError, LeaseExpiredError, ServerBusyError
from .service import DesktopLease, DesktopService

TRIES = 2  # the most desktops that a reset tries


@dataclass(frozen=True, kw_only=True)
class SessionView:
    """The result of a reset or a step for the client.

    Args:
        picture: uint8 RGB `[H, W, 3]`.
        instruction: The instruction of the agent.
        reward: The score at the end, 0 before it; `None` after a reset, and if the episode does
            not count.
        done: Whether the episode is over.
        truncated: Whether a limit or a failure ended it.
        status: At the end: `ok`, `invalid` or `error`.
        problem: Why the status is not `ok`.
    """

    picture: UInt8Array
    instruction: str
    reward: float | None = None
    done: bool = False
    truncated: bool = False
    status: str = ""
    problem: str = ""

    @property
    def size(self) -> Size:
        """(height, width) of the picture."""
        height, width = self.picture.shape[:2]
        return height, width


class DesktopSession:
    """The session of one client. Making one is cheap: only `reset` borrows a desktop.

    Args:
        service: What the sessions of a server share.
    """

    def __init__(self, service: DesktopService) -> None:
        self._service = service
        self._number = 0
        self._lease: DesktopLease | None = None
        self._view: SessionView | None = None
        self._closed = False
        self._lock = threading.Lock()
        self.choice: EpisodeChoice | None = None
        self.record: dict[str, Any] | None = None
        self.steps = 0

    def reset(
        self,
        *,
        seed: object = None,
        task: object = None,
        corruption: object = None,
        slot: object = None,
    ) -> SessionView:
        """Begin an episode; see `EpisodeDraws.choose` for the arguments.

        If a desktop fails, another one is tried.

        Raises:
            HijackError: The request is refused, no desktop is free, or none can play it.
        """
        self._check_open()
        if not self._number:
            self._number = self._service.new_session()
            self._service.metrics.sessions.inc()
        metrics = self._service.metrics
        try:
            with metrics.resetting():
                view = self._reset(seed, task, corruption, slot)
        except ServerBusyError:
            metrics.resets.labels("busy").inc()
            raise
        except DesktopError:
            metrics.resets.labels("failed").inc()
            raise
        except HijackError:
            metrics.resets.labels("refused").inc()
            raise
        metrics.resets.labels("ok").inc()
        return view

    def step(self, action: object, dialect: str = PYAUTOGUI) -> SessionView:
        """Take an action; an unreadable one is a malformed step, and the episode continues.

        After the end this returns the last view again, with a reward of 0.

        Args:
            action: pyautogui code, WAIT, DONE or FAIL, or an action of another `dialect`.
            dialect: One of `hijack_data.actions.DIALECTS`.

        Raises:
            HijackError: There was no reset, or the dialect does not exist.
            LeaseExpiredError: The client was silent for too long.
            DesktopLostError: The desktop ended.
        """
        self._check_open()
        lease, view = self._lease, self._view
        if view is None:
            raise HijackError("no episode is under way: call reset first")
        if view.done:
            return replace(view, reward=0.0)
        if lease is None:
            raise HijackError("the last episode is gone: call reset")
        with lease.in_use():
            if lease.ended:
                self._forget()
                raise LeaseExpiredError(
                    f"{lease.ended}, so its desktop was given back (hijack serve --lease"
                    f" {self._service.lease:g}); reset begins another episode"
                )
            with self._service.metrics.stepping():
                return self._step(lease, view, action, dialect)

    def close(self) -> None:
        """End the session and its episode, and return the desktop; may be called again."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        lease = self._lease
        self._forget()
        if lease is not None:
            self._service.break_off(lease, "the client left before the end")

    def _reset(self, seed: object, task: object, corruption: object, slot: object) -> SessionView:
        service = self._service
        choice = service.draws.choose(
            session=self._number or 1, seed=seed, task=task, corruption=corruption, slot=slot
        )
        self._leave()
        for left in reversed(range(TRIES)):
            lease = service.lend()
            self._lease = lease
            with lease.in_use():
                try:
                    self._check_open()  # it may have been closed while this waited in line
                    return self._begin(lease, choice)
                except MissingCapabilityError as error:
                    self._give_up(lease, error, is_broken=False)
                    raise
                except DesktopError as error:
                    self._give_up(lease, error, is_broken=True)
                    if not left:
                        raise
                except BaseException as error:
                    self._give_up(lease, error, is_broken=False)
                    raise
        raise HijackError("no desktop was tried")

    def _begin(self, lease: DesktopLease, choice: EpisodeChoice) -> SessionView:
        service = self._service
        self.choice, self.record, self.steps = choice, None, 0
        env = service.environment(lease, self._number)
        seen, _ = env.reset(seed=choice.seed, options=service.options(choice))
        self._view = SessionView(picture=seen["screenshot"], instruction=seen["instruction"])
        if env.record is not None:
            self._view = self._over(lease, env, self._view)
        return self._view

    def _step(
        self, lease: DesktopLease, view: SessionView, action: object, dialect: str
    ) -> SessionView:
        env = lease.env
        if env is None:
            raise HijackError("no episode is under way: call reset first")
        codes, _ = read_action_codes(action, dialect, view.size)
        try:
            for code in codes:
                if env.record is not None:
                    break
                seen, reward, terminated, truncated, _ = env.step(code)
                view = SessionView(
                    picture=seen["screenshot"],
                    instruction=seen["instruction"],
                    reward=reward,
                    done=terminated or truncated,
                    truncated=truncated,
                )
        except BaseException:
            self.record = env.record
            self._service.end(lease, "the episode failed", is_broken=not lease.seat.is_alive())
            self._forget()
            raise
        self.steps += 1
        if env.record is not None:
            view = self._over(lease, env, view)
        self._view = view
        return view

    def _over(self, lease: DesktopLease, env: CorruptedEnv, view: SessionView) -> SessionView:
        """Give back the desktop of a finished episode.

        Raises:
            DesktopLostError: The episode ended because the desktop did.
        """
        record = env.record or {}
        self.record = record
        status, problem = str(record["status"]), str(record["problem"])
        self._service.metrics.episodes.labels(str(record["corruption"]), status).inc()
        is_broken = status != "ok" and not lease.seat.is_alive()
        self._service.end(lease, "the episode is over", is_broken=is_broken)
        self._lease = None
        if is_broken:
            self._forget()
            raise DesktopLostError(
                f"the desktop ended in mid-episode ({problem}); the episode does not count, and"
                " another desktop is started: reset begins a new episode"
            )
        is_agents = status == "error" and record["cause"] == "agent"
        is_counted = status == "ok" or is_agents
        return replace(
            view,
            reward=float(record["score"] or 0.0) if is_counted else None,
            done=True,
            truncated=view.truncated or status != "ok",
            status=status,
            problem=problem,
        )

    def _leave(self) -> None:
        """Give up the current episode, if there is one."""
        lease = self._lease
        self._forget()
        if lease is not None:
            self._service.break_off(lease, "the client reset before the end")

    def _give_up(self, lease: DesktopLease, error: BaseException, *, is_broken: bool) -> None:
        self._forget()
        if lease.env is not None:
            self.record = lease.env.record
        self._service.end(lease, f"reset failed: {error}", is_broken=is_broken)

    def _forget(self) -> None:
        self._lease = self._view = None

    def _check_open(self) -> None:
        """Check that the session is open.

        Raises:
            HijackError: The session was closed.
        """
        if self._closed:
            raise HijackError("this session was closed; connect again")
