"""OSWorld's own Python environment: made by one command, and as small as the tasks allow."""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hijack_data.errors import ParameterError, suggest

from .errors import OsworldError

HERE = Path(__file__).resolve().parent
PACKAGE = "desktop-env==1.0.2"
TIERS = ("tiny", "lean", "mid", "full")
# What OSWorld's own providers import, at any version: none of it touches scores.
PROVIDER_PACKAGES = {
    "docker": ("docker", "filelock", "psutil", "tqdm"),
    "vmware": ("filelock", "psutil", "tqdm"),
    "virtualbox": ("filelock", "psutil", "tqdm"),
    "aws": ("boto3", "python-dotenv"),
    "azure": ("azure-identity", "azure-mgmt-compute", "azure-mgmt-network", "boto3", "psutil"),
    "daytona": ("daytona",),
}
_DATA = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share")
DEFAULT = _DATA / "agenthijack" / "osworld"
STAMP = "agenthijack.json"


@dataclass(frozen=True)
class VenvReport:
    """The result of `make`.

    Args:
        folder: The environment's folder.
        tier: Its tier.
        megabytes: Its size on disk, in 10**6 bytes.
        fresh: Whether anything was installed now.
    """

    folder: Path
    tier: str
    megabytes: float
    fresh: bool


def find_python(folder: Path) -> Path:
    """Return the interpreter of an environment made by `make`.

    Raises:
        OsworldError: There is none; the message has the command that makes it.
    """
    python = folder / "bin" / "python"
    if not (folder / STAMP).is_file() or not python.exists():
        command = f"hijack osworld setup --venv {folder}"
        raise OsworldError(f"no OSWorld environment in {folder}; make it with: {command}")
    return python


def installed_tier(folder: Path) -> str | None:
    """Return the tier installed in `folder`, or `None` if there is none or it is incomplete."""
    try:
        record = json.loads((folder / STAMP).read_text(encoding="utf-8"))
        tier = record["tier"]
        return tier if record["requirements"] == _requirements(tier) else None
    except (OSError, ValueError, KeyError, TypeError, ParameterError):
        return None


def make(
    folder: Path = DEFAULT,
    tier: str = "tiny",
    python: str = sys.executable,
    providers: Iterable[str] = (),
    osworld: Path | None = None,
) -> VenvReport:
    """Make the environment, or bring it to `tier`; a second call finds it and installs nothing.

    `desktop-env` goes in without its own pins (they conflict with NumPy 2 and bring 7 GB), then the
    tier's packages.

    Args:
        folder: Where.
        tier: One of `TIERS`.
        python: The interpreter that it is made with.
        providers: Names in `PROVIDER_PACKAGES`, whose packages are installed as well.
        osworld: A checkout of OSWorld, whose `desktop_env` replaces the one from PyPI: it may have
            providers that a release lacks. By default that of the last call, if it had one.

    Raises:
        OsworldError: pip fails, or the folder cannot be written.
    """
    requirements = _requirements(tier)
    if installed_tier(folder) == tier and not providers and osworld is None:
        return VenvReport(folder, tier, size_mb(folder), False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Written last, so that an interrupted install does not count as complete.
        osworld = osworld or _last_checkout(folder)
        (folder / STAMP).unlink(missing_ok=True)
        _install(folder, tier, python)
        extra = [package for name in providers for package in PROVIDER_PACKAGES[name]]
        if extra:
            _pip(folder, *dict.fromkeys(extra))
        if osworld is not None:
            _pip(folder, "--no-deps", "--force-reinstall", str(osworld))
        source = {} if osworld is None else {"osworld": str(osworld.resolve())}
        record = json.dumps({"tier": tier, "requirements": requirements, **source})
        (folder / STAMP).write_text(f"{record}\n", encoding="utf-8")
    except OSError as error:
        raise OsworldError(
            f"{folder}: the environment can't be made there ({error.strerror or error})"
        ) from None
    return VenvReport(folder, tier, size_mb(folder), True)


def _last_checkout(folder: Path) -> Path | None:
    """Return the checkout of OSWorld that is installed; the tier's packages would replace it."""
    try:
        return Path(json.loads((folder / STAMP).read_text(encoding="utf-8"))["osworld"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def judging_code(folder: Path) -> dict[str, str] | None:
    """Return path and SHA-256 of the installed code of OSWorld that sets tasks up and judges them.

    `None` if there is none. Providers of machines are left out.
    """
    package = next(folder.glob("lib/python*/site-packages/desktop_env"), None)
    if package is None:
        return None
    hasher = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package).as_posix()
        if not name.startswith("providers/"):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            hasher.update(f"{name}\0{content}\n".encode())
    return {"path": str(package), "sha256": hasher.hexdigest()}


def _install(folder: Path, tier: str, python: str) -> None:
    if not (folder / "bin" / "python").exists():
        _call([python, "-m", "venv", str(folder)])
    _pip(folder, "--no-deps", PACKAGE)
    _pip(folder, "-r", str(HERE / f"requirements-{tier}.txt"))


def _pip(folder: Path, *words: str) -> None:
    interpreter = str(folder / "bin" / "python")
    command = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    _call([interpreter, *command, *words])


def size_mb(folder: Path) -> float:
    """Return the size of a folder in MB (10**6 bytes), links not followed."""
    size = 0
    for path in folder.rglob("*"):
        if path.is_symlink() or not path.is_dir():
            size += path.lstat().st_size
    return size / 1e6


def _requirements(tier: str) -> str:
    if tier not in TIERS:
        raise ParameterError(f"no tier {tier!r}{suggest(tier, TIERS)}")
    text = (HERE / f"requirements-{tier}.txt").read_text(encoding="utf-8")
    included = ""
    for line in text.splitlines():
        if "-r " in line:
            included += _requirements(line.partition("requirements-")[2].removesuffix(".txt"))
    return included + text


def _call(command: list[str]) -> None:
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        tail = " | ".join((result.stderr or result.stdout).strip().splitlines()[-5:])
        line = " ".join(command)
        raise OsworldError(f"`{line}` failed with exit code {result.returncode}: {tail}")
