"""The manifest of an image: what it was made of, and the checksum of every file in it.

An image's id is a digest of its manifest, which holds no time, no address and no path of a machine:
images with the same id have the same content.
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hijack_data.file_io import check_versioned, read_versioned_json

from ...errors import DesktopImageError

FORMAT = "agenthijack-desktop-image"
VERSION = 1
NAME = "manifest.json"
FILES = "files.jsonl"
DESCRIPTION = "the manifest of a desktop image"
ID_DIGITS = 16


@dataclass(frozen=True)
class Pin:
    """A package of Debian, or a Python package for the guest server.

    Attributes:
        name: of the package.
        version: of the package.
        sha256: of its file; for a Python package, of the list of its files.
    """

    name: str
    version: str
    sha256: str


@dataclass(frozen=True)
class Manifest:
    """What an image consists of.

    Attributes:
        suite: the release of Debian.
        architecture: Debian's name of it, such as `amd64`.
        profiles: whose packages it has.
        trust: how the packages are known to be Debian's: `signature`, `tls` or `none`.
        packages: of Debian, by name.
        python: packages for the guest server, by name.
        files: how many files, links and folders there are.
        size: of all files in bytes.
        files_sha256: of the list of the files (`files.jsonl`).
    """

    suite: str
    architecture: str
    profiles: tuple[str, ...]
    trust: str
    packages: tuple[Pin, ...]
    python: tuple[Pin, ...]
    files: int
    size: int
    files_sha256: str

    def to_json(self) -> str:
        """JSON with one package a line, so that manifests can be compared by `diff`."""
        return json.dumps({"format": FORMAT, "version": VERSION, **asdict(self)}, indent=1) + "\n"

    @property
    def id(self) -> str:
        """16 hexadecimal digits of the SHA-256 of the manifest."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:ID_DIGITS]

    @property
    def summary(self) -> str:
        """One line about it, for people."""
        names = ", ".join(self.profiles)
        return f"{self.suite} {self.architecture}, profiles {names}, {self.size / 1e6:.0f} MB"


def read(path: Path) -> Manifest:
    """Read a manifest.

    Raises:
        DesktopImageError: It is missing, or no manifest, or of a later version.
    """
    data = read_versioned_json(
        path, format=FORMAT, version=VERSION, description=DESCRIPTION, error=DesktopImageError
    )
    return _from_json(data, str(path))


def parse(text: bytes, label: str) -> Manifest:
    """Return the manifest in the JSON `text`; `label` begins the messages.

    Raises:
        DesktopImageError: It is no manifest, or of a later version.
    """
    try:
        data: object = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DesktopImageError(f"{label}: is not JSON ({error})") from None
    checked = check_versioned(
        data,
        format=FORMAT,
        version=VERSION,
        source=label,
        description=DESCRIPTION,
        error=DesktopImageError,
    )
    return _from_json(checked, label)


def _from_json(data: dict[str, Any], label: str) -> Manifest:
    fields = {name: value for name, value in data.items() if name not in ("format", "version")}
    try:
        fields["profiles"] = tuple(fields["profiles"])
        for name in ("packages", "python"):
            fields[name] = _parts(fields[name])
        return Manifest(**fields)
    except (KeyError, TypeError) as error:
        raise DesktopImageError(
            f"{label}: {DESCRIPTION} lacks a field or has a wrong one: {error}"
        ) from None


def _parts(entries: Iterable[dict[str, str]]) -> tuple[Pin, ...]:
    return tuple(Pin(**entry) for entry in entries)
