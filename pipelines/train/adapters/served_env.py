"""A desktop behind `hijack serve` as a gymnasium environment, for trainers on other machines.

Server and trainer agree on a corruption by its label. The server reports the parameters of that
label, and an episode whose parameters differ from the trainer's is refused.
"""

import base64
import io
import itertools
import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from PIL import Image

from hijack_data import extras
from hijack_data.errors import ParameterError
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.spaces import Actions, observations

from ..errors import TrainError

TOKEN_VARIABLE = "AGENTHIJACK_SERVE_TOKEN"
ANSWER_TIMEOUT_S = 300.0  # s for an answer, since a reset may queue for a desktop
_DONE = "DONE"
_numbers = itertools.count(os.getpid())  # processes begin with different servers


class ServedEnv(gymnasium.Env[dict[str, Any], str]):
    """A session with a server of `hijack serve`, with the interface of `CorruptedEnv`.

    An observation is `{"screenshot": uint8 RGB [H, W, 3], "instruction": str}`, an action text as
    `CorruptedEnv` takes it. The connection is made with the first `reset`, and again after a failed
    one.

    Args:
        addresses: of the servers, such as `"http://node-1:8000"`; all must have been started with
            the same options.
        number: takes `addresses[number % len(addresses)]`; counted in this process if omitted.
        size: `(height, width)` of the servers' desktops, for `observation_space`.
        token_variable: the environment variable with the servers' token, if they have one.
        timeout: seconds for one answer, above 0.

    Raises:
        ParameterError: there is no address, or `timeout` is not above 0.
        ImportError: OpenEnv's client is missing; the message says how to install it.
    """

    def __init__(
        self,
        addresses: str | Sequence[str],
        *,
        number: int | None = None,
        size: tuple[int, int] = (1080, 1920),
        token_variable: str = TOKEN_VARIABLE,
        timeout: float = ANSWER_TIMEOUT_S,
    ) -> None:
        servers = [addresses] if isinstance(addresses, str) else list(addresses)
        if not servers:
            raise ParameterError("addresses: name at least one server, such as http://node-1:8000")
        if not timeout > 0:
            raise ParameterError(f"timeout is in seconds and above 0, got {timeout:g}")
        self._client_type = _client_type()
        self.address = servers[(next(_numbers) if number is None else number) % len(servers)]
        self.record: Mapping[str, Any] | None = None
        self.observation_space = observations(size)
        self.action_space = Actions(size)
        self._token_variable = token_variable
        self._patience = timeout
        self._client: Any = None
        self._last: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: decides the task's variant and the corruption's draws; the server draws a seed if
                it is omitted.
            options: `task`, `corruption` (a planner, or `None` for a clean episode) and `label`,
                by which the server knows the corruption. Without `corruption` the server draws one.

        Raises:
            TrainError: the server plays the corruption with other parameters, refuses the episode,
                or cannot be reached.
        """
        super().reset(seed=seed)
        choices = dict(options or {})
        request: dict[str, Any] = {"seed": seed, "task": choices.get("task")}
        planner: Planner | None = choices.get("corruption")
        if "corruption" in choices:
            request["corruption"] = (
                CLEAN if planner is None else choices.get("label", planner.label)
            )
        self.record = None
        arguments = {key: value for key, value in request.items() if value is not None}
        result = self._call("reset", lambda client: client.reset(**arguments))
        if "corruption" in choices:
            self._check_planner(planner, request["corruption"])
        return self._read_observation(result), {}

    def step(self, action: str) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Take an action; once the episode is over, every further step is truncated.

        Raises:
            TrainError: the server refuses the action, or cannot be reached; or no episode is under
                way, because there was no reset, or the last one or a step of it failed.
        """
        if self.record is not None:
            return dict(self._last), 0.0, False, True, {}
        if self._client is None:
            raise TrainError(f"{self.address}: no episode is under way: call reset first")
        result = self._call("step", lambda client: client.step({"action": action}))
        observation = self._read_observation(result)
        truncated = bool(result.observation.get("truncated"))
        score = float(result.reward or 0.0)
        return observation, score, bool(result.done) and not truncated, truncated, {}

    def truncate(self) -> None:
        """Have the episode judged in its present state.

        Raises:
            TrainError: the server cannot be reached.
        """
        self.step(_DONE)

    def close(self) -> None:
        """Disconnect from the server, which frees the desktop; closing twice is allowed."""
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def _call(self, call: str, ask: Any) -> Any:
        try:
            if self._client is None:
                self._client = self._connect()
            return ask(self._client)
        except Exception as error:  # the client passes on the exceptions of lower layers
            self._drop()
            raise TrainError(f"{self.address}: {call}: {type(error).__name__}: {error}") from error

    def _connect(self) -> Any:
        token = os.environ.get(self._token_variable)
        client = self._client_type(
            base_url=self.address,
            message_timeout_s=self._patience,
            headers={"Authorization": f"Bearer {token}"} if token else None,
        ).sync()
        client.connect()
        return client

    def _drop(self) -> None:
        """Drop a connection whose state is unknown."""
        try:
            self.close()
        except Exception:  # noqa: BLE001  (the connection was broken already)
            return

    def _check_planner(self, planner: Planner | None, label: str) -> None:
        """Check that the server plays the requested corruption.

        Raises:
            TrainError: the server plays the label with other parameters.
        """
        config = None if planner is None else json.loads(json.dumps(planner.to_config()))
        served = self._call("state", lambda client: client.state()).get("planner")
        if served == config:
            return
        self._drop()
        raise TrainError(
            f"{self.address}: plays {label} as {served}, and the trainer wants {config}: start the"
            " server with the trainer's corruptions"
        )

    def _read_observation(self, result: Any) -> dict[str, Any]:
        """Return the observation; keep the record of an episode that is over."""
        observation = result.observation
        picture = Image.open(io.BytesIO(base64.b64decode(observation["screenshot"])))
        self._last = {
            "screenshot": np.asarray(picture.convert("RGB")),
            "instruction": observation["instruction"],
        }
        if result.done:
            self.record = self._call("state", lambda client: client.state()).get("record") or {}
        return dict(self._last)


def _client_type() -> Any:
    return extras.load("openenv.core.generic_client", "ServedEnv", "serve").GenericEnvClient
