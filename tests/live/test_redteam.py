"""Ways out of an embedded desktop, tried from inside, as its user and as root. Each of them once
worked, or might.

An attack is a script of the folder `redteam`, which prints `OPEN` for all that it gets. Where that
can be done, the same script runs without the fence, too: an attack that gets nothing anywhere would
prove nothing.
"""

import contextlib
import dataclasses
import os
import platform
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from hijack_data.plan import Effect
from online_env.desktops.http import HttpDesktop
from online_env.effects import perform
from online_env.embedded import handle
from online_env.embedded.runtime import hidden_folders, registry
from online_env.embedded.runtime.guest_spawner import SERVER_PROCESS_NAME
from online_env.errors import DesktopError

from support import needs
from support.waiting import until

SCRIPTS = Path(__file__).with_name("redteam")
PYTHON = "/usr/bin/python3"
USERS = ("user", "root")
NAMES = ("agenthijack", "hijack_data", "online_env")
STRANGER = 53535  # a throw-away number
SECRET = b"CANARY-OF-THE-MACHINE"


@pytest.fixture(scope="module", autouse=True)
def as_root():
    """Without root outside there is none inside; `test_embedded_rootless` has the attacks of the
    user."""
    if os.geteuid() != 0:
        needs.skip("root inside needs root outside", "run the tests with sudo")


def inside(desktop, who, *argv, timeout=60):
    """What a command prints inside, which must end well."""
    sudo = ["sudo", "-n"] if who == "root" else []
    result = desktop.execute([*sudo, *map(str, argv)], timeout)
    assert result.ok, f"{argv[:3]} did not run: {result.error[-800:]}"
    return result.output


def attack(desktop, who, script, *arguments):
    """What a script of the red team prints inside."""
    desktop.write_file(f"/tmp/{script}", (SCRIPTS / script).read_bytes())
    return inside(desktop, who, PYTHON, f"/tmp/{script}", *arguments)


def on_machine(script, *arguments, enter=()):
    """What the same script prints on the machine."""
    command = [*enter, PYTHON, str(SCRIPTS / script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout


@pytest.fixture(scope="module")
def folders(embedded_machine):
    """Two folders below a system folder: one that a run has registered, one that nobody has."""
    with tempfile.TemporaryDirectory(prefix="red-", dir="/var/tmp") as name:
        for kind in ("hidden", "open"):
            path = Path(name, kind)
            path.mkdir()
            (path / "record").write_bytes(SECRET)
        Path(name).chmod(0o755)
        hidden_folders.hide(Path(name, "hidden"))
        hidden_folders.hide(Path(name, "later/run"))
        yield Path(name)


@pytest.fixture(scope="module")
def desktop(folders):
    """One desktop for all attacks; root inside asks for no password."""
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=(600, 800), osworld=True) as desktop:
        yield desktop


@contextlib.contextmanager
def service(family, address):
    """A service that tells everybody the secret; gives where it listens."""
    with socket.socket(family) as listener:
        listener.bind(address)
        listener.listen()

        def answer():
            with contextlib.suppress(OSError):
                while True:
                    line, _ = listener.accept()
                    with line:
                        line.sendall(SECRET)

        threading.Thread(target=answer, daemon=True).start()
        yield listener.getsockname()
        listener.shutdown(socket.SHUT_RDWR)


@pytest.mark.parametrize("who", USERS)
def test_services_of_the_machine_are_out_of_reach(desktop, who):
    name = f"red-{os.getpid()}-{who}"
    everywhere = service(socket.AF_INET, ("0.0.0.0", 0))
    with everywhere as (_, port), service(socket.AF_UNIX, f"\0{name}"):
        listed = subprocess.run(["hostname", "-I"], capture_output=True, text=True, check=False)
        hosts = ["127.0.0.1", desktop.record["address"], *listed.stdout.split()]
        places = [f"{host}:{port}" for host in hosts if ":" not in host]
        guest = desktop.record["guest"].partition("//")[2]
        result = attack(desktop, who, "reach.py", *places, f"@{name}", guest, "127.0.0.1:5000")
        assert "OPEN" not in result, result
        assert on_machine("reach.py", places[0], f"@{name}").count(SECRET.decode()) == 2


@pytest.mark.parametrize("who", USERS)
def test_raw_frames_are_refused_and_network_error_holds_against_them(desktop, who):
    applied = perform(Effect("firewall", {}), desktop)
    try:
        assert applied.probe().ok
        assert "refused" in attack(desktop, who, "raw.py")
        # Who has rights over the desktop's network gets through: so it is the rights that keep it
        # closed.
        without = on_machine("raw.py", enter=("nsenter", f"--net={desktop.namespace}"))
        assert "OPEN" in without
    finally:
        assert applied.undo().ok


@pytest.mark.parametrize("who", USERS)
def test_a_user_namespace_of_ones_own_is_no_help(desktop, who):
    for command in (
        "umount -l /usr",
        "umount -l /home/user",
        f"nsenter -t 1 -m ls /{folder()}",
        "nsenter -t 1 -n ip link set lo down",
        "mount -t tmpfs none /proc/1/root/mnt",
    ):
        result = desktop.execute(
            ["unshare", "-Urmn", "--", "sh", "-c", f"PATH=$PATH:/sbin; {command}"]
        )
        assert result.returncode not in (None, 0), f"{command}: {result.output}"
    assert desktop.execute(["unshare", "-Urm", "mount", "-t", "tmpfs", "none", "/mnt"]).ok


def folder():
    """The clone's path from `/` on."""
    return Path(__file__).resolve().parents[2].relative_to("/")


@pytest.fixture
def key():
    """The number of a key in the ring of the machine's root."""
    if needs.absent(["keyctl"]):
        code = (
            "import ctypes; libc = ctypes.CDLL(None); "
            f"print(libc.syscall({248 if platform.machine() == 'x86_64' else 217}, "
            "b'user', b'canary', b'KEY-OF-THE-MACHINE', 18, -4))"
        )
        command = [sys.executable, "-c", code]
    else:
        command = ["keyctl", "add", "user", "canary", "KEY-OF-THE-MACHINE", "@u"]
    number = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    if int(number) < 0:
        needs.skip("the kernel has no key rings", "run it on a kernel with CONFIG_KEYS")
    return number


@pytest.mark.parametrize("who", USERS)
def test_key_rings_of_the_machine_are_out_of_reach(desktop, key, who):
    result = attack(desktop, who, "keyring.py", key, platform.machine())
    assert result == "tried\n"
    assert "KEY-OF-THE-MACHINE" in on_machine("keyring.py", key, platform.machine())


@pytest.mark.parametrize("who", USERS)
def test_system_calls_that_reach_past_namespaces_are_not_there(desktop, who):
    result = attack(desktop, who, "calls.py", platform.machine())
    assert "OPEN" not in result, result
    assert "OPEN: keyctl" in on_machine("calls.py", platform.machine())


@pytest.mark.parametrize("who", USERS)
def test_what_serves_the_desktop_cannot_be_looked_into(desktop, who):
    result = attack(desktop, who, "look.py", "init", "session", SERVER_PROCESS_NAME)
    assert result.count("looking at") == 3
    assert "OPEN" not in result, result
    desktop.client.launch(["sleep", "1234"])
    until(lambda: desktop.execute(["pgrep", "-x", "sleep"]).ok)
    assert "OPEN: sleep environ" in attack(desktop, "user", "look.py", "sleep")
    desktop.execute(["pkill", "sleep"])


def test_root_inside_is_nobody_outside(desktop):
    if not desktop.record["shifted"]:
        needs.skip("this machine cannot map the users of a desktop", "see `hijack desktop doctor`")
    desktop.client.launch(["sudo", "-n", "sleep", "4321"])
    owner = until(lambda: [uid for uid, line in owners() if line == b"sleep\x004321\0"])
    assert owner[0] > 1 << 30
    assert inside(desktop, "root", "stat", "-c", "%u", "/etc/passwd", "/usr/bin/sudo") == "0\n0\n"


def owners():
    """User number and command line of all processes of the machine."""
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            yield path.stat().st_uid, (path / "cmdline").read_bytes()


@pytest.mark.parametrize("who", USERS)
def test_runs_and_our_own_files_are_not_there(desktop, folders, who):
    assert inside(desktop, who, "cat", folders / "open/record") == SECRET.decode()
    later = folders / "later/run"
    later.mkdir(parents=True, exist_ok=True)  # after the desktop has come up
    (later / "record").write_bytes(SECRET)
    ours = [path for path in hidden_folders.hidden() if Path(path).exists()]
    assert len(ours) >= 3
    files = (registry.RUN, desktop.record["token_file"], desktop.record["sites"])
    for path in (folders / "hidden", later, *ours, *files):
        assert Path(path).exists(), path
        reached = desktop.execute(["sudo", "-n", "ls", "-d", str(path)])
        assert not reached.ok, f"{path} is there"
    assert "OPEN" not in inside(
        desktop, who, "sh", "-c", "ls /var/lib | sed 's/^agenthijack/OPEN/'"
    )


@pytest.mark.parametrize("who", USERS)
def test_nothing_inside_has_our_name(desktop, who):
    token = Path(desktop.record["token_file"]).read_text()
    desktop.write_file("/tmp/names.py", (SCRIPTS / "names.py").read_bytes())
    host, _, port = desktop.record["guest"].partition("//")[2].partition(":")
    with socket.create_connection((host, int(port))) as line:  # a client's, which is forwarded
        line.sendall(b"GET /platform HTTP/1.1\r\nHost: x\r\n\r\n")
        assert b"200" in line.recv(100)
        result = inside(
            desktop, who, PYTHON, "/tmp/names.py", *NAMES, str(folder()), token, timeout=120
        )
    assert result == "looked\n"
    desktop.write_file("/tmp/red-canary", b"an AgentHijack file")
    assert "OPEN: /tmp/red-canary" in attack(desktop, who, "names.py", "hijack")
    desktop.execute(["rm", "/tmp/red-canary"])


def test_a_second_user_has_a_home(desktop):
    inside(desktop, "root", "useradd", "-m", "-s", "/bin/bash", "bob")
    as_bob = [
        "runuser",
        "-u",
        "bob",
        "--",
        "sh",
        "-c",
        "cd; head -c 8M /dev/zero > big; wc -c < big",
    ]
    assert inside(desktop, "root", *as_bob).strip() == str(8 << 20)
    result = inside(
        desktop, "root", "sh", "-c", "cmp /etc/skel/.profile ~bob/.profile && stat -c %U ~bob"
    )
    assert result.strip() == "bob"


def test_other_users_of_the_machine_are_turned_away(desktop):
    ask = (
        "import sys, urllib.request as r; q = r.Request(sys.argv[1] + '/execute', "
        "b'{\"command\": \"id -u\", \"shell\": true}', {'Content-Type': 'application/json'})\n"
        "try: print(r.urlopen(q).read())\n"
        "except OSError as error: print(error)"
    )
    send_and_go = (
        "import socket, sys; s = socket.create_connection((sys.argv[1], int(sys.argv[2]))); "
        'b = b\'{"command": "touch /tmp/planted", "shell": true}\'; '
        "s.sendall(b'POST /execute HTTP/1.1\\r\\nHost: x\\r\\nContent-Type: application/json\\r\\n"
        "Content-Length: %d\\r\\n\\r\\n' % len(b) + b); s.close()"
    )
    stranger = {"user": STRANGER, "group": STRANGER, "extra_groups": []}
    url = desktop.record["guest"]

    def run(code, *arguments, **who):
        command = [PYTHON, "-c", code, *arguments]
        return subprocess.run(
            command, capture_output=True, text=True, check=True, cwd="/", timeout=60, **who
        ).stdout

    assert "403" in run(ask, url, **stranger)
    assert "47077" in run(ask, url)  # root is served, without a token
    for _ in range(5):  # the kernel no longer knows whose a closed connection was
        run(send_and_go, *url.partition("//")[2].split(":"), **stranger)
    time.sleep(1)
    assert not desktop.execute(["test", "-e", "/tmp/planted"]).ok
    door = subprocess.run(
        [
            PYTHON,
            "-c",
            "import socket, sys; socket.socket(socket.AF_UNIX).connect(sys.argv[1])",
            desktop.record["door"],
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd="/",
        **stranger,
    )
    assert "PermissionError" in door.stderr


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", ""]
)
def test_a_web_page_cannot_have_commands_run(desktop, kind):
    """A page may send these types to any address without asking; JSON it may not."""
    import httpx

    body = b'{"command": "touch /tmp/by-a-page", "shell": true}'
    for path in ("/execute", "/setup/execute", "/setup/launch", "/run_python", "/run_bash_script"):
        headers = {"Content-Type": kind} if kind else {}
        answer = httpx.post(
            desktop.record["guest"] + path, content=body, headers=headers, trust_env=False
        )
        assert answer.status_code == 415, answer.text
    headers = {"Content-Type": "application/json; charset=utf-8"}
    good = httpx.post(
        desktop.record["guest"] + "/execute", content=body, headers=headers, trust_env=False
    )
    assert good.json()["returncode"] == 0


HOG = """
import mmap, os, sys
kept = []
for kind in sys.argv[1:]:
    for number in range(24):
        handle = os.memfd_create("x") if kind == "memfd" else os.open(f"/dev/shm/{number}", os.O_RDWR | os.O_CREAT)
        kept.append(handle)
        try:
            os.ftruncate(handle, 64 << 20)
            for _ in range(64):
                os.write(handle, b"x" * (1 << 20))
        except OSError:
            break
        print(f"{kind} {number + 1}", flush=True)
print("OPEN: all of it", flush=True)
"""


def test_memory_is_limited_for_a_whole_desktop(embedded_machine):
    """Shared memory and memfds count for no single process."""
    order = dataclasses.replace(handle.make_order((600, 800)), memory=512 << 20, storage=256 << 20)
    result = handle.Handle(order)
    try:
        record = result.wait()
        if "memory" not in record["limited"]:
            needs.skip("no control group for memory", "see `hijack desktop doctor`")
        token = Path(record["token_file"]).read_text()
        desktop = HttpDesktop(record["guest"], token, door=record["door"], timeout=60)
        # It hits the limit, whether that ends the script, another program or the desktop.
        with desktop, contextlib.suppress(DesktopError):
            value = desktop.execute([PYTHON, "-c", HOG, "shm", "memfd"], 50)
            assert "OPEN" not in value.output, value.output
    finally:
        result.close()
    assert shutil.which("true")  # the machine goes on


def test_it_holds_where_users_cannot_be_mapped(embedded_machine, monkeypatch):
    """On an older kernel root inside has the number 0, and still no rights."""
    old = "from online_env.embedded.runtime import identity; identity._OLDEST_KERNEL = (999, 0)"
    monkeypatch.setattr(
        handle, "_KEEPER", handle._KEEPER.replace("from online", f"{old}; from online")
    )
    result = handle.Handle(handle.make_order((600, 800), osworld=True))
    try:
        record = result.wait()
        assert not record["shifted"]
        token = Path(record["token_file"]).read_text()
        with HttpDesktop(record["guest"], token, door=record["door"], timeout=60) as desktop:
            for script, arguments in (
                ("raw.py", ()),
                ("calls.py", (platform.machine(),)),
                ("look.py", ("init", "session", SERVER_PROCESS_NAME)),
            ):
                value = attack(desktop, "root", script, *arguments)
                assert value
                assert "OPEN" not in value, value
            for command in (
                "mount -t tmpfs none /mnt",
                "umount -l /usr",
                "mknod /tmp/disk b 254 0",
                "sh -c 'echo 1 > /proc/sys/kernel/panic'",
                "ip link set lo down",
            ):
                assert not desktop.execute(f"sudo -n {command}").ok, command
    finally:
        result.close()
