"""A run of `hijack bench` for the page: every episode is a trajectory, every observation a row."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from hijack_data.actions import parse_pyautogui
from hijack_data.cache import Cache
from hijack_data.errors import HijackError
from hijack_data.runs.run_log import EPISODE, EPISODES, FORMAT, RUN, STEPS, VERSION
from hijack_data.types import UInt8Array

from ..dataset.images import decode
from ..errors import DatasetError
from ..readers.fields import FieldError, mapping
from ..readers.files import inside, line_at, lines, parse, parse_file, size_of
from .index import Index
from .source import Detail, Fields, action_text, points_of, text_of

LABELS = {
    "corruption": "Corruption",
    "agent": "Agent",
    "task": "Task",
    "status": "Status",
    "score": "Score",
    "trajectory": "Episode",
}
KEPT_LINES = 64


class RunSource:
    """The log of a run, of `hijack bench` or of a `CorruptedEnv`.

    A folder without one is a `DatasetError`; episodes that cannot be read are in `problems`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.title = folder.resolve().name
        self.problems: list[str] = []
        self.index = Index([name for name in LABELS if name != "corruption"])
        self.episodes: list[tuple[Path, Mapping[str, Any]]] = []
        # the episode of each row, and the offset of its line
        self._places: list[tuple[int, int]] = []
        # bounded by their number: every line counts as one byte
        self._lines = Cache(KEPT_LINES)
        if (folder / RUN).exists():
            _check(folder)
        for home in self._homes():
            self._add(home)
        self.index.finish()
        self.labels = {
            name: title for name, title in LABELS.items() if any(self.index.columns[name].values)
        }
        self.chips = tuple(
            name for name in ("corruption", "status", "score") if name in self.labels
        )
        self.facts = f"run, {len(self.episodes)} episode{'s' if len(self.episodes) != 1 else ''}"

    def _homes(self) -> list[Path]:
        # the folders of the finished episodes: the record is written last
        try:
            found = sorted(path for path in (self.folder / EPISODES).iterdir() if path.is_dir())
        except FileNotFoundError:
            found = []
        except OSError as error:
            raise DatasetError(
                f"{self.folder / EPISODES}: cannot be read ({error.strerror or error})"
            ) from None
        open_ones = [path.name for path in found if not (path / EPISODE).exists()]
        if open_ones:
            self.problems.append(
                f"{len(open_ones)} episode(s) without a record (not finished), such as"
                f" {open_ones[0]}"
            )
        return [path for path in found if (path / EPISODE).exists()]

    def _add(self, home: Path) -> None:
        """Put the steps of an episode into the index, or note why they are missing."""
        name = home.name
        try:
            record = parse_file(home / EPISODE)
            steps = [found.offset for found in lines(inside(home, STEPS, STEPS))]
        except FieldError as error:
            self.problems.append(f"{EPISODES}/{name}: {error}")
            return
        except OSError as error:
            self.problems.append(
                f"{EPISODES}/{name}/{STEPS}: cannot be read ({error.strerror or error})"
            )
            return
        number = len(self.episodes)
        first = len(self._places)
        self.episodes.append((home, record))
        self._places += [(number, offset) for offset in steps]
        words = {
            key: [_word(record.get(key))] * len(steps)
            for key in (*LABELS, "instruction")
            if key != "trajectory"
        }
        group = json.dumps(
            [record.get(key) for key in ("agent", "task", "task_seed", "seed", "attempt")]
        )
        self.index.extend(
            range(first, first + len(steps)),
            [f"{name}/{k:04d}" for k in range(len(steps))],
            range(len(steps)),
            {
                **words,
                "trajectory": [name] * len(steps),
                "group": [group] * len(steps),
            },
        )

    def detail(self, row: int) -> Detail:
        """Return a step and its episode; a damaged line is a `DatasetError`."""
        home, record, step = self._step(row)
        detail = Detail(
            fields={"Step": _fields(step, "plan"), "Episode": _fields(record)},
            notes=_notes(record, step),
            action="the last observation" if step.get("raw") is None else "",
            code=str(step.get("raw") or ""),
            plan="" if step.get("plan") is None else text_of(step["plan"]),
            no_before="" if step.get("seen") else "the agent saw the clean picture",
        )
        try:
            height, width = size_of(_image(home, step, False))
            detail.size = width, height
            if detail.code:
                action = vars(parse_pyautogui(detail.code, (height, width)))
                detail.action, detail.points = action_text(action), points_of(action)
        except FieldError as error:
            detail.problem = str(error)
        # the agent wrote something that is no action: the page shows it as it is
        except HijackError:
            detail.action = "not a pyautogui action"
        return detail

    def glance(self, row: int) -> Detail:
        """Return what a tile shows of a step; a damaged line is a `DatasetError`."""
        return self.detail(row)

    def picture(self, row: int, before: bool) -> UInt8Array:
        """Return the picture that the agent saw, or the clean screen, uint8 RGB `[H, W, 3]`.

        Raises:
            DatasetError: the picture cannot be read.
        """
        home, _, step = self._step(row)
        try:
            file = _image(home, step, before)
            return decode(file.read_bytes(), file.name)
        except OSError as error:
            raise DatasetError(
                f"{self.index.ids[row]}: cannot be read ({error.strerror or error})"
            ) from None

    def _step(self, row: int) -> tuple[Path, Mapping[str, Any], Mapping[str, Any]]:
        """Return the folder and the record of an episode, and one line of it."""
        number, offset = self._places[row]
        home, record = self.episodes[number]
        line = self._lines.get(row)
        if line is None:
            line = _line(home, offset)
            self._lines.put(row, line, 1)
        return home, record, line


def _line(home: Path, offset: int) -> Mapping[str, Any]:
    try:
        with inside(home, STEPS, STEPS).open("rb") as file:
            return mapping(parse(line_at(file, offset)), "")
    except (FieldError, OSError) as error:
        raise DatasetError(f"{EPISODES}/{home.name}/{STEPS} at byte {offset}: {error}") from None


def _image(
    home: Path,
    step: Mapping[str, Any],
    before: bool,
) -> Path:
    seen = None if before else step.get("seen")
    return inside(home, str(seen or step.get("image")))


def _check(folder: Path) -> None:
    try:
        run = parse_file(folder / RUN)
    except FieldError as error:
        raise DatasetError(f"{folder / RUN}: {error}") from None
    if run.get("format") != FORMAT:
        raise DatasetError(
            f"{folder / RUN}: not the log of a run of ours (field 'format' must be {FORMAT!r})"
        )
    if not isinstance(run.get("version"), int) or run["version"] > VERSION:
        raise DatasetError(
            f"{folder / RUN}: version {run.get('version')!r} is newer than this library reads"
            f" ({VERSION})"
        )


def _word(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:g}"
    return str(value)


def _fields(record: Mapping[str, Any], *without: str) -> Fields:
    return [(name, text_of(value)) for name, value in record.items() if name not in without]


def _notes(record: Mapping[str, Any], step: Mapping[str, Any]) -> Fields:
    notes = _events(step)
    if step.get("said"):
        notes.append(("Said", str(step["said"])))
    if step.get("error"):
        notes.append(("Refused", str(step["error"])))
    notes.append(("Episode", _outcome(record)))
    frames = record.get("traceback")
    if isinstance(frames, list) and frames:
        lines = (str(frame) for frame in cast("list[object]", frames))
        notes.append(("Traceback", "\n".join(lines)))
    return notes


def _events(step: Mapping[str, Any]) -> Fields:
    events = step.get("events")
    if not isinstance(events, list):
        return []
    notes: Fields = []
    for event in cast("list[object]", events):
        if isinstance(event, dict):
            told = cast("dict[str, object]", event)
            notes.append(("Event", f"{told.get('effect')}: {text_of(told.get('record'))}"))
    return notes


def _outcome(record: Mapping[str, Any]) -> str:
    """Return the status and the score of an episode, and why it ended."""
    score = "no score"
    if record.get("score") is not None:
        score = f"score {_word(record['score'])}"
    text = f"{record.get('status')}, {score}"
    why = record.get("problem") or record.get("reason")
    return f"{text}: {why}" if why else text
