"""The machines of a user for OSWorld's tasks: running ones, and those that OSWorld itself starts.

`machine` is the entry `osworld` in the registry of desktop providers.
"""

import contextlib
import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable, Generator, Mapping
from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from hijack_data.errors import HijackWarning, ParameterError, UnknownNameError, suggest
from hijack_data.locking import Lock, lock
from hijack_data.types import Size

from ..desktops.http import HttpDesktop
from ..desktops.osworld import OsworldDesktop
from ..errors import DesktopError, DesktopTimeoutError, MissingPackageError
from ..tasks.machines import MachineSettings, is_address
from . import venv
from .env import PROXIES, Address, OsworldEnv, OSWorldSettings

PROVIDERS = ("docker", "vmware", "virtualbox", "aws", "azure", "daytona")
FOLDER = venv.DEFAULT.parent / "osworld-machines"
# Their machines are made of files in that folder. OSWorld downloads, unpacks and names these
# without a lock: two starts at once write into one file, and one boots what the other unpacks.
LOCAL_PROVIDERS = ("docker", "vmware", "virtualbox")
START_LOCK = "start.lock"
LOG = "osworld.log"
PROGRAMS = {"vmware": "vmrun", "virtualbox": "VBoxManage"}  # which OSWorld calls by name
# What a provider needs beside its packages.
NEEDS: Mapping[str, str] = {
    "docker": "a Docker daemon that answers this user (docker info)",
    "vmware": "VMware Workstation, with vmrun on the PATH",
    "virtualbox": "VirtualBox, with VBoxManage on the PATH",
    "aws": "AWS_REGION, AWS_SUBNET_ID and AWS_SECURITY_GROUP_ID of an account, and its keys",
    "azure": "AZURE_SUBSCRIPTION_ID of an account, and a login (az login)",
    "daytona": "a checkout of OSWorld that has this provider (--osworld DIR)",
}
KVM = Path("/dev/kvm")
ANSWER_TIMEOUT_S = 300.0  # for a machine to answer after its reset
FIRST_ANSWER_TIMEOUT_S = 30.0  # for a machine that runs already
RESET_TIMEOUT_S = 900.0
POLL_S = 1.0
# What DesktopEnv takes, beside what this library decides.
OPTIONS: Mapping[str, type] = {
    "path_to_vm": str,
    "snapshot_name": str,
    "region": str,
    "headless": bool,
    "client_password": str,
    "enable_proxy": bool,
}
ANYWHERE = ("client_password", "enable_proxy")  # those that need no provider
PORTS = {"chromium": "chromium_port", "vnc": "vnc_port", "vlc": "vlc_port"}
# The ports by which the controller, the set-up of tasks and the evaluators reach a guest.
USED_PORTS = ("port", "chromium_port", "vlc_port")
NO_RESET = (
    "nothing makes this machine pristine between two episodes: the set-up of a task, the agent's"
    " actions and effects (another window, a touch, minimised windows, a locked screen, a closed"
    " network) leave traces on it. Give --reset-command 'COMMAND', which reverts its snapshot"
)


def read_options(texts: tuple[str, ...]) -> dict[str, str | bool]:
    """Return the arguments of `DesktopEnv` that texts such as `region=us-east-1` name.

    Raises:
        ParameterError: A text is no argument, or `DesktopEnv` takes none of that name.
    """
    options: dict[str, str | bool] = {}
    for text in texts:
        key, is_pair, value = text.partition("=")
        if not is_pair or key not in OPTIONS:
            raise ParameterError(
                f"--vm-option {text}: write KEY=VALUE with one of {', '.join(OPTIONS)}"
                f"{suggest(key, OPTIONS)}"
            )
        if OPTIONS[key] is not bool:
            options[key] = value
        elif value in ("true", "false"):
            options[key] = value == "true"
        else:
            raise ParameterError(f"--vm-option {text}: {key} is true or false")
    return options


def check(settings: MachineSettings, episodes: int, folder: Path = venv.DEFAULT) -> None:
    """Check that the machines of a run can be used; none is started or changed.

    Args:
        settings: The machines.
        episodes: How many episodes are played.
        folder: OSWorld's Python environment.

    Raises:
        ParameterError: The machines and their options don't go together.
        UnknownNameError: A provider's name is wrong.
        MissingPackageError: OSWorld's environment lacks a provider, or its packages or settings.
        DesktopError: A running machine does not answer.
    """
    addresses = [name for name in settings.vm if is_address(name)]
    providers = [name for name in settings.vm if not is_address(name)]
    if not settings.vm:
        raise ParameterError("--vm http://HOST:PORT or --vm PROVIDER: say which machines to use")
    for name in addresses:
        read_address(name)
    others = sorted(settings.options.keys() - set(ANYWHERE))
    if others and not providers:
        raise ParameterError(f"--vm-option {others[0]} is for providers, not for addresses")
    if len(set(settings.vm)) < len(settings.vm):
        raise ParameterError(f"--vm names a machine twice: {', '.join(settings.vm)}")
    _check_ports(addresses)
    if settings.count > 1 and not providers:
        raise ParameterError(
            "--machines is for providers that start machines; repeat --vm for each running machine"
        )
    is_one_disk = "path_to_vm" in settings.options and providers != ["docker"]
    if settings.count > 1 and is_one_disk:
        raise ParameterError(
            "--vm-option path_to_vm names one machine, which --machines can't start several times;"
            " leave it out, and OSWorld makes a copy for each"
        )
    if settings.reset_command and not addresses:
        raise ParameterError("--reset-command is for --vm http://..., providers revert themselves")
    if episodes > 1 and addresses and not settings.reset_command:
        raise ParameterError(f"--vm {addresses[0]}: {NO_RESET}")
    if settings.options.get("enable_proxy"):
        _check_proxies()
    for name in providers:
        if name not in PROVIDERS:
            raise UnknownNameError(
                f"--vm {name}: no such provider{suggest(name, PROVIDERS)}; known are"
                f" {', '.join(PROVIDERS)}, and addresses such as http://10.0.0.5:5000"
            )
    if "azure" in providers and "path_to_vm" not in settings.options:
        raise ParameterError(
            "--vm azure: OSWorld's provider makes no machine there; name yours by --vm-option"
            " path_to_vm=RESOURCE_GROUP/MACHINE"
        )
    if providers:
        _check_providers(providers, folder)
    for name in addresses:
        _wait_for_guest(name, FIRST_ANSWER_TIMEOUT_S)


def _check_ports(names: list[str]) -> None:
    """Check that no two running machines are reached by the same port of the same host.

    Episodes on the two would act on each other's screen, or be judged by each other's browser.

    Raises:
        ParameterError: Two are.
    """
    names_by_port: dict[tuple[str, int], str] = {}
    for name in names:
        address = read_address(name)
        for host in _resolve(address.host):
            for field in USED_PORTS:
                port = int(getattr(address, field))
                other = names_by_port.setdefault((host, port), name)
                if other != name:
                    raise ParameterError(
                        f"--vm {other} and {name}: both are reached by port {port} of"
                        f" {address.host}, so they would be one machine, or share a browser; leave"
                        " one of them out, or write the ports of each, such as"
                        " http://127.0.0.1:5001?chromium=9223&vlc=8081"
                    )


def _resolve(host: str) -> set[str]:
    """Return the IP addresses of a host; its name if nothing is known of it."""
    try:
        return {str(entry[4][0]) for entry in socket.getaddrinfo(host, None)}
    except OSError:
        return {host.lower()}


def _check_proxies() -> None:
    """Check that OSWorld's file of proxies has one.

    Raises:
        ParameterError: It has not.
    """
    place = os.environ.get(PROXIES, "")
    form = '[{"host": ..., "port": ..., "username": ..., "password": ...}]'
    try:
        proxies = json.loads(Path(place).read_text(encoding="utf-8"))
        has_proxy = bool(proxies) and all(proxy["host"] and proxy["port"] for proxy in proxies)
    except (OSError, ValueError, TypeError, KeyError) as error:
        problem = f"{place or 'no file'}: {type(error).__name__}: {error}"
    else:
        if has_proxy:
            return
        problem = f"{place}: no proxy"
    raise ParameterError(
        f"--vm-option enable_proxy=true: the variable {PROXIES} names the JSON file of your"
        f" proxies, {form} ({problem})"
    )


def _check_providers(names: list[str], folder: Path) -> None:
    for name in names:
        program = PROGRAMS.get(name)
        # OSWorld's providers would call it again and again until it succeeds.
        if program and not shutil.which(program):
            raise _provider_error(name, f"{program} is not on the PATH")
    with tempfile.TemporaryDirectory() as scratch:
        settings = OSWorldSettings(Path(scratch, "cache"))
        env = OsworldEnv(venv.find_python(folder), None, settings, Path(scratch, LOG))
        with contextlib.closing(env):
            for name in names:
                problem = env.check_provider(name)
                if problem:
                    raise _provider_error(name, problem)
    if "docker" in names and not KVM.exists():
        warnings.warn(
            f"--vm docker: {KVM} is not there, so OSWorld's machine is emulated; its provider"
            " waits 300 s for the screen, which that may take",
            HijackWarning,
            stacklevel=2,
        )


def _provider_error(name: str, problem: str) -> MissingPackageError:
    return MissingPackageError(
        f"--vm {name} can't be used here: {problem.rstrip('.')}. It needs {NEEDS[name]};"
        f" its packages come with: hijack osworld setup --provider {name}"
    )


def read_address(text: str) -> Address:
    """Return the address of a running machine.

    Args:
        text: Such as `http://10.0.0.5:5000`; `?chromium=9222&vnc=8006&vlc=8080` says other ports
            than OSWorld's.

    Raises:
        ParameterError: It is no such address.
    """
    problem = ParameterError(
        f"--vm {text}: an address is like http://10.0.0.5:5000 or, with other ports for the"
        " programs, http://127.0.0.1:5001?chromium=9223&vnc=8007&vlc=8081"
    )
    try:
        parts = urlsplit(text)
        ports = {key: int(value) for key, value in parse_qsl(parts.query, True, True)}
        port = parts.port or 5000
    except ValueError:
        raise problem from None
    is_plain = parts.scheme == "http" and not parts.path.strip("/") and "@" not in parts.netloc
    has_ports = ports.keys() <= PORTS.keys() and all(0 < n < 2**16 for n in ports.values())
    if not (parts.hostname and is_plain and has_ports):
        raise problem
    address = Address(parts.hostname, port, used=True)
    return replace(address, **{PORTS[key]: number for key, number in ports.items()})


class ResetByCommand:
    """Makes a running machine pristine by the user's command.

    Args:
        name: The machine's address as the user wrote it.
        command: The shell command. It gets the address as `AGENTHIJACK_VM`; if its last line is an
            address, the machine is there from now on. "" for none.
    """

    def __init__(self, name: str, command: str) -> None:
        self._name = name
        self._command = command
        self._is_first = True
        # Without a command it is played once, as its user left it.
        self._address = replace(read_address(name), used=bool(command))

    def __call__(self) -> Address:
        """Return the machine's address; from the second call on, after its reset.

        Raises:
            DesktopError: There is no command, it fails, or the machine does not answer afterwards.
        """
        if self._is_first:
            self._is_first = False
            return self._address
        if not self._command:
            raise DesktopError(f"{self._name}: {NO_RESET}")
        address = self._run() or self._name
        self._address = _wait_for_guest(address, ANSWER_TIMEOUT_S)
        return self._address

    def _run(self) -> str:
        try:
            result = subprocess.run(
                self._command,
                shell=True,
                capture_output=True,
                text=True,
                errors="replace",
                stdin=subprocess.DEVNULL,
                timeout=RESET_TIMEOUT_S,
                check=False,
                env={**os.environ, "AGENTHIJACK_VM": self._name},
            )
        except subprocess.TimeoutExpired:
            raise DesktopTimeoutError(
                f"--reset-command for {self._name} took over {RESET_TIMEOUT_S:.0f} s"
            ) from None
        if result.returncode != 0:
            text = (result.stderr or result.stdout).strip()[-300:]
            raise DesktopError(
                f"--reset-command for {self._name} ended with exit code {result.returncode}: {text}"
            )
        lines = result.stdout.strip().splitlines()
        return lines[-1] if lines and lines[-1].startswith("http://") else ""


@contextlib.contextmanager
def machine(
    size: Size, settings: MachineSettings, folder: Path = venv.DEFAULT
) -> Generator[OsworldDesktop]:
    """Yield one machine of a user as a desktop over OSWorld's own `DesktopEnv`.

    Args:
        size: `(height, width)` of its screen in pixels.
        settings: The machine: exactly one address or provider.
        folder: OSWorld's Python environment (`hijack osworld setup`).

    Raises:
        DesktopError: It does not start or answer, or its screen has another size.
    """
    (name,) = settings.vm
    height, width = size
    options = {key: value for key, value in settings.options.items() if key != "client_password"}
    password = settings.password
    with tempfile.TemporaryDirectory(prefix="agenthijack-osworld-") as scratch:
        cache = Path(scratch, "cache")
        fresh: Callable[[], Address] | None = None
        if is_address(name):
            fresh = ResetByCommand(name, settings.reset_command)
            machine_settings = OSWorldSettings(
                cache, (width, height), password=password, options=options
            )
            _wait_for_guest(name, FIRST_ANSWER_TIMEOUT_S)
        else:
            machine_settings = OSWorldSettings(
                cache,
                (width, height),
                password=password,
                provider=name,
                options=options,
                folder=FOLDER,
            )
        python, log = venv.find_python(folder), Path(scratch, LOG)
        with _only_start() if name in LOCAL_PROVIDERS else contextlib.nullcontext():
            env = OsworldEnv(python, fresh, machine_settings, log)
        with contextlib.closing(env):
            desktop = OsworldDesktop(env, password)
            desktop.machine_name = name
            screen_size = desktop.size
            if screen_size != size:
                raise DesktopError(
                    f"--vm {name}: its screen has {screen_size[1]}x{screen_size[0]} pixels, and the"
                    f" benchmark {width}x{height}; change the machine's resolution, or desktop.size"
                )
            yield desktop


def _only_start() -> Lock:
    """Wait until no other machine is being started from the files in `FOLDER`."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    return lock(FOLDER / START_LOCK, wait=True)


def _wait_for_guest(text: str, timeout: float) -> Address:
    """Return the address of a machine once it sends its screen.

    Raises:
        DesktopTimeoutError: It does not within `timeout` seconds.
    """
    address = read_address(text)
    deadline = time.monotonic() + timeout
    while True:
        try:
            with HttpDesktop(f"http://{address.host}:{address.port}", timeout=10) as guest:
                guest.screenshot()
            return address
        except DesktopError as error:
            if time.monotonic() > deadline:
                raise DesktopTimeoutError(
                    f"--vm {text}: no screen within {timeout:.0f} s ({error}); does OSWorld's"
                    " server run there, and can this machine reach the port?"
                ) from None
        time.sleep(POLL_S)
