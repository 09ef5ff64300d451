"""Where packages come from: Debian 12 archives of the machine's apt configuration, or a mirror.

Each suite's `InRelease` is checked with `gpgv`; it holds the checksums of the indices, and those
hold the checksums of the packages (apt-secure(8)).
"""

import hashlib
import lzma
import re
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from email import message_from_string
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit

from hijack_data.file_io import write_atomic

from ...errors import DesktopImageError
from . import debian

SUITE = "bookworm"
COMPONENT = "main"
APT = Path("/etc/apt")
KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
SCHEMES = ("http", "https", "file")
TRIES = 4
ANSWER_TIMEOUT_S = 60.0  # s for an answer
AT_ONCE = 8
# How the archives are known to be Debian's; the weakest of all sources goes into the manifest.
TRUST = ("none", "tls", "signature")
Report = Callable[[str], None]


@dataclass(frozen=True)
class AptSource:
    """One suite of one archive.

    Attributes:
        url: of the archive, without a slash at the end.
        suite: of the archive, such as `bookworm-updates`.
        keyring: the keys that may have signed it; `None` if there is no such file.
    """

    url: str
    suite: str
    keyring: Path | None


def from_machine(apt: Path = APT) -> list[AptSource]:
    """Return the Debian 12 archives in the machine's apt configuration.

    Raises:
        DesktopImageError: There is none, as on every other distribution.
    """
    paths = [apt / "sources.list", *sorted((apt / "sources.list.d").glob("*"))]
    archives: list[AptSource] = []
    for path in paths:
        if path.suffix not in (".list", ".sources") or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        archives += _stanzas(text) if path.suffix == ".sources" else _lines(text)
    if not archives:
        raise DesktopImageError(
            f"{apt} names no archive of Debian 12 ({SUITE}); give one with --mirror URL"
        )
    return list(dict.fromkeys(archives))


def from_mirror(
    mirror: str, security: str | None = None, keyring: Path | None = None
) -> list[AptSource]:
    """Return the suites of a mirror of Debian.

    Args:
        mirror: URL of the archive: `http`, `https` or `file`.
        security: URL of the archive of security updates; without it there are none.
        keyring: the keys of the archive; Debian's, if not given.

    Raises:
        DesktopImageError: A URL has another scheme, or the keyring is missing.
    """
    if keyring is not None and not keyring.is_file():
        raise DesktopImageError(f"--keyring {keyring}: there is no such file")
    keys = keyring or _default_keyring()
    archives = [AptSource(_url(mirror), suite, keys) for suite in (SUITE, f"{SUITE}-updates")]
    if security:
        archives.append(AptSource(_url(security), f"{SUITE}-security", keys))
    return archives


def _url(text: str) -> str:
    if urlsplit(text).scheme not in SCHEMES:
        raise DesktopImageError(f"{text!r} must be a URL of {', '.join(SCHEMES)}")
    return text.rstrip("/")


def _default_keyring() -> Path | None:
    return KEYRING if KEYRING.is_file() else None


def _stanzas(text: str) -> list[AptSource]:
    """Sources in the format deb822 (sources.list(5))."""
    archives: list[AptSource] = []
    body = re.sub(r"^#.*\n?", "", text, flags=re.M)
    for stanza in re.split(r"\n\s*\n", body):
        fields = message_from_string(stanza.strip("\n"))  # values may go on in indented lines
        is_off = fields.get("Enabled", "yes").strip().lower() in ("no", "false", "0")
        if is_off or "deb" not in fields.get("Types", "").split():
            continue
        archives += _sources(
            fields.get("URIs", "").split(),
            fields.get("Suites", "").split(),
            fields.get("Components", "").split(),
            fields.get("Signed-By", "").strip(),
        )
    return archives


def _lines(text: str) -> list[AptSource]:
    """Sources in the format of one line each (sources.list(5))."""
    archives: list[AptSource] = []
    for line in re.findall(r"^\s*deb\s+(.*)$", text, re.M):
        options = re.match(r"\[([^]]*)\]\s*", line)
        remainder = line[options.end() :] if options else line
        url, suite, *components = [*remainder.partition("#")[0].split(), "", ""]
        signed = re.search(r"signed-by=(\S+)", options[1]) if options else None
        archives += _sources([url], [suite], components, signed[1] if signed else "")
    return archives


def _sources(
    urls: Iterable[str], suites: Iterable[str], components: Iterable[str], signed_by: str
) -> list[AptSource]:
    if COMPONENT not in components:
        return []
    keyring = Path(signed_by)
    key_file = keyring if signed_by.startswith("/") and keyring.is_file() else _default_keyring()
    accepted = [s for s in suites if s in (SUITE, f"{SUITE}-updates", f"{SUITE}-security")]
    return [
        AptSource(url.rstrip("/"), suite, key_file)
        for url in urls
        for suite in accepted
        if urlsplit(url).scheme in SCHEMES
    ]


def read(
    sources: Iterable[AptSource], architecture: str, unsigned: bool = False
) -> tuple[debian.PackageIndex, str]:
    """Read the indices of all sources.

    Args:
        sources: the suites.
        architecture: Debian's name of it, such as `amd64`.
        unsigned: take archives whose signature cannot be checked.

    Returns:
        What they offer, and how that is known to be Debian's: one of `TRUST`.

    Raises:
        DesktopImageError: An archive cannot be reached, is not signed, or is damaged.
    """
    packages: list[debian.Package] = []
    trust = TRUST[-1]
    for source in sources:
        release, trust_kind = _release(source, unsigned)
        trust = min(trust, trust_kind, key=TRUST.index)
        packages += debian.parse(_index(source, release, architecture), source.url)
    return debian.PackageIndex.of(packages), trust


def _release(source: AptSource, unsigned: bool) -> tuple[str, str]:
    url = f"{source.url}/dists/{source.suite}/InRelease"
    raw = fetch(url)
    if source.keyring is not None and shutil.which("gpgv"):
        checked = _check_signature(raw, source.keyring)
        if checked is not None:
            return checked, "signature"
        if not unsigned:
            raise DesktopImageError(
                f"{url}: its signature is not one of {source.keyring}; the archive was changed, or"
                " --keyring FILE is another one's"
            )
    if url.startswith("https:"):
        return raw.decode("utf-8", "replace"), "tls"
    if not unsigned:
        raise DesktopImageError(
            f"{url}: its signature cannot be checked, for lack of gpgv or of {KEYRING}; install"
            " them, give a mirror with https, or accept it with --unsigned"
        )
    return raw.decode("utf-8", "replace"), "none"


def _check_signature(raw: bytes, keyring: Path) -> str | None:
    """Return the text that was signed, or `None` where no key of `keyring` signed it."""
    with tempfile.TemporaryDirectory(prefix="agenthijack-release-") as folder:
        signed = Path(folder, "InRelease")
        release = Path(folder, "Release")
        signed.write_bytes(raw)
        command = ["gpgv", "--keyring", str(keyring), "--output", str(release), str(signed)]
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        if process.returncode != 0 or not release.exists():
            return None
        return release.read_text(encoding="utf-8", errors="replace")


def _index(source: AptSource, release: str, architecture: str) -> str:
    name = f"{COMPONENT}/binary-{architecture}/Packages.xz"
    _, _, sums = release.partition("\nSHA256:")
    line = re.search(rf"^ ([0-9a-f]{{64}}) +\d+ {re.escape(name)}$", sums, re.M)
    base = f"{source.url}/dists/{source.suite}"
    if line is None:
        raise DesktopImageError(f"{base}: its InRelease lists no {name}")
    data = fetch(f"{base}/{name}", line[1])
    try:
        return lzma.decompress(data).decode()
    except (lzma.LZMAError, UnicodeDecodeError) as error:
        raise DesktopImageError(f"{base}/{name}: is damaged ({error})") from None


def fetch(url: str, sha256: str | None = None) -> bytes:
    """Return the content behind `url`; tries a few times.

    Raises:
        DesktopImageError: It cannot be read, or has another checksum.
    """
    problem = ""
    for turn in range(TRIES):
        if turn:
            time.sleep(turn)
        try:
            with urllib.request.urlopen(url, timeout=ANSWER_TIMEOUT_S) as answer:
                data = answer.read()
        except urllib.error.HTTPError as error:
            if error.code in (403, 404, 410):
                raise DesktopImageError(f"{url}: {error.code} {error.reason}") from None
            problem = str(error)
            continue
        except (OSError, ValueError, HTTPException) as error:
            problem = str(error) or type(error).__name__
            continue
        digest = hashlib.sha256(data).hexdigest()
        if sha256 is None or digest == sha256:
            return data
        problem = f"its SHA-256 is {digest}, and the index says {sha256}"
    raise DesktopImageError(f"{url}: cannot be fetched ({problem}); is there a network?")


def fetch_packages(
    packages: Iterable[debian.Package], folder: Path, report: Report
) -> dict[str, Path]:
    """Fetch the files of packages, those that `folder` has already excepted.

    Args:
        packages: what to fetch.
        folder: where the files are kept, by checksum.
        report: called with a line of text at each step.

    Returns:
        The files by the names of their packages.

    Raises:
        DesktopImageError: One cannot be fetched.
        StorageError: The disk is full.
    """
    listed = sorted(packages, key=lambda package: -package.size)
    paths = {package.name: folder / f"{package.sha256}.deb" for package in listed}
    lacking = [package for package in listed if not _is_whole(paths[package.name], package)]
    size = sum(package.size for package in lacking)
    report(f"{len(listed)} packages, {len(lacking)} of them to fetch ({size / 1e6:.0f} MB)")

    def get(package: debian.Package) -> None:
        write_atomic(paths[package.name], fetch(package.url, package.sha256))

    with ThreadPoolExecutor(AT_ONCE) as threads:
        list(threads.map(get, lacking))
    return paths


def _is_whole(path: Path, package: debian.Package) -> bool:
    if not path.is_file() or path.stat().st_size != package.size:
        return False
    return hashlib.sha256(path.read_bytes()).hexdigest() == package.sha256
