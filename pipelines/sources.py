"""One source or several, read as one stream of trajectories whose ids are unique."""

import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import ParameterTypeError, quantity
from hijack_data.paths import PathLike
from hijack_data.types import Step, Trajectory

from .dataset.manifest import holds_build
from .errors import SourceError
from .knowledge import RECORDINGS, Knowledge, read_knowledge
from .readers import Rejected, Survey, check_path, get_reader, names, survey
from .readers.reader_options import NO_CHOICES, ReaderOptions, with_choices
from .readers.recorded_pictures import picture_file
from .readers.safe_files import relative_name
from .readers.survey import advise, summary


@dataclass(frozen=True)
class SourceItem:
    """A trajectory or a rejected input, and the folder of its source."""

    root: Path
    item: Trajectory | Rejected


@dataclass
class Sources:
    """The sources of a build, in the order in which they were given.

    Args:
        paths: absolute paths.
        names: their names in reports, never absolute paths.
        surveys: the files of each by format.
        choices: the user's choices of coordinates and boxes.
        knowledge: applications and platform of each source, as the user stated them.
        renamed: number of trajectories so far whose id an earlier source or format has.
        excluded: ids of the trajectories so far to which the option `apps` does not apply, because
            their instruction names another program.
    """

    paths: tuple[Path, ...]
    names: tuple[str, ...]
    surveys: tuple[Survey, ...]
    choices: ReaderOptions = NO_CHOICES
    knowledge: tuple[Knowledge, ...] = ()
    renamed: int = 0
    excluded: list[str] = field(default_factory=list[str])

    @classmethod
    def open(
        cls,
        source: PathLike | Sequence[PathLike],
        format: str | None = None,
        choices: ReaderOptions = NO_CHOICES,
        *,
        apps: Sequence[str] | str | None = None,
        platform: str | None = None,
    ) -> "Sources":
        """Find the formats of one source or several.

        Raises:
            BuildError: none of the formats leaves a choice open.
            ConfigError, ParameterError: a mistake in `apps`, `platform` or `agenthijack.yaml`.
            SourceError: a source is given twice, is a dataset that was built, or has no known
                format, see `readers.survey`.
        """
        several = _listed(source)
        paths = tuple(check_path(os.path.abspath(check_path(path))) for path in several)
        for path in paths:
            if paths.count(path) > 1:
                raise SourceError(f"{path}: is given twice")
            _refuse_dataset(path)
        names = tuple(public_name(path) for path in several)
        knowledge = tuple(read_knowledge(path, apps, platform) for path in paths)
        surveys = tuple(survey(path, format) for path in paths)
        sources = cls(paths, names, surveys, choices, knowledge)
        sources._check_choices()
        return sources

    @classmethod
    def reopen(
        cls, source: PathLike | Sequence[PathLike], parameters: Mapping[str, Any]
    ) -> "Sources":
        """Find the formats in the same way as the build whose manifest has these `parameters`."""
        choices = ReaderOptions(
            parameters.get("coordinates"), parameters.get("boxes"), parameters.get("episode_key")
        )
        recordings = parameters.get(RECORDINGS, {})
        return cls.open(
            source,
            parameters.get("format"),
            choices,
            apps=recordings.get("apps"),
            platform=recordings.get("platform"),
        )

    @property
    def formats(self) -> list[str]:
        """The names of all formats."""
        return sorted({name for files in self.surveys for name in files.parts})

    @property
    def unread(self) -> list[str]:
        """Record files that no reader takes, named from their source."""
        names: list[str] = []
        for index, files in enumerate(self.surveys):
            names += [self._name(index, name) for name in files.unread]
        return names

    def advice(self) -> Iterator[str]:
        """Yield how to make files readable that no reader takes, the first of each kind."""
        kinds: set[str] = set()
        for index, files in enumerate(self.surveys):
            for name in files.unread:
                advice = advise(files.root / name)
                if advice and Path(name).suffix not in kinds:
                    kinds.add(Path(name).suffix)
                    yield f"{self._name(index, name)}: {advice}"

    def read(self, limit: int | None = None) -> Iterator[SourceItem]:
        """Yield the content of the sources in a fixed order, up to `limit` trajectories."""
        used_ids: set[str] = set()
        self.renamed = 0
        self.excluded.clear()
        for index, files in enumerate(self.surveys):
            for item in self.knowledge[index].complete(files.read(self.choices), self.excluded):
                if isinstance(item, Rejected):
                    rejected = replace(item, file=self._name(index, item.file))
                    yield SourceItem(files.root, rejected)
                    continue
                trajectory, repeated = _in_order(item)
                for step in repeated:
                    file = relative_name(picture_file(step.image), files.root)
                    rejected = Rejected(
                        self._name(index, file),
                        f"{trajectory.id}, step {step.index}",
                        "step",
                        f"{trajectory.id!r} has a step {step.index} already; number its steps"
                        " anew, or give the other recording an id of its own",
                    )
                    yield SourceItem(files.root, rejected)
                yield SourceItem(files.root, self._unique(trajectory, index, used_ids))
                if limit is not None and len(used_ids) >= limit:
                    return

    def knowledge_parameters(self) -> dict[str, Any]:
        """Return the parameters of `knowledge` in a manifest: options, and hashes of the files."""
        parameters = self.knowledge[0].parameters()
        hashes = [knowledge.sha256 for knowledge in self.knowledge]
        if len(hashes) > 1 and any(hashes):
            recordings = parameters.get(RECORDINGS, {})
            parameters = {RECORDINGS: {**recordings, "file_sha256": hashes}}
        return parameters

    def notes(self) -> Iterator[str]:
        """Yield remarks for the user about how the sources were read."""
        if self.unread:
            yield f"not read, of no known format: {summary(self.unread)}"
        yield from self.advice()
        yield from self.exclusions()
        if self.renamed:
            yield (
                f"{self.renamed} trajectories have an id that an earlier one has; theirs begins"
                " with the name of their source"
            )

    def exclusions(self) -> Iterator[str]:
        """Yield the remark about trajectories that the option `apps` does not apply to."""
        if self.excluded:
            number = quantity(len(self.excluded), "trajectory", "trajectories")
            yield (
                f"--apps is not applied to {number} whose instruction names another program, such"
                f" as {self.excluded[0]}; list theirs in agenthijack.yaml"
            )

    def refuse_nothing(self) -> None:
        """Check that there is something to read.

        Raises:
            SourceError: there is nothing.
        """
        if next(self.read(), None) is None:
            listed_paths = ", ".join(map(str, self.paths))
            raise SourceError(
                f"{listed_paths}: holds no trajectory; known formats: {', '.join(names())}"
            )

    def _check_choices(self) -> None:
        readers = [get_reader(name) for name in self.formats]
        accepted: set[str] = set()
        for reader in readers:
            accepted.update(getattr(reader, "takes", ()))
        if self.choices.to_data().keys() <= accepted:
            return
        for reader in readers:
            with_choices(reader, self.choices)  # raises for the choice that is left over

    def _unique(self, trajectory: Trajectory, index: int, used_ids: set[str]) -> Trajectory:
        """Return a trajectory with its id, prefixed with its source if the id is taken."""
        if trajectory.id not in used_ids:
            used_ids.add(trajectory.id)
            return trajectory
        self.renamed += 1
        prefix = self._label(index) if len(self.paths) > 1 else trajectory.source
        name = f"{prefix}/{trajectory.id}"
        candidate = name
        number = 1
        while candidate in used_ids:
            number += 1
            candidate = f"{name}~{number}"
        used_ids.add(candidate)
        return replace(trajectory, id=candidate)

    def _name(self, index: int, file: str) -> str:
        """Return the name of a file, prefixed with its source if there are several sources."""
        if len(self.paths) == 1 or self.paths[index].is_file():
            return file
        return f"{self._label(index)}/{file}"

    def _label(self, index: int) -> str:
        """Return the end of a source's path that no other source has."""
        source = self.paths[index]
        for length in range(1, len(source.parts)):
            end = source.parts[-length:]
            if sum(path.parts[-length:] == end for path in self.paths) == 1:
                return "/".join(end)
        return source.name


def _refuse_dataset(path: Path) -> None:
    """Refuse a dataset of ours as a source: its rows are corrupted already.

    Raises:
        SourceError: the folder is such a dataset.
    """
    if holds_build(path):
        raise SourceError(
            f"{path}: is a dataset that hijack build wrote, not recordings; hijack stats and hijack"
            " view show what it holds, and a build takes the recordings that it was built from"
        )


def public_name(path: PathLike) -> str:
    """Return a source's name in a dataset: the given path, without folders of this machine."""
    given_path = Path(path)
    if given_path.is_absolute() or ".." in given_path.parts or not given_path.name:
        return Path(os.path.abspath(given_path)).name or "source"
    return given_path.as_posix()


def _in_order(trajectory: Trajectory) -> tuple[Trajectory, list[Step]]:
    """Return a trajectory with its steps in the order of their numbers, and the repeated steps."""
    numbers = [step.index for step in trajectory]
    if all(first < second for first, second in itertools.pairwise(numbers)):
        return trajectory, []
    steps: dict[int, Step] = {}
    repeated = [step for step in trajectory if steps.setdefault(step.index, step) is not step]
    return replace(trajectory, steps=tuple(steps[number] for number in sorted(steps))), repeated


def _listed(source: PathLike | Sequence[PathLike]) -> list[PathLike]:
    if isinstance(source, str | os.PathLike):
        return [cast("PathLike", source)]
    several: list[Any] = list(source)
    if not several or not all(isinstance(path, str | os.PathLike) for path in several):
        raise ParameterTypeError(f"source must be a path or a list of paths, got {source!r:.80}")
    return several
