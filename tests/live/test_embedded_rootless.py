"""Desktops of a user who is not root: what works there, what says that it does not, and that
nothing is left."""

import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from hijack_data.plan import Effect
from online_env import privilege
from online_env.desktops.http import HttpDesktop
from online_env.effects import perform
from online_env.embedded.runtime import kernel, registry, rootless
from online_env.embedded.runtime.desktop_config import SetupError
from online_env.errors import MissingCapabilityError

from support import needs
from support.waiting import until

ROOT = Path(__file__).resolve().parents[2]
NOBODY = 53535  # a throw-away number
SYSTEM_PYTHON = "/usr/bin/python3"
COMMAND = (
    "import sys; from hijack_data.cli import main; sys.argv = ['hijack', 'desktop', *sys.argv[1:]];"
    " main()"
)
PROVE = """
import sys
import hijack_data as hj
from online_env import EmbeddedDesktop
from online_env.corrupting.desktop_corruption import corrupt_desktop
from online_env.effects import resume
with EmbeddedDesktop.attach("rootless") as desktop:
    done = corrupt_desktop(desktop, hj.make_corruption(sys.argv[1]), seed=3)
    assert done.ok, done.saw
    assert all(resume(record, desktop).undo().ok for record in done.records)
print("proved")
"""
VERSION = "import sys; print(sys.version_info[:2])"
READABLE = "import hijack_data.cli, numpy, online_env.desktop_commands"


class User:
    """Runs things as a user who is not root."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.who = (
            {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.geteuid() == 0 else {}
        )
        self.python = sys.executable
        if not self._runs(sys.executable):
            self.python = SYSTEM_PYTHON
            if self._runs(SYSTEM_PYTHON) != str(sys.version_info[:2]):
                expected = "{}.{}".format(*sys.version_info)
                why = f"no Python {expected} that a user other than root may run"
                needs.skip(
                    why,
                    f"make .venv with {SYSTEM_PYTHON}, or install Python {expected} outside /root",
                )
        if self.run(self.python, "-c", READABLE).returncode:
            why = f"a user other than root cannot read {ROOT} or the packages of {sys.prefix}"
            needs.skip(
                why, "clone into a folder that others may read, such as /srv, and make env there"
            )

    def _runs(self, python):
        try:
            return self.run(python, "-c", VERSION).stdout.strip()
        except OSError:
            return ""

    def run(self, *argv):
        paths = [str(ROOT), *(path for path in sys.path if path.endswith("-packages"))]
        environment = {
            "PATH": "/usr/bin:/bin",
            "HOME": str(self.home),
            "PYTHONPATH": ":".join(paths),
            "LANG": "C.UTF-8",
        }
        return subprocess.run(
            argv,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
            cwd=self.home,
            env=environment,
            **self.who,
        )

    def code(self, text, *arguments):
        """What a piece of Python prints."""
        value = self.run(self.python, "-c", text, *arguments)
        assert value.returncode == 0, value.stderr[-3000:]
        return value.stdout

    def as_root(self, *words):
        """The command that this user is told for what needs root."""
        code = "import sys; from online_env.privilege import as_root; print(as_root(*sys.argv[1:]))"
        return self.code(code, *words).strip()

    def hijack(self, *arguments, code=0):
        """What `hijack desktop` prints."""
        outcome = self.run(self.python, "-c", COMMAND, *arguments)
        assert outcome.returncode == code, outcome.stdout + outcome.stderr[-3000:]
        return outcome.stdout + outcome.stderr


@pytest.fixture(scope="module")
def home():
    """The user's home; not below pytest's folder, which every run of pytest makes root's alone
    again."""
    with tempfile.TemporaryDirectory(
        prefix="hijack-home-", dir="/tmp", ignore_cleanup_errors=True
    ) as name:
        folder = Path(name)
        folder.chmod(0o755)
        if os.geteuid() == 0:
            os.chown(folder, NOBODY, NOBODY)
        yield folder


@pytest.fixture(scope="module")
def user(home):
    user = User(home)
    for check in json.loads(
        user.run(user.python, "-c", COMMAND, "doctor", "--profile", "core", "--json").stdout
    ):
        if check["required"] and not check["ok"] and check["name"] != "golden home":
            why = needs.shorter(check["name"], check["detail"])
            needs.skip(f"no desktop without root here: {why}", check["fix"])
    yield user
    assert [path.name for path in Path(f"/tmp/agenthijack-{NOBODY}").glob("[!.]*")] == [], (
        "left behind"
    )


@pytest.fixture(scope="module")
def record(user):
    """A desktop that runs on after the command that started it."""
    record = json.loads(
        user.hijack("up", "--name", "rootless", "--size", "1000x600", "--app", "editor", "--json")
    )
    assert record["rootless"]
    yield record
    assert "is gone" in user.hijack("down", "rootless")


@pytest.fixture(scope="module")
def desktop(record):
    token = Path(record["token_file"]).read_text()  # root may; its owner's own programs do as well
    with HttpDesktop(record["guest"], token, source=record["source"]) as desktop:
        yield desktop


def test_it_is_a_desktop_like_another(desktop):
    assert desktop.screenshot().shape == (600, 1000, 3)
    assert len(np.unique(desktop.screenshot()[:500].reshape(-1, 3), axis=0)) > 1000
    assert desktop.execute("id -un; echo $HOME; pwd").output == "user\n/home/user\n/home/user\n"
    assert "mousepad" in desktop.execute("wmctrl -lx").output
    assert "Mousepad" in desktop.accessibility()
    assert desktop.run("pyautogui.write('Ω <as> ever')").ok
    data = bytes(range(256))
    desktop.write_file("/home/user/Documents/x", data)
    assert desktop.read_file("/home/user/Documents/x") == data
    assert desktop.execute(["curl", "-sI", "http://search.test/"]).output.startswith("HTTP/1.1 200")
    assert not desktop.execute(["curl", "-s", "-m", "2", "http://1.1.1.1/"]).ok


def test_over_http_the_network_is_out_of_reach(desktop):
    assert desktop.capabilities == {"apps", "files", "accessibility", "lock", "windows"}
    with pytest.raises(MissingCapabilityError, match="firewall"):
        perform(Effect("firewall", {}), desktop)
    result = perform(Effect("minimise", {}), desktop)
    assert result.probe().ok
    assert result.undo().ok


def test_the_agent_has_no_rights_over_the_machine_or_the_namespaces(desktop, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("x")
    for path in (secret, "/root", f"/tmp/agenthijack-{NOBODY}"):
        assert not desktop.execute(["test", "-e", str(path)]).ok, path
    for command in (
        "ip link set lo down",
        "mount -t tmpfs none /mnt",
        "nft list tables",
        "hostname other",
        "touch /usr/bin/x",
        "sudo -n true",
    ):
        assert not desktop.execute(f"PATH=$PATH:/sbin:/usr/sbin; {command}").ok, command
    # the folder is a copy in memory, which is the user's own
    assert desktop.execute("touch /etc/planted").ok
    assert not Path("/etc/planted").exists()
    assert desktop.execute("grep CapEff /proc/self/status").output.split()[1].strip("0") == ""
    assert int(desktop.execute("ps -e -o pid= | wc -l").output) < 60


@pytest.mark.parametrize(
    ("script", "arguments"),
    [
        ("raw.py", ()),
        ("calls.py", (platform.machine(),)),
        ("look.py", ("init", "session", "desktop-server")),
        ("names.py", ("agenthijack", "hijack_data", "online_env", str(ROOT))),
    ],
)
def test_the_red_team_gets_nothing(desktop, script, arguments):
    """What `test_redteam` tries with root and shows to work where there is no fence."""
    desktop.write_file(f"/tmp/{script}", (ROOT / "tests/live/redteam" / script).read_bytes())
    result = desktop.execute(["/usr/bin/python3", f"/tmp/{script}", *arguments], 120)
    assert result.ok, result.error
    assert result.output
    assert "OPEN" not in result.output, result.output


@pytest.mark.parametrize("name", ["network_error", "verification"])
def test_its_owner_closes_the_network_and_locks_the_screen(user, record, name):
    assert "proved" in user.code(PROVE, name)


def test_everything_of_it_ends(user, record):
    listed = json.loads(user.hijack("list", "--json"))
    assert [row["id"] for row in listed] == ["rootless"]
    code = (
        "from online_env.embedded.desktop import EmbeddedDesktop\n"
        "with EmbeddedDesktop.up(size=(600, 800), name='other', standby=True) as d:\n"
        "    print(d.screenshot().shape, sorted(d.capabilities), d.wait_for_standby())\n"
        "    d.reset(); print(d.id, d.execute('whoami').output.strip())\n"
        "    try: d.namespace\n"
        "    except Exception as e: print(type(e).__name__)\n"
    )
    printed = user.code(code).splitlines()
    assert printed == [
        "(600, 800, 3) ['accessibility', 'apps', 'files', 'firewall', 'lock', 'windows'] True",
        "other-2 user",
        "MissingCapabilityError",
    ]
    assert [row["id"] for row in json.loads(user.hijack("list", "--json"))] == ["rootless"]


def test_a_killed_controller_takes_its_desktop_along(user):
    code = (
        "import os, signal\n"
        "from online_env.embedded.desktop import EmbeddedDesktop\n"
        "d = EmbeddedDesktop.up(size=(600, 800), name='killed')\n"
        "print(d.record['init'][0], flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    pid = int(user.run(user.python, "-c", code).stdout)
    folder = Path(f"/tmp/agenthijack-{NOBODY}/killed")
    until(lambda: not (folder.exists() or registry.process_start(pid)), "its end")


def test_what_needs_root_says_so_and_the_command(user):
    assert "run the same command with sudo" in user.hijack("up", "--osworld", code=2)
    words = user.as_root("desktop", "list")
    assert f"those of root: {words}" in user.hijack("shot", "nobody", code=2)
    message = user.hijack("doctor", "--profile", "core")
    result, user_command = privilege.as_root("desktop", "..."), user.as_root("desktop", "...")
    assert rootless.LACKING.replace(result, user_command) in message
    assert "namespaces and overlay mounts work" in message


def test_the_reason_names_the_switch(monkeypatch, tmp_path):
    switch = tmp_path / "max_user_namespaces"
    switch.write_text("0\n")
    monkeypatch.setattr(
        rootless, "_SWITCHES", {str(switch): ("0", "sysctl it=1"), "/none": ("0", "x")}
    )
    assert rootless.switched_off() == "sysctl it=1"

    def refuse(flags):
        raise OSError(1, "no")

    monkeypatch.setattr(kernel, "unshare", refuse)
    monkeypatch.setattr(rootless.os, "geteuid", lambda: 1000)
    with pytest.raises(SetupError, match="; sudo sysctl it=1"):
        rootless.enter()
    switch.write_text("100\n")
    assert rootless.switched_off() == ""
