"""Serve `desktop_env.DesktopEnv` to the controlling process: one call a line, one answer a line."""

import base64
import contextlib
import importlib
import logging
import os
import pkgutil
import sys
import tempfile
from typing import Any

from . import additions, package_needs, stubs
from .channel import Channel, Message
from .execution import execute_once
from .outcome import OutcomeHandler
from .provider import Manager, Provider, send_tokens
from .unanswered import UnansweredRequests

PROVIDERS = "desktop_env.providers"
CALLS = ("start", "check", "check_provider", "reset", "step", "evaluate", "controller")
# What the controlling process may call on the guest's controller.
CODE = "execute_python_command"
CONTROLLER = ("get_screenshot", "get_accessibility_tree", "get_file", CODE)


class Worker:
    """One `DesktopEnv` on one guest at a time."""

    env: Any = None

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self.used = False
        self.owns_machine = False
        self.absent = frozenset[str]()
        self.added: list[str] = []

    def start(self, settings: Message) -> Message:
        """Import `desktop_env` and make the environment; returns what is absent and what was added.

        `settings`: `address` (host, ports, token), `cache` (folder), `screen` ([width, height]),
        `tree` (whether observations hold the accessibility tree), `password` (of the guest's user).
        Instead of `address`, `provider` names one of OSWorld's own providers. `options` are more
        arguments of `DesktopEnv`. With neither, nothing but `check` can be called.
        """
        with tempfile.NamedTemporaryFile("w", suffix=".json") as proxies:
            proxies.write("[]")
            proxies.flush()
            # read at import; without it an error is logged
            if not settings["options"].get("enable_proxy"):
                os.environ["PROXY_CONFIG_FILE"] = proxies.name
            with stubs.standing_in() as self.absent:
                module: Any = importlib.import_module("desktop_env.desktop_env")
        self.metrics, self.getters, self.setup = (
            module.metrics,
            module.getters,
            module.SetupController,
        )
        self.added = additions.add_missing(self.metrics, self.getters)
        arguments: Message = {
            "os_type": "Ubuntu",
            "action_space": "pyautogui",
            "headless": True,
            "cache_dir": settings["cache"],
            "screen_size": tuple(settings["screen"]),
            "require_a11y_tree": bool(settings["tree"]),
            "client_password": settings["password"],
            **settings["options"],
        }
        if settings.get("provider"):
            arguments |= {"provider_name": settings["provider"]}
            additions.complete_manager(settings["provider"])
            if settings["provider"] == "aws":
                _set_image(arguments)
            self.env = module.DesktopEnv(**arguments)
            self.owns_machine = True
            self.used = self.env.is_environment_used
        elif settings.get("address"):
            address = settings["address"]
            provider = Provider(address, lambda: self.channel.ask("revert"))
            module.create_vm_manager_and_provider = lambda *_, **__: (Manager(), provider)
            send_tokens()
            # Of the names that DesktopEnv accepts, "docker" is one whose machine is clean at first.
            arguments |= {"provider_name": "docker", "path_to_vm": "agenthijack"}
            self.env = module.DesktopEnv(**arguments)
            self.used = bool(address.get("used"))
        return {
            "absent": sorted(self.absent),
            "added": self.added,
            "python": sys.version.split()[0],
        }

    def check_provider(self, name: str) -> str:
        """Why one of OSWorld's own providers can't be used here; empty where it can.

        No machine is started. Providers check their packages and settings when they are made.
        """
        names = sorted(
            part.name
            for part in pkgutil.iter_modules(importlib.import_module(PROVIDERS).__path__)
            if part.ispkg
        )
        if name not in names:
            return f"this desktop_env has no provider {name!r}, only: {', '.join(names)}"
        try:
            with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
                additions.complete_manager(name)
                importlib.import_module(PROVIDERS).create_vm_manager_and_provider(name, None)
        except Exception as error:  # noqa: BLE001  (they raise what they like)
            return f"{type(error).__name__}: {error}"
        return ""

    def release(self) -> None:
        """End the machine that one of OSWorld's own providers started, however the call ends."""
        if self.owns_machine and self.env is not None:
            self.owns_machine = False
            self.env.close()

    def check(self, task: Message) -> list[str]:
        """Why the task can't be evaluated in this environment; empty where it can."""
        return package_needs.problems(task, self.metrics, self.getters, self.setup)

    def reset(self, task: Message | None, keep: bool = False) -> Message:
        """OSWorld's reset, on a pristine desktop; the observation, pictures in base64.

        `keep`: on the desktop as it is, because something was done to the pristine one.
        """
        self.env.is_environment_used = self.used and not keep
        self.used = True
        return _portable(self.env.reset(task_config=task))

    def step(self, action: Any, pause: float) -> list[Any]:
        """OSWorld's step: `[observation, reward, done, info]`."""
        observation, reward, done, info = self.env.step(action, pause)
        return [_portable(observation), reward, done, info]

    def evaluate(self) -> float:
        """OSWorld's evaluate: the score; an error if the guest left a request without an answer."""
        with UnansweredRequests(self.env.controller.http_server) as requests:
            score = float(self.env.evaluate())
        requests.check(score)
        return score

    def controller(self, method: str, arguments: list[Any]) -> Any:
        """One of the calls in `CONTROLLER`; bytes come back in base64.

        Raises:
            ValueError: The method is not in `CONTROLLER`.
        """
        if method not in CONTROLLER:
            raise ValueError(f"controller call {method!r} is not one of {', '.join(CONTROLLER)}")
        if method == CODE:
            # Only code can change the machine, and a revert takes a provider up to minutes.
            self.used = True
            return execute_once(self.env.controller, *arguments)
        return _portable(getattr(self.env.controller, method)(*arguments))


def _set_image(arguments: Message) -> None:
    """Name Amazon's image of OSWorld's machine as the snapshot that a revert starts from.

    `DesktopEnv` itself would ask Amazon for an image called "init_state".
    """
    images = importlib.import_module(f"{PROVIDERS}.aws.manager").IMAGE_ID_MAP
    region = arguments.setdefault("region", os.environ["AWS_REGION"])
    image = images.get(region, {}).get(arguments["screen_size"])
    if image:  # else the provider names the regions and sizes that there are
        arguments.setdefault("snapshot_name", image)


def _portable(value: Any) -> Any:
    if isinstance(value, bytes):
        return {"base64": base64.b64encode(value).decode("ascii")}
    if isinstance(value, dict):
        return {key: _portable(item) for key, item in value.items()}
    return value


def main() -> None:
    """Serve until the controlling process closes its end."""
    channel = Channel()
    logging.basicConfig(
        stream=sys.stderr,
        level=logging.INFO,
        format="%(asctime)s %(levelname)s %(name)s %(message)s",
    )
    worker = Worker(channel)
    calls = {name: getattr(worker, name) for name in CALLS}
    try:
        while (request := channel.receive()) is not None:
            with OutcomeHandler() as outcome:
                outcome.value = calls[request["call"]](*request.get("arguments", []))
            channel.send({**outcome.message(), "number": request["number"]})
    finally:  # also where the controlling process was killed: a machine may cost money
        worker.release()
