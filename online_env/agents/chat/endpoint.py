"""One model behind an API: asked with retries, counted and logged."""

import json
import os
import time
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hijack_data import extras
from hijack_data.errors import short_repr

from ...errors import AgentSetupError, EndpointError
from ..settings import ModelSettings, bad_key, can_be_sent
from .query import ModelQuery, Reply, logged, request_digest, wired
from .request_log import RequestRecorder, logged_response
from .usage import UsageMeter
from .wires import ModelWire, make_wire
from .wires.common import EXTRA, RETRIES

_RETRY_STATUSES = frozenset(
    {408, 409, 425, 429}
)  # statuses below 500 after which a request may succeed
_BOM = "\ufeff"
_MAX_MESSAGE_CHARS = 500  # characters kept of an endpoint's message about a failure


@dataclass(frozen=True, kw_only=True)
class RetryWaits:
    """How long to wait before a request is sent again.

    Args:
        first: s before the second try; it doubles after each try, with a random part.
        longest: the longest wait in s, even if the endpoint asks for more.
    """

    first: float = 1.0
    longest: float = 60.0


class Endpoint:
    """Asks one model.

    Args:
        settings: the model.
        meter: counts the usage.
        recorder: the log of the episode, or its replay.
        waits: between tries.
        offline: whether nothing is ever sent, so that no key is needed.

    Raises:
        AgentSetupError: the key is not in the environment.
    """

    def __init__(
        self,
        settings: ModelSettings,
        meter: UsageMeter,
        recorder: RequestRecorder,
        waits: RetryWaits,
        offline: bool = False,
    ) -> None:
        self._settings = settings
        self._meter = meter
        self._recorder = recorder
        self._waits = waits
        self._wire: ModelWire = make_wire(settings.client)
        self._key = "" if offline else _read_key(settings)
        self._client: Any = None
        self._close_client: weakref.finalize[Any, Any] | None = None

    def ask(self, query: ModelQuery, role: str) -> Reply:
        """Return what the model answers.

        Args:
            query: the question.
            role: the purpose of the question, for the log.

        Raises:
            EndpointError: there is no answer, after all tries.
            ReplayError: the run is replayed, and its log lacks the request.
        """
        body = self._wire.body(query, self._settings)
        step = self._meter.step
        line = self._recorder.recall(step, role, body)
        if line is None:
            line = self._send(step, role, body)
            self._recorder.note(line)
        reply = self._wire.read(logged_response(line))
        self._meter.add(
            reply.input_tokens,
            reply.output_tokens,
            self._settings.prices,
            line["seconds"],
            line["tries"],
        )
        return reply

    def close(self) -> None:
        """Close its connections; the next request opens new ones."""
        if self._close_client is not None:
            self._close_client()
        self._client = None
        self._close_client = None

    def _connect(self) -> Any:
        """Return the client, whose connections are closed when this object is garbage-collected."""
        if self._client is None:
            self._client = self._wire.connect(self._settings, self._key)
            self._close_client = weakref.finalize(self, self._client.close)
        return self._client

    def _send(self, step: int, role: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Send a request, and return its line of the log."""
        line: dict[str, Any] = {
            "step": step,
            "role": role,
            "sha256": request_digest(body),
            "request": logged(body),
        }
        start = time.monotonic()
        tries = 0
        try:
            for attempt in self._tries():
                with attempt:
                    tries = attempt.retry_state.attempt_number
                    line["response"] = self._send_once(wired(body))
        except EndpointError as error:
            times = f" (tried {tries} times)" if tries > 1 else ""
            line["problem"] = f"{error}{times}"
        line["seconds"] = round(time.monotonic() - start, 4)
        line["tries"] = tries
        return line

    def _tries(self) -> Any:
        tenacity = extras.load(RETRIES, "a model's endpoint", EXTRA)
        return tenacity.Retrying(
            stop=tenacity.stop_after_attempt(self._settings.retries + 1),
            retry=tenacity.retry_if_exception(_is_transient),
            wait=self._wait,
            reraise=True,
        )

    def _wait(self, state: Any) -> float:
        """Return how long to wait: what the endpoint asks for, or longer each time."""
        tenacity = extras.load(RETRIES, "a model's endpoint", EXTRA)
        longest = self._waits.longest
        first = self._waits.first
        growing = tenacity.wait_exponential(multiplier=first) + tenacity.wait_random(0, first)
        requested = state.outcome.exception().retry_after
        return min(longest, growing(state) if requested is None else requested)

    def _send_once(self, body: Mapping[str, Any]) -> Mapping[str, Any]:
        """Send a request once.

        Raises:
            EndpointError: the request failed; `transient` tells whether to try again.
        """
        client = self._connect()
        try:
            text = self._wire.send(client, body)
        # The clients raise their own exceptions and those of lower layers; without `from None`
        # their texts, and so perhaps the key, would be in a traceback.
        except Exception as error:  # noqa: BLE001
            raise self._explain(error) from None
        text = self._redact_key(text)
        try:
            answer = json.loads(text.removeprefix(_BOM), parse_constant=lambda _: None)
        except (ValueError, RecursionError) as error:
            raise EndpointError(
                f"{self._settings.location}: the answer is not whole JSON ({error}):"
                f" {short_repr(text[-80:])}",
                transient=True,
            ) from None
        if not isinstance(answer, dict):
            raise EndpointError(
                f"{self._settings.location}: the answer is no JSON object: {short_repr(answer)}",
                transient=True,
            )
        self._wire.read(answer)  # an answer that cannot be read is requested again
        return answer

    def _explain(self, error: Exception) -> EndpointError:
        """Convert an exception of a client to an `EndpointError`, without the key in its text."""
        status = getattr(error, "status_code", None)
        message = self._redact_key(f"{type(error).__name__}: {error}")
        problem = f"{self._settings.location}: {message[:_MAX_MESSAGE_CHARS]}"
        if status in (401, 403):
            source = self._settings.api_key_env
            advice = f"check the key in {source}" if source else "name its key by api_key_env"
            return EndpointError(f"{problem}; {advice}")
        if isinstance(status, int):
            passes = status in _RETRY_STATUSES or status >= 500
            return EndpointError(problem, passes, _retry_after(error))
        is_lost = "Connection" in type(error).__name__ or "Timeout" in type(error).__name__
        return EndpointError(problem, transient=is_lost)

    def _redact_key(self, text: str) -> str:
        """Return a text that came from outside without the key, however JSON may escape it."""
        if not self._key:
            return text
        escaped = json.dumps(self._key)[1:-1]
        for form in (self._key, escaped, escaped.replace("/", "\\/")):
            text = text.replace(form, "[key]")
        return text


def _is_transient(error: BaseException) -> bool:
    return isinstance(error, EndpointError) and error.transient


def _retry_after(error: Exception) -> float | None:
    """Return the seconds that an endpoint asks to wait, or `None`."""
    response = getattr(error, "response", None)
    headers = getattr(response, "headers", {})
    try:
        return max(0.0, float(headers.get("retry-after", "")))
    except ValueError:
        return None


def _read_key(settings: ModelSettings) -> str:
    """Return the key from the environment; empty if the endpoint wants none.

    Raises:
        AgentSetupError: the key is not in the environment, or cannot be sent.
    """
    name = settings.api_key_env
    if name is None:
        return ""
    key = os.environ.get(name, "")
    if not key:
        raise AgentSetupError(
            f"{settings.model} needs a key, and the environment variable {name} is not set"
        )
    if not can_be_sent(key):
        raise AgentSetupError(f"{settings.model}: {bad_key(name)}")
    return key
