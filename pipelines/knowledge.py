"""Applications and platforms that recordings do not state, as given by the user.

The options of a build (`apps`, `platform`) apply to every trajectory whose source does not state
them. `apps` speaks for a whole source: a trajectory that states other applications is an error, and
one whose instruction names another program keeps its applications unknown. A file in the source,
`agenthijack.yaml`, states them by trajectory, and overrides what the format records, since a person
wrote it about these very recordings:

    recordings:
      - match: "chrome/*"            # a trajectory's id, or a pattern with * and ?
        apps: [chrome]
        platform: windows

For each field, the first matching entry that gives it decides.
"""

import difflib
import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, cast

from hijack_data.apps import KNOWN, collect_apps, may_be_same, mentioned_programs, normalize_app
from hijack_data.choices import PLATFORMS
from hijack_data.config.nodes import (
    ConfigNode,
    MappingNode,
    Position,
    Problems,
    ScalarNode,
    SequenceNode,
    describe_node,
)
from hijack_data.config.yaml_reader import read_yaml
from hijack_data.errors import ParameterError, ParameterTypeError, suggest
from hijack_data.platforms import OURS, as_platform, find_platform
from hijack_data.types import Platform, Trajectory

from .errors import BuildError, SourceError
from .readers import Rejected
from .readers.fields import FieldError
from .readers.recording_facts import SCREENS, stated_platform, stated_screen
from .readers.safe_files import inside, source_root

SIDECAR = "agenthijack.yaml"
RECORDINGS = "recordings"
FIELDS = ("match", "apps", "platform")
MAX_BYTES = 2**20
# A name at least this similar to a known one is taken for a typing error.
MIN_SIMILARITY = 0.8


@dataclass(frozen=True)
class KnowledgeEntry:
    """One entry of the file; `location` is its place, for reports."""

    match: str
    apps: tuple[str, ...]
    platform: Platform | None
    location: str


@dataclass(frozen=True)
class Knowledge:
    """The facts about recordings that a user gave.

    Args:
        apps: applications of all trajectories whose source names none.
        platform: the platform of all trajectories whose source names none.
        entries: the entries of `agenthijack.yaml`.
        sha256: its hash; `None` without that file.
    """

    apps: tuple[str, ...] = ()
    platform: Platform | None = None
    entries: tuple[KnowledgeEntry, ...] = ()
    sha256: str | None = None

    def complete(
        self, items: Iterable[Trajectory | Rejected], excluded: list[str] | None = None
    ) -> Iterator[Trajectory | Rejected]:
        """Yield the items with completed trajectories, then a rejection for each unused entry.

        Args:
            items: what the source contains.
            excluded: takes up the ids of trajectories to which the option `apps` does not apply,
                because their instruction names another program.

        Raises:
            BuildError: a trajectory states other applications than the option `apps`.
        """
        excluded = [] if excluded is None else excluded
        used_entries: set[KnowledgeEntry] = set()
        for item in items:
            if isinstance(item, Rejected):
                yield item
            else:
                yield self._completed(item, used_entries, excluded)
        for entry in self.entries:
            if entry not in used_entries:
                match = f"{entry.match!r} matches no trajectory"
                reason = f"{match}; give an id, or a pattern with * and ?"
                yield Rejected(SIDECAR, entry.location, "match", reason)

    def parameters(self) -> dict[str, Any]:
        """Return the parameters for the manifest; empty if the user gave nothing."""
        facts = {"apps": list(self.apps), "platform": self.platform, "file_sha256": self.sha256}
        known_facts = {key: value for key, value in facts.items() if value}
        return {RECORDINGS: known_facts} if known_facts else {}

    def _completed(
        self, trajectory: Trajectory, used_entries: set[KnowledgeEntry], excluded: list[str]
    ) -> Trajectory:
        fitting = [entry for entry in self.entries if _matches(trajectory.id, entry.match)]
        used_entries.update(fitting)
        apps = next((entry.apps for entry in fitting if entry.apps), ())
        platform = next((entry.platform for entry in fitting if entry.platform), None)
        if not apps and self.apps:
            apps = self._apps_for(trajectory, excluded)
        recorded_platform = stated_platform(trajectory)
        if platform is None and (
            recorded_platform is None or (recorded_platform == "linux" and self.platform == OURS)
        ):
            platform = self._platform_for(trajectory)  # `linux` does not say which desktop it is
        if not apps and platform is None:
            return trajectory
        return replace(
            trajectory, apps=apps or trajectory.apps, platform=platform or trajectory.platform
        )

    def _platform_for(self, trajectory: Trajectory) -> Platform | None:
        """Return the platform of the option, unless the pictures are known to show another kind."""
        screen = stated_screen(trajectory)
        if self.platform is None or screen in (None, SCREENS.get(self.platform, "desktop")):
            return self.platform
        return None

    def _apps_for(self, trajectory: Trajectory, excluded: list[str]) -> tuple[str, ...]:
        """Return the applications of the option for a trajectory; none if it has its own.

        Raises:
            BuildError: its own are others.
        """
        recorded_apps = collect_apps(trajectory.apps, trajectory.domain)
        if recorded_apps and not any(self._covers(name) for name in recorded_apps):
            raise BuildError(
                f"apps {','.join(self.apps)}: trajectory {trajectory.id!r} states"
                f" {', '.join(sorted(recorded_apps))}; the option speaks for every trajectory:"
                " leave it out, and list the applications by trajectory in agenthijack.yaml"
            )
        if recorded_apps:
            return ()
        if not all(map(self._covers, mentioned_programs(trajectory.instruction))):
            excluded.append(trajectory.id)
            return ()
        return self.apps

    def _covers(self, name: str) -> bool:
        """Return whether an application may be one of those of the option."""
        return any(may_be_same(name, app) for app in self.apps)


def _matches(name: str, pattern: str) -> bool:
    """Return whether a trajectory's id fits a pattern with `*` and `?`; brackets are letters."""
    return fnmatchcase(name, pattern.replace("[", "[[]"))


def read_knowledge(
    source: Path, apps: Sequence[str] | str | None = None, platform: str | None = None
) -> Knowledge:
    """Return the facts that options and the source's own file state.

    Args:
        source: the file or folder that is read; `agenthijack.yaml` is in the folder, or next to the
            file.
        apps: names of applications, as a sequence or separated by commas.
        platform: one of `hijack_data.types.Platform`.

    Raises:
        ConfigError: a mistake in the file; the message names place and remedy.
        ParameterError, ParameterTypeError: a mistake in the options.
        SourceError: the file cannot be read.
    """
    entries, digest = _sidecar(source_root(source))
    checked_platform = None if platform is None else as_platform(platform, "platform")
    return Knowledge(_apps(apps), checked_platform, entries, digest)


def _apps(value: object) -> tuple[str, ...]:
    if value is None:
        return ()
    listed = value.split(",") if isinstance(value, str) else value
    if not isinstance(listed, Iterable):
        raise ParameterTypeError(
            f"apps must be names of applications, such as 'chrome,vscode', got {value!r:.80}"
        )
    return tuple(_app(name) for name in cast("Iterable[object]", listed))


def _app(name: object) -> str:
    # A name that is close to a known one is taken for a typing error.
    if not isinstance(name, str):
        raise ParameterTypeError(
            f"apps must be names of applications, such as 'chrome,vscode', got {name!r:.80}"
        )
    normalized = normalize_app(name)
    if not normalized:
        raise ParameterError(
            "apps holds an empty name; write the names separated by commas: chrome,vscode"
        )
    close = difflib.get_close_matches(normalized, sorted(KNOWN), n=1, cutoff=MIN_SIMILARITY)
    if normalized not in KNOWN and close:
        raise ParameterError(
            f"apps: {name!r} is not an application that is known; did you mean {close[0]!r}?"
        )
    return normalized


def _sidecar(root: Path) -> tuple[tuple[KnowledgeEntry, ...], str | None]:
    if not os.path.lexists(root / SIDECAR):
        return (), None
    try:
        path = inside(root, SIDECAR, "")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FieldError as error:
        raise SourceError(f"{SIDECAR}: {error.reason}") from None
    except OSError as error:
        raise SourceError(f"{root / SIDECAR}: cannot be read ({error.strerror or error})") from None
    if len(data) > MAX_BYTES:
        raise SourceError(
            f"{root / SIDECAR}: larger than {MAX_BYTES} bytes; say more with fewer patterns"
        )
    problems = Problems()
    tree = read_yaml(data, os.fspath(root / SIDECAR), problems)
    if tree is None:
        problems.stop(
            Position(os.fspath(root / SIDECAR), 1, 1),
            f"is empty; write a list under the key {RECORDINGS}",
        )
    entries = [_entry(item, problems) for item in _items(tree, problems)]
    problems.check()
    return tuple(entry for entry in entries if entry), hashlib.sha256(data).hexdigest()


def _items(tree: ConfigNode, problems: Problems) -> list[ConfigNode]:
    listed = tree.items.get(RECORDINGS) if isinstance(tree, MappingNode) else None
    if not isinstance(listed, SequenceNode):
        problems.stop(
            tree.position,
            f"write a list under the key {RECORDINGS}: of entries with match, apps and platform",
        )
    for key, position in cast("MappingNode", tree).keys.items():
        if key != RECORDINGS:
            problems.add(position, f"unknown key {key!r}{suggest(key, [RECORDINGS])}")
    return listed.items


def _entry(tree: ConfigNode, problems: Problems) -> KnowledgeEntry | None:
    """Return an entry, or note the problems of a broken one."""
    if not isinstance(tree, MappingNode):
        problems.add(
            tree.position,
            f"an entry is a mapping with match, apps and platform, got {describe_node(tree)}",
        )
        return None
    for key, position in tree.keys.items():
        if key not in FIELDS:
            problems.add(position, f"unknown key {key!r}{suggest(key, FIELDS)}")
    match = _text(tree.items.get("match"))
    if match is None:
        problems.add(
            tree.position,
            "match is missing; write the id of a trajectory, or a pattern such as match:"
            ' "chrome/*"',
        )
    if "apps" not in tree.items and "platform" not in tree.items:
        problems.add(tree.position, "says nothing; give apps, platform or both")
    apps = _listed_apps(tree.items.get("apps"), problems)
    platform = _listed_platform(tree.items.get("platform"), problems)
    position = tree.position
    return KnowledgeEntry(
        match or "", apps, platform, f"line {position.line}" if position.line else RECORDINGS
    )


def _listed_apps(tree: ConfigNode | None, problems: Problems) -> tuple[str, ...]:
    if tree is None:
        return ()
    names = [_text(item) for item in tree.items] if isinstance(tree, SequenceNode) else [None]
    if not names or None in names:
        problems.add(
            tree.position,
            f"apps must be a list of names such as [chrome, vscode], got {describe_node(tree)}",
        )
        return ()
    try:
        return _apps(names)
    except ParameterError as error:
        problems.add(tree.position, str(error))
        return ()


def _listed_platform(tree: ConfigNode | None, problems: Problems) -> Platform | None:
    if tree is None:
        return None
    name = _text(tree)
    platform = find_platform(name)
    if platform is None:
        problems.add(
            tree.position, f"unknown platform {describe_node(tree)}{suggest(name or '', PLATFORMS)}"
        )
    return platform


def _text(tree: ConfigNode | None) -> str | None:
    if not isinstance(tree, ScalarNode) or not isinstance(tree.value, str):
        return None
    return tree.value if tree.value.strip() else None
