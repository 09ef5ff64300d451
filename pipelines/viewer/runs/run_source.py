"""An open run: its list of episodes, one episode, its pictures, and what verifying it finds."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from hijack_data.cache import Cache
from hijack_data.errors import HijackError, quantity
from hijack_data.runs.run_head import check_head
from hijack_data.runs.run_log import EPISODES, FORMAT, RUN, SCORE_RUN
from hijack_data.types import UInt8Array

from ...dataset.image_codec import encode
from ...errors import DatasetError
from ...readers.fields import FieldError, mapping
from ...readers.safe_files import parse, parse_file
from .entry_columns import columns
from .episode import EpisodeLines, episode_data, picture_file, read_lines, read_picture
from .episode_entry import EpisodeEntry
from .listing import read_listing

if TYPE_CHECKING:
    from .scored_rows import ScoredRows

MAX_CACHED_EPISODES = 16
MAX_PROBLEMS = 40
_PNG = b"\x89PNG"


class RunSource:
    """The log of a run, of `hijack bench`, `hijack score` or a `CorruptedEnv`.

    Damage is listed in `problems`, or shown with its episode. Methods may be called from several
    threads.

    Raises:
        DatasetError: the folder holds no run.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        home = folder.resolve()
        self.title = home.parent.name if home.name == "run" else home.name  # docs/results/NAME/run
        self.problems: list[str] = []
        self.head: Mapping[str, Any] = {}
        content = self._read_head()
        listing = read_listing(folder, content)
        self.entries: list[EpisodeEntry] = listing.entries
        self.problems += listing.problems
        self._listing = listing
        self._scored: ScoredRows | None = None
        if self.config.get("kind") == SCORE_RUN:
            from . import scored_rows

            self._scored = scored_rows.ScoredRows(
                str(self.config.get("source") or ""), folder, is_planned="plans" in self.config
            )
            if self._scored.problem:
                self.problems.append(self._scored.problem)
        # bounded by their number: every episode counts as one byte
        self._episodes = Cache(MAX_CACHED_EPISODES)

    @property
    def config(self) -> Mapping[str, Any]:
        """The configuration of the run; empty if unknown."""
        config = self.head.get("config")
        return cast("dict[str, Any]", config) if isinstance(config, dict) else {}

    @property
    def is_scored(self) -> bool:
        """Whether the run is one of `hijack score`: answers to rows of a dataset."""
        return self._scored is not None

    @property
    def facts(self) -> str:
        """A short description of the run."""
        count = len(self.entries)
        planned_ids = self.head.get("episodes")
        words = [quantity(count, "episode")]
        if self._scored is not None:
            words = [f"{quantity(count, 'answer')} to rows of a dataset"]
        if isinstance(planned_ids, list):
            ids = {entry.id for entry in self.entries}
            missing = sum(name not in ids for name in planned_ids)
            if missing:
                words.append(f"{missing:,} of {len(planned_ids):,} planned not played")
        damaged = sum(bool(entry.problem) for entry in self.entries)
        if damaged:
            words.append(f"{damaged:,} damaged")
        return ", ".join(words)

    def about(self) -> dict[str, Any]:
        """Return everything that the list of episodes needs, as JSON data."""
        return {
            "title": self.title,
            "facts": self.facts,
            "problems": self.problems,
            "scored": self._scored is not None,
            **columns(self.entries, self.config),
        }

    def episode(self, number: int) -> dict[str, Any]:
        """Return an episode with all its steps, as JSON data; damage is in its `problems`.

        Raises:
            HijackError: there is no such episode.
        """
        entry = self._entry(number)
        if self._scored is not None:
            data = self._scored.episode(self._record(entry))
        else:
            data = episode_data(self.folder, entry.id, self._lines(number))
        problems = [entry.problem, *data["problems"]]
        return {
            **data,
            "number": number,
            "problems": [text for text in dict.fromkeys(problems) if text][:MAX_PROBLEMS],
        }

    def check(self, number: int) -> list[str]:
        """Return what `hijack verify` finds wrong with the files of an episode.

        Raises:
            HijackError: there is no such episode.
        """
        from ...proof.run_checks.episode import EpisodeReplay, check_episode
        from ...proof.run_checks.journal import Journal

        entry = self._entry(number)
        home = self.folder / EPISODES / entry.id
        if self._scored is not None or not entry.id or not home.is_dir():
            return []
        journal = Journal(self.folder, head=self.head)
        problems: list[str] = []
        try:
            for problem in check_episode(home, journal, EpisodeReplay()):
                problems.append(problem)
                if len(problems) == MAX_PROBLEMS:
                    problems.append("and more: hijack verify lists all")
                    break
        except HijackError as error:
            problems.append(str(error))
        return problems

    def picture(self, number: int, step: int, before: bool) -> bytes:
        """Return a picture as a PNG file: what the agent saw, or the clean screen `before`.

        Raises:
            HijackError: there is no such picture, or it is damaged.
        """
        data, pixels = self._picture(number, step, before)
        return data if data.startswith(_PNG) else encode(pixels)

    def pixels(self, number: int, step: int, before: bool) -> UInt8Array:
        """Return the pixels of a picture, uint8 RGB `[H, W, 3]`; errors as of `picture`."""
        return self._picture(number, step, before)[1]

    def _picture(self, number: int, step: int, before: bool) -> tuple[bytes, UInt8Array]:
        entry = self._entry(number)
        if self._scored is not None:
            return b"", self._scored.pixels(self._record(entry), before)
        episode = self._lines(number)
        if not 0 <= step < len(episode.lines):
            raise DatasetError(f"{entry.id}: has no step {step}")
        return read_picture(picture_file(episode.home, episode.lines[step], before))

    def _entry(self, number: int) -> EpisodeEntry:
        if not 0 <= number < len(self.entries):
            raise HijackError(f"there is no episode {number} here; there are {len(self.entries)}")
        return self.entries[number]

    def _record(self, entry: EpisodeEntry) -> Mapping[str, Any]:
        """Return the line of the journal; empty if it has none that can be read."""
        if not entry.number:
            return {}
        try:
            return mapping(parse(self._listing.lines[entry.number - 1]), "")
        except FieldError:
            return {}

    def _lines(self, number: int) -> EpisodeLines:
        entry = self._entry(number)
        episode = self._episodes.get(number)
        if episode is None:
            episode = read_lines(self.folder, entry.id, self._record(entry))
            if entry.outcome != "unfinished":  # that one may grow
                self._episodes.put(number, episode, 1)
        return episode

    def _read_head(self) -> bytes:
        """Read `run.json`, and return its bytes; a log without a benchmark has none.

        Raises:
            DatasetError: it is of another program, or it is damaged and there are no episodes.
        """
        path = self.folder / RUN
        if not path.exists():
            return b""
        try:
            head = parse_file(path)
            if head.get("format") != FORMAT:  # another program's, whatever lies beside it
                raise DatasetError(
                    f"{path}: not the log of a run of ours (field 'format' must be {FORMAT!r})"
                )
            self.head = check_head(head)
            return path.read_bytes()
        except DatasetError:
            raise
        except OSError as error:
            problem = f"cannot be read ({error.strerror or error})"
        except HijackError as error:
            problem = str(error)
        if not (self.folder / EPISODES).is_dir():
            raise DatasetError(f"{path}: {problem}")
        self.problems.append(f"{RUN}: {problem}; episodes are shown as far as they can be read")
        return b""
