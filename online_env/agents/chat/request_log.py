"""The log of requests and answers, and the replay of a run from it.

`RUN/requests/<episode id>.jsonl` has a line for each request of an episode: `step`, `role`, the
request with pictures as `sha256:...` and its own `sha256`, the `response` as received, or the
`problem` if there was none. Keys are never stored.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from hijack_data.file_io import make_folder, unwritable
from hijack_data.runs.amounts import is_amount, is_count
from hijack_data.runs.run_log import REQUESTS

from ...errors import AgentSetupError, EndpointError, ReplayError
from .query import logged, request_digest

FOLDER = REQUESTS
REDACTED = "[key]"
_REQUIRED_FIELDS = frozenset({"step", "role", "sha256", "request", "seconds", "tries"})


class RequestRecorder(Protocol):
    """The interface that an endpoint consults before it sends a request, and informs afterwards."""

    def recall(self, step: int, role: str, body: Any) -> Mapping[str, Any] | None:
        """Return the logged line of a request, or `None` if it must be sent."""
        ...

    def note(self, line: Mapping[str, Any]) -> None:
        """Store the line of a request that was sent."""
        ...


class NoRecorder:
    """A recorder that stores nothing."""

    def recall(self, step: int, role: str, body: Any) -> Mapping[str, Any] | None:
        """Return `None`, so that every request is sent."""
        return None

    def note(self, line: Mapping[str, Any]) -> None:
        """Do nothing."""


class RequestLog(NoRecorder):
    """Writes the lines of one episode, replacing those of an earlier try.

    Args:
        path: of the file.
        secrets: texts that must never be written, such as keys.
    """

    def __init__(self, path: Path, secrets: tuple[str, ...] = ()) -> None:
        self._path = path
        self._secrets = tuple(secret for secret in secrets if secret)
        make_folder(path.parent, path)
        try:
            path.write_bytes(b"")
        except OSError as error:
            raise unwritable(path, error) from None

    def note(self, line: Mapping[str, Any]) -> None:
        """Write a line.

        Raises:
            unwritable: The file cannot be written.
        """
        text = json.dumps(dict(line), ensure_ascii=False)
        for secret in self._secrets:
            text = text.replace(json.dumps(secret)[1:-1], REDACTED)
        try:
            with self._path.open("ab") as file:
                file.write(text.encode("utf-8", "backslashreplace") + b"\n")
        except OSError as error:
            raise unwritable(self._path, error) from None


class RequestReplay(NoRecorder):
    """Answers the requests of one episode from the log of a run.

    Args:
        path: of the file that a `RequestLog` wrote.

    Raises:
        ReplayError: there is no such file, or it is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._remaining = _lines(path)

    def recall(self, step: int, role: str, body: Any) -> Mapping[str, Any]:
        """Return the next line of the log, which must be for this request.

        Raises:
            ReplayError: The log has a different request here, or none.
        """
        location = f"{self._path}: step {step} ({role})"
        if not self._remaining:
            raise ReplayError(f"{location}: the log has no further request; it is another run's")
        line = self._remaining.pop(0)
        if line.get("sha256") == request_digest(body):
            return line
        difference = _difference(line.get("request"), logged(body))
        raise ReplayError(
            f"{location}: this request is not in the log, which has step {line.get('step')}"
            f" ({line.get('role')}) here; they differ in {difference}"
        )


def log_folder(path: Path) -> Path:
    """Return the folder with the request logs of a run, given that folder or the run's.

    Raises:
        AgentSetupError: there is none.
    """
    inner = path / FOLDER
    folder = inner if inner.is_dir() else path
    if not folder.is_dir() or not any(folder.glob("*.jsonl")):
        raise AgentSetupError(f"--replay {path}: no folder {FOLDER} with the log of a run")
    return folder


def logged_response(line: Mapping[str, Any]) -> Any:
    """Return the response of a line.

    Raises:
        EndpointError: the request failed when the log was made.
    """
    if "problem" in line:
        raise EndpointError(str(line["problem"]))
    return line.get("response")


def _lines(path: Path) -> list[dict[str, Any]]:
    try:
        content = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ReplayError(f"{path}: no log of this episode can be read ({error})") from None
    lines: list[dict[str, Any]] = []
    for number, text in enumerate(content.split("\n"), 1):
        if not text:
            continue
        try:
            line = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ReplayError(f"{path}:{number}: is damaged ({error})") from None
        if not isinstance(line, dict) or not line.keys() >= _REQUIRED_FIELDS:
            fields = ", ".join(sorted(_REQUIRED_FIELDS))
            raise ReplayError(f"{path}:{number}: is damaged (it lacks one of {fields})")
        mistake = _mistake(line)
        if mistake:
            raise ReplayError(f"{path}:{number}: is damaged ({mistake})")
        lines.append(line)
    return lines


def _mistake(line: Mapping[str, Any]) -> str:
    """Return what makes a line useless that has all its fields; "" if nothing does."""
    if "problem" not in line and not isinstance(line.get("response"), dict):
        return "it has neither a response, which is an object, nor a problem"
    if not is_amount(line["seconds"]):
        return f"seconds is no number from 0 on: {line['seconds']!r:.80}"
    if not is_count(line["tries"]) or line["tries"] < 1:
        return f"tries is no whole number from 1 on: {line['tries']!r:.80}"
    return ""


def _difference(before: Any, after: Any, path: str = "the request") -> str:
    """Return the place of the first difference of two JSON values."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in {**before, **after}:
            if before.get(key) != after.get(key):
                return _difference(before.get(key), after.get(key), f"{path}.{key}")
    if isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for index, (old, new) in enumerate(zip(before, after, strict=True)):
            if old != new:
                return _difference(old, new, f"{path}[{index}]")
    kind = "a picture" if str(after).startswith("sha256:") else "the value"
    return f"{path} ({kind})"
