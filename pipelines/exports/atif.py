"""ATIF (Agent Trajectory Interchange Format, Harbor's RFC 0001): an episode is a `trajectory.json`.

`episodes/SHARD-NUMBER/trajectory.json` holds the rows of one recorded trajectory under one
corruption, in the order of the steps, and `images/` beside it their screenshots. A row is an agent
step: its `message` is the action in the chosen dialect, its only tool call is `desktop_action` with
the columns of `action` as arguments, in pixels of the screenshot. ATIF shows a screen as the result
of the step before, so the first screenshot is part of the user's message and each later one the
observation of the preceding step. Where steps are missing between two rows, or what followed an
event was not recorded, a system step says so and shows the screenshot. The other columns are in
`extra`.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.file_io import write_atomic

from ..dataset.columns import ACTION
from ..readers.atif import EXPORT_KEY, TOOL
from .example import Example, Row, escape_tokens
from .stored_rows import holds_several_actions, row_faults

VERSION = "ATIF-v1.7"
_ARGUMENTS = {"string": "string", "int32": "integer", "float64": "number"}


def _argument(kind: Any) -> dict[str, Any]:
    if isinstance(kind, list):
        return {"type": "array", "items": {"type": "string"}}
    return {"type": _ARGUMENTS[kind]}


_DEFINITION = {
    "type": "function",
    "function": {
        "name": TOOL,
        "description": "An action on the desktop; coordinates are pixels of the last screenshot.",
        "parameters": {
            "type": "object",
            "properties": {name: _argument(kind) for name, kind in ACTION.items()},
            "required": ["type"],
        },
    },
}


@dataclass
class _Episode:
    """One document, while its rows come in.

    Args:
        folder: where it is written.
        about: the first row.
        steps: the steps so far.
        next: the recorded number of the step that the last action leads to; `None` if what follows
            was not recorded.
    """

    folder: Path
    about: dict[str, Any]
    steps: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    next: int | None = 0

    def add(self, example: Example) -> bool:
        """Add a row; return whether steps are missing before it."""
        row = example.row
        image = self._image(example.png)
        missing = bool(self.steps) and (self.next is None or row["step"] > self.next)
        if not self.steps:
            text = {"type": "text", "text": escape_tokens(row["instruction"])}
            self._step("user", [text, image])
        elif missing:
            self._step(
                "system",
                _gap_text(self.next, row["step"]),
                observation={"results": [{"content": [image]}]},
            )
        else:
            call = self.steps[-1]["tool_calls"][0]["tool_call_id"]
            result = {"source_call_id": call, "content": [image]}
            self.steps[-1]["observation"] = {"results": [result]}
        self.next = _following_step(row)
        arguments = {name: row["action"][name] for name in ACTION}
        call = {
            "tool_call_id": f"call_{len(self.steps) + 1}",
            "function_name": TOOL,
            "arguments": {name: value for name, value in arguments.items() if value is not None},
        }
        about = {**example.about, "inserted": row["inserted"], "dialect": example.dialect}
        self._step("agent", example.answer, tool_calls=[call], extra={EXPORT_KEY: about})
        return missing

    def write(self) -> None:
        """Write the document."""
        row = self.about
        document = {
            "schema_version": VERSION,
            "session_id": row["trajectory_id"],
            "trajectory_id": f"{row['trajectory_id']}/{row['corruption']}",
            "agent": {
                "name": row["source"],
                "version": "unknown",
                "tool_definitions": [_DEFINITION],
            },
            "steps": self.steps,
            "notes": f"Recorded in the format {row['source']} and exported by AgentHijack.",
            "extra": {EXPORT_KEY: {"domain": row["domain"], "corruption": row["corruption"]}},
        }
        text = json.dumps(document, ensure_ascii=False, indent=1)
        write_atomic(self.folder / "trajectory.json", text + "\n")

    def _step(self, source: str, message: Any, **fields: Any) -> None:
        number = len(self.steps) + 1
        self.steps.append({"step_id": number, "source": source, "message": message, **fields})

    def _image(self, png: bytes) -> dict[str, Any]:
        name = f"images/{len(self.steps):06d}.png"
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(png)
        return {"type": "image", "source": {"media_type": "image/png", "path": name}}


def _following_step(row: Row) -> int | None:
    """Return the recorded number of the step after a row; `None` if what follows is not recorded.

    What undoes an event leads back to the recorded step. After waiting at a locked screen, or
    acting beside a second window, a live desktop would show something else than the recording.
    Where a reply held several actions, the row has the first, and the next screen is that of all.
    """
    if holds_several_actions(row):
        return None
    if row["event"] is None or row_faults(row):
        return int(row["step"]) + 1
    return int(row["step"]) if row["inserted"] else None


def _gap_text(expected: int | None, step: int) -> str:
    if expected is None:
        return f"What followed was not recorded; this is the screen of step {step}."
    return f"Steps {expected} to {step - 1} of the recording are not exported."


class AtifWriter:
    """Writes a folder for each episode; `notes` says what ATIF has no field for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.open: dict[str, _Episode] = {}
        self.trajectory: str | None = None
        self.gaps = 0

    def shard(self, index: int, examples: Iterator[Example]) -> None:
        """Write the examples of one shard; those of a trajectory follow each other."""
        for example in examples:
            row = example.row
            if row["trajectory_id"] != self.trajectory:
                self._close()
                self.trajectory = row["trajectory_id"]
            folder = self.folder / "episodes" / example.key
            episode = self.open.setdefault(row["corruption"], _Episode(folder, row))
            self.gaps += episode.add(example)

    def finish(self) -> None:
        """Write the last episodes."""
        self._close()

    def notes(self) -> Iterator[str]:
        """Yield what the report says about this export."""
        if self.gaps:
            yield f"{self.gaps} times steps are missing within an episode; a system step says so"

    def _close(self) -> None:
        for episode in self.open.values():
            episode.write()
        self.open.clear()
