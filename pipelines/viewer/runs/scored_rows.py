"""The rows that a run of `hijack score` asked about, from their dataset."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError
from hijack_data.picture_io import pixel_sha256
from hijack_data.runs.run_log import ROW, RUN
from hijack_data.types import UInt8Array

from ...errors import DatasetError
from ..dataset_source import DatasetSource
from ..source import Detail
from .action_strokes import parse_strokes
from .episode import about, record_fields


class ScoredRows:
    """The dataset of a scoring run; `problem` is set if it is gone.

    Args:
        source: its folder, as the run names it.
        folder: of the run: a relative name may also be meant from there.
        is_planned: whether its clean rows were corrupted while they were read.
    """

    def __init__(self, source: str, folder: Path, *, is_planned: bool = False) -> None:
        self.problem = ""
        self._is_planned = is_planned
        self._data: DatasetSource | None = None
        self._rows: dict[str, int] = {}
        places = [Path(source), folder / source, folder.parent / Path(source).name]
        dataset = next((path for path in places if _is_there(path)), None)
        if dataset is None or not source:
            self.problem = (
                f"the dataset {source!r} that was scored is not there, so pictures are missing; put"
                " it back, or beside the run"
            )
            return
        try:
            self._data = DatasetSource(dataset)
        except HijackError as error:
            self.problem = f"the dataset that was scored cannot be read: {error}"
            return
        index = self._data.index
        self._rows = dict(zip(index.ids, index.rows.tolist(), strict=True))

    def episode(self, record: Mapping[str, Any]) -> dict[str, Any]:
        """Return the page's data of one answer, as an episode of one step."""
        problems: list[str] = []
        detail = Detail(problem=self.problem)
        try:
            detail = self._require().detail(self._row(record))
        except HijackError as error:
            problems.append(str(error))
        size = detail.size
        code = record.get("last_action")
        code = code if isinstance(code, str) else ""
        action, strokes = ("", [])
        if code and size is not None:
            action, strokes = parse_strokes(code, (size[1], size[0]))
        step = {
            "step": 0,
            "problem": detail.problem,
            "lost": problems[0] if problems else "",
            "size": list(size) if size else None,
            "corrupted": not detail.no_before,
            "no_before": detail.no_before,
            "code": code,
            "ran": "",
            "said": str(record.get("said") or ""),
            "error": "",
            "result": "",
            "onlooker": [],
            "usage": {},
            "seconds": {},
            "still": True,
            "effects": [],
            "plan": detail.plan,
            "boxes": [],
            "fields": [pair for group in detail.fields.values() for pair in group],
            "action": action,
            "strokes": strokes,
            "faults": [],
            "arrived": "",
            "arrived_strokes": [],
            "target": list(detail.box) if detail.box else None,
            "recorded": detail.action,
        }
        return {
            "problems": problems,
            "steps": [step],
            "effects": [],
            **about(record),
            "fields": record_fields(record, "instruction", "traceback"),
        }

    def pixels(self, record: Mapping[str, Any], before: bool) -> UInt8Array:
        """Return the picture of a row, uint8 RGB `[H, W, 3]`, or that before its corruption.

        Raises:
            DatasetError: there is no such picture, or it is not the one that the agent was shown.
        """
        pixels = self._require().picture(self._row(record), before)
        digest = record.get("image_sha256")
        if not before and isinstance(digest, str) and pixel_sha256(pixels) != digest:
            raise DatasetError(
                f"row {record.get(ROW)}: this is not the picture that the agent was shown"
                " (image_sha256); the dataset is another one"
            )
        return pixels

    def _require(self) -> DatasetSource:
        if self._data is None:
            raise DatasetError(self.problem)
        return self._data

    def _row(self, record: Mapping[str, Any]) -> int:
        name = str(record.get(ROW))
        if name not in self._rows and self._is_planned:
            raise DatasetError(
                f"row {name!r} was corrupted while it was read, as the plans of {RUN} say; the"
                " dataset has its clean picture alone"
            )
        if name not in self._rows:
            raise DatasetError(f"the dataset has no row {name!r}; it is another one")
        return self._rows[name]


def _is_there(folder: Path) -> bool:
    try:
        return (folder / "manifest.json").is_file()
    except (OSError, ValueError):
        return False
