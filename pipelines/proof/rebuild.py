"""Check that the files of a run agree with each other: `hijack verify RUNS`.

Everything that can be computed from other files is computed again and compared: ids from task,
corruption, seed and agent; plans from the configuration, the seed and the clean screens; the
pictures that the agent saw from the plans; the code that ran from the agent's answers; counts from
the lines; and the hashes that chain lines, episodes and journal (`hijack_data.runs.run_log`). These
checks cannot detect a run that was fabricated as a whole: see docs/verify_runs.md.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hijack_data.errors import quantity
from hijack_data.runs import seal
from hijack_data.runs.run_log import EPISODE, EPISODES, RECORDS, RUN, SEAL, STEPS, find_run

from ..building.build_report import Findings
from ..errors import SourceError
from .run_checks.episode import EpisodeReplay, check_episode
from .run_checks.journal import Journal, read_journal


@dataclass
class RebuildReport(Findings):
    """The result of `rebuild`.

    Args:
        folder: the run, or the episode.
        problems: the differences, each with the file and the step; empty if everything is
            identical.
        episodes: number of episodes that were checked.
        answers: number of records of a run of `hijack score`, which has no episodes; `None` for a
            run of `hijack bench`.
        records: number of records of a run that was published without its steps; `None` for any
            other run.
        steps: number of observations that were computed again.
        disturbed: number of those whose picture the plan changes.
        unfinished: number of episodes that were interrupted, and are not checked.
        unproved: what cannot be proved, in words; these are not problems of the run.
        signer: the fingerprint of the key that signed the run; empty without a signature.
    """

    episodes: int = 0
    answers: int | None = None
    records: int | None = None
    steps: int = 0
    disturbed: int = 0
    unfinished: int = 0
    unproved: list[str] = field(default_factory=list[str])
    signer: str = ""

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        lines = [f"{self.folder}: {self._summary()}", *self.listed()]
        if self.signer:
            lines.append(f"  signed by {self.signer}")
        lines += [f"  not proved: {text}" for text in self.unproved]
        return lines

    def _summary(self) -> str:
        """Return what was checked, and the outcome."""
        failed = quantity(len(self.problems), "problem")
        if self.answers is not None:
            state = "nothing differs" if self.ok else failed
            return f"{quantity(self.answers, 'answer')} to rows of a dataset: {state}"
        if self.records is not None:
            state = "the records agree with each other" if self.ok else failed
            return f"{quantity(self.records, 'record')}: {state}; no steps were published"
        state = "all identical" if self.ok else failed
        unfinished = f", {self.unfinished} unfinished" if self.unfinished else ""
        observations = f"{quantity(self.steps, 'observation')}, {self.disturbed} of them disturbed"
        episodes = quantity(self.episodes, "episode")
        return f"{episodes}{unfinished}, {observations}, made again: {state}"


def is_run(folder: str | os.PathLike[str]) -> bool:
    """Return whether a folder is a run or an episode, rather than a dataset."""
    path = find_run(Path(folder))
    if (path / EPISODES).is_dir():
        return True
    return (path / STEPS).is_file() or (path / RUN).is_file()


def rebuild(run: str | os.PathLike[str], key: str | None = None) -> RebuildReport:
    """Compute the observations of a run (or of one episode) again, and compare.

    Args:
        run: the folder.
        key: the path of the SSH public key that must have signed the run.

    Raises:
        SourceError: the folder is neither a run nor an episode.
        SealError: `key` is not a public key.
    """
    path = find_run(Path(run))
    if not is_run(path):
        raise SourceError(f"{path}: neither a run (with {EPISODES}/) nor an episode (with {STEPS})")
    report = RebuildReport(os.fspath(run))
    alone = (path / STEPS).is_file()
    if alone:
        journal = read_journal(path.parent.parent)
        _add_episode(report, journal, path, path.name)
    else:
        journal = read_journal(path)
        for folder in _folders(path):
            _add_episode(report, journal, folder, f"{EPISODES}/{folder.name}")
        _add_run(report, journal, path, key)
    if journal.is_scored:
        report.answers = len(journal.records)
    if journal.lacks_episodes:
        report.records = len(journal.records)
    report.unproved = list(_unproved_claims(report, journal, alone))
    return report


def _add_episode(report: RebuildReport, journal: Journal, folder: Path, name: str) -> None:
    problems = _episode(folder, journal, report)
    report.problems += [f"{name}/{problem}" for problem in problems]


def _add_run(report: RebuildReport, journal: Journal, path: Path, key: str | None) -> None:
    """Add the problems of the journal and the seal."""
    report.problems += journal.problems()
    report.problems += seal.problems(path, key)
    if (path / SEAL).exists():
        report.signer = seal.signer(path)


def _folders(run: Path) -> list[Path]:
    """Return the folders of the episodes; a run may have been broken off before the first."""
    home = run / EPISODES
    if not home.is_dir():
        return []
    return sorted(path for path in home.iterdir() if path.is_dir())


def _episode(folder: Path, journal: Journal, report: RebuildReport) -> Iterator[str]:
    if not (folder / EPISODE).is_file():
        report.unfinished += 1
        return
    report.episodes += 1
    replay = EpisodeReplay()
    yield from check_episode(folder, journal, replay)
    report.steps += replay.steps
    report.disturbed += replay.disturbed
    journal.add_episode(folder, replay.record)


def _unproved_claims(report: RebuildReport, journal: Journal, alone: bool) -> Iterator[str]:
    if not alone and not journal.exists:
        yield f"there is no {RECORDS}: an episode that was removed is not missed"
    if report.records is not None:
        yield (
            f"no steps were published ({EPISODES} is not there), so pictures, plans and actions"
            " were not compared with the records; verify the run where it was played"
        )
    elsewhere = journal.library.unavailable
    if not alone and journal.exists and not journal.is_scored and elsewhere:
        yield f"instructions and other facts of tasks and agents: {elsewhere}"
    if journal.is_scored:
        yield (
            "answers to the rows of a dataset leave no pictures: that they are right follows from"
            " the dataset and the agent alone; hijack score makes them again"
        )
    if not report.signer:
        yield "not signed: who writes all files anew, hashes included, is not found"
