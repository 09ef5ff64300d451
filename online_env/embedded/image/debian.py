"""Debian's package indices: versions in order, and what a set of packages needs.

The order of versions is that of deb-version(7), the fields those of deb-control(5). Where a
dependency leaves a choice, it is made as `apt-get --no-install-recommends` makes it: what is chosen
anyway, else the first.
"""

import re
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ...errors import DesktopImageError

ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64"}
_FIELD = re.compile(r"^([A-Z][A-Za-z0-9-]*):[ \t]*(.*)$", re.M)
_ALTERNATIVE_END = re.compile(r"[\s(:\[]")


@dataclass(frozen=True)
class Package:
    """One version of a package, as an index lists it.

    Attributes:
        name: of the package.
        version: of the package.
        sha256: of its file, hexadecimal.
        size: of its file in bytes.
        url: where its file is.
        needs: what it depends on; each entry lists alternatives.
        provides: names that it stands for, its own included.
        is_base: whether every Debian has it (`Essential: yes` or `Priority: required`).
    """

    name: str
    version: str
    sha256: str
    size: int
    url: str
    needs: tuple[tuple[str, ...], ...] = ()
    provides: tuple[str, ...] = ()
    is_base: bool = False


def parse(text: str, base: str) -> list[Package]:
    """Return the packages of an index.

    Args:
        text: content of a `Packages` file.
        base: URL of the archive, without a slash at the end.

    Raises:
        DesktopImageError: A stanza lacks a field.
    """
    packages: list[Package] = []
    for stanza in text.split("\n\n"):
        fields = dict(_FIELD.findall(stanza))
        if fields:
            packages.append(_package(fields, base))
    return packages


def _package(fields: Mapping[str, str], base: str) -> Package:
    try:
        name = fields["Package"]
        needs = [*_needs(fields.get("Pre-Depends", "")), *_needs(fields.get("Depends", ""))]
        is_base = fields.get("Essential") == "yes" or fields.get("Priority") == "required"
        return Package(
            name=name,
            version=fields["Version"],
            sha256=fields["SHA256"],
            size=int(fields["Size"]),
            url=f"{base}/{fields['Filename']}",
            needs=tuple(needs),
            provides=(name, *_names(fields.get("Provides", ""), ",")),
            is_base=is_base,
        )
    except (KeyError, ValueError) as error:
        raise DesktopImageError(
            f"{base}: an index entry of {fields.get('Package', '?')!r} lacks a field or has a"
            f" wrong one ({error}); is it a Debian archive?"
        ) from None


def _needs(text: str) -> list[tuple[str, ...]]:
    groups: list[tuple[str, ...]] = []
    for item in text.split(","):
        names = _names(item, "|")
        if names:
            groups.append(names)
    return groups


def _names(text: str, separator: str) -> tuple[str, ...]:
    parts = (part.strip() for part in text.split(separator))
    return tuple(_ALTERNATIVE_END.split(part)[0] for part in parts if part)


def compare(a: str, b: str) -> int:
    """Compare two versions as dpkg does; returns -1, 0 or 1."""
    first = _split(a)
    second = _split(b)
    if first[0] != second[0]:
        return 1 if first[0] > second[0] else -1
    return _compare_part(first[1], second[1]) or _compare_part(first[2], second[2])


def _split(version: str) -> tuple[int, str, str]:
    epoch, colon, remainder = version.partition(":")
    if not colon:
        epoch, remainder = "0", version
    upstream, dash, revision = remainder.rpartition("-")
    if not dash:
        upstream, revision = remainder, "0"
    return int(epoch), upstream, revision


def _compare_part(a: str, b: str) -> int:
    first = _pieces(a)
    second = _pieces(b)
    length = max(len(first), len(second))
    first += [((0,), 0)] * (length - len(first))
    second += [((0,), 0)] * (length - len(second))
    if first == second:
        return 0
    return 1 if first > second else -1


def _pieces(text: str) -> list[tuple[tuple[int, ...], int]]:
    """Runs of other characters, each with the number after it, in values that compare rightly."""
    pieces: list[tuple[tuple[int, ...], int]] = []
    for words, digits in re.findall(r"(\D*)(\d*)", text):
        if words or digits:
            # The end of a run sorts after `~` and before everything else.
            weights = (*map(_weight, words), 0)
            pieces.append((weights, int(digits or 0)))
    return pieces


def _weight(letter: str) -> int:
    if letter == "~":
        return -1
    return ord(letter) if letter.isalpha() else ord(letter) + 256


@dataclass
class PackageIndex:
    """The newest version of each package of some archives.

    Attributes:
        best: by name.
        providers: names of packages by what they stand for.
    """

    best: dict[str, Package] = field(default_factory=dict)
    providers: dict[str, list[str]] = field(default_factory=dict)

    @classmethod
    def of(cls, packages: Iterable[Package]) -> "PackageIndex":
        """Return the index of `packages`, in which a name may come several times."""
        index = cls()
        for package in packages:
            old = index.best.get(package.name)
            if old is None or compare(package.version, old.version) > 0:
                index.best[package.name] = package
        for package in index.best.values():
            for name in package.provides:
                index.providers.setdefault(name, []).append(package.name)
        return index

    def base(self) -> list[str]:
        """Return the names of what every Debian has."""
        return sorted(name for name, package in self.best.items() if package.is_base)

    def closure(self, requested: Iterable[str]) -> list[Package]:
        """`requested` with all that they need, in the order of their names.

        Raises:
            DesktopImageError: Nothing provides one of them.
        """
        selection: dict[str, Package] = {}
        provided: set[str] = set()
        queue: deque[tuple[str, ...]] = deque((name,) for name in requested)
        choices: deque[tuple[str, ...]] = deque()
        while queue or choices:
            # What leaves no choice comes first: it may settle the choices.
            names = queue.popleft() if queue else choices.popleft()
            if provided.intersection(names):
                continue
            package = self._pick(names)
            selection[package.name] = package
            provided.update(package.provides)
            for need in package.needs:
                has_choice = len(need) > 1 or not self.best.keys() >= {*need}
                (choices if has_choice else queue).append(need)
        return [selection[name] for name in sorted(selection)]

    def _pick(self, names: tuple[str, ...]) -> Package:
        real = [name for name in names if name in self.best]
        if real:
            return self.best[real[0]]
        virtual = [provider for name in names for provider in self.providers.get(name, ())]
        if not virtual:
            raise DesktopImageError(
                f"no package provides {' or '.join(names)} in the archives that were read; are all"
                " of Debian 12's suites among the sources?"
            )
        return self.best[min(virtual, key=lambda name: (len(name), name))]
