"""What a test needs of the machine: each of these skips, with the command that adds what is
lacking.

The functions are for fixtures and for what is known only while a test runs; `needs_apps`,
`needs_tools` and `needs_memory` are marks.
"""

import functools
import os
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from online_env.browser.chromium import find_program
from online_env.embedded import doctor, packages
from online_env.errors import MissingPackageError
from online_env.osworld import venv

from . import gnome_machine

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Programs whose packages have other names; all that is in no profile's list is a part of core.
PACKAGES = {"libreoffice": "libreoffice-writer", "soffice": "libreoffice-writer"}
# From the root of a clone, whether or not its environment is active.
HIJACK = ".venv/bin/hijack"
ONLINE = "needs the extra [online]; .venv/bin/pip install -e '.[online]'"
RAY = "needs the extra [ray]; .venv/bin/pip install -e '.[ray]'"
HF = "needs the extra [hf]; .venv/bin/pip install -e '.[hf]'"
OCR = "needs the extra [ocr]; .venv/bin/pip install -e '.[ocr]'"
BROWSER = "needs the extra [browser]; .venv/bin/pip install -e '.[browser]'"
PLAYWRIGHT = "needs Playwright; .venv/bin/pip install playwright"
WEBSOCKET = "needs websocket-client; .venv/bin/pip install websocket-client"
BROWSERGYM = "needs browsergym-miniwob, in an environment of its own"
AGENTLAB = "needs agentlab, in an environment of its own"
MCP = "needs the extra [mcp]; .venv/bin/pip install -e '.[mcp]'"
SERVE = "needs the extra [serve]; .venv/bin/pip install -e '.[serve]'"
SEARCH = "needs the extra [search]; .venv/bin/pip install -e '.[search]'"
INSPECT = "needs the extra [inspect]; .venv/bin/pip install -e '.[inspect]'"
TRL = "needs the extra [trl]; .venv/bin/pip install -e '.[trl]'"
VERL = "needs verl 0.9 and TransferQueue in an environment of their own, see docs/train.md"


def profile_of(program: str) -> str:
    """The profile of desktops that brings a program."""
    package = PACKAGES.get(program, program)
    matches = [name for name, names in packages.PROFILES.items() if package in names]
    return matches[0] if matches else "core"


def install_line(program: str) -> str:
    """The command that installs a program of a desktop."""
    return f"{HIJACK} desktop install --profile {profile_of(program)}"


def skip(why: str, command: str) -> NoReturn:
    """Skip a test: why, and the command that mends it."""
    pytest.skip(f"{why}; {command}")


def absent(programs: Iterable[str]) -> list[str]:
    """Those of `programs` that are not on the PATH, nor where root's programs are."""
    places = os.pathsep.join([os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"])
    return [name for name in programs if shutil.which(name, path=places) is None]


def lack_of_apps(*programs: str) -> str:
    """Why applications cannot be used; empty where all are there."""
    missing_programs = absent(programs)
    if not missing_programs:
        return ""
    lines = dict.fromkeys(install_line(name) for name in missing_programs)
    return f"not installed: {', '.join(missing_programs)}; {' and '.join(lines)}"


def lack_of_memory(gib: float) -> str:
    """Why something large does not fit; empty where `gib` GiB of memory are free."""
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        name, _, description = line.partition(":")
        if name == "MemAvailable":
            free = int(description.split()[0]) / 2**20
            return (
                ""
                if free >= gib
                else f"needs {gib:g} GiB of free memory, {free:.1f} are; end something"
            )
    return "this system does not say how much memory is free"


def needs_apps(*programs: str) -> Any:
    """The test uses these applications, which a desktop takes from the machine."""
    why = lack_of_apps(*programs)
    return pytest.mark.skipif(bool(why), reason=why)


def needs_tools(*programs: str) -> Any:
    """The test calls these programs of the machine."""
    missing_programs = absent(programs)
    why = f"not installed: {', '.join(missing_programs)}; apt-get install {' '.join(missing_programs)}"
    return pytest.mark.skipif(bool(missing_programs), reason=why)


def needs_memory(gib: float) -> Any:
    """The test fills as much memory."""
    why = lack_of_memory(gib)
    return pytest.mark.skipif(bool(why), reason=why)


def apps(*programs: str) -> None:
    """Skip where one of these applications is not installed."""
    why = lack_of_apps(*programs)
    if why:
        pytest.skip(why)


def chromium() -> None:
    """Skip where no Chromium is installed."""
    try:
        find_program()
    except MissingPackageError as error:
        pytest.skip(str(error))


def gnome() -> None:
    """Skip where there is no machine with GNOME."""
    why = gnome_machine.lack()
    if why:
        pytest.skip(why)


def root(what: str) -> None:
    """Skip where we are not root."""
    if os.geteuid() != 0:
        skip(f"{what} needs root", "sudo .venv/bin/python -m pytest tests/live")


@functools.lru_cache(maxsize=1)
def lack_of_desktop() -> str:
    """Why embedded desktops cannot run here; empty where they can."""
    for check in doctor.diagnose(("core",)):
        if check.required and not check.ok and check.name != "golden home":
            return f"no embedded desktop here: {shorter(check.name, check.detail)}; {check.fix}"
    return ""


def shorter(name: str, detail: str) -> str:
    """A finding of the doctor without its list of packages."""
    return f"{name}: {detail.partition(':')[0]}"


def desktop() -> None:
    """Skip where embedded desktops cannot run."""
    if lack_of_desktop():
        pytest.skip(lack_of_desktop())


def browser() -> str:
    """The name of the browser of this machine; skips where there is none."""
    result = next((name for name in BROWSERS if shutil.which(name)), None)
    if result is None:
        skip("no browser here", install_line("chromium"))
    return result


def network_namespaces() -> None:
    """Skip where this process may not make network namespaces."""
    if absent(["unshare", "ip"]):
        skip("not installed: ip or unshare", install_line("iproute2"))
    if subprocess.run(["unshare", "-n", "true"], capture_output=True, check=False).returncode:
        skip(
            "no network namespaces here", "run as root, in a container with docker run --privileged"
        )


def osworld() -> Path:
    """The folder of OSWorld's own environment; skips where there is none."""
    path = Path(os.environ.get("AGENTHIJACK_OSWORLD_VENV", venv.DEFAULT))
    if venv.installed_tier(path) is None:
        skip(f"OSWorld's environment is not in {path}", f"{HIJACK} osworld setup")
    return path


def osworld_at_default() -> None:
    """Skip where OSWorld's environment is not in its default folder, which `hijack bench` uses."""
    if osworld() != venv.DEFAULT:
        skip(f"OSWorld's environment is not in {venv.DEFAULT}", f"{HIJACK} osworld setup")
