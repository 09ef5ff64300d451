"""What the tests of effects share: desktops that lie or lack something around a real one, and ways
to look at it."""

import contextlib
import shlex
import shutil
import subprocess

import pytest

from online_env.desktops.protocol import RunResult
from online_env.effects import perform
from online_env.effects.guest import Guest
from online_env.errors import MissingCapabilityError

from support.waiting import still
from support.waiting import until as wait


class Around:
    """A desktop that passes everything on; subclasses change one thing."""

    def __init__(self, desktop):
        self.desktop = desktop

    def __getattr__(self, name):
        return getattr(self.desktop, name)


class Liar(Around):
    """Answers some operations of our tools out of its head, and does nothing."""

    def __init__(self, desktop, **answers):
        super().__init__(desktop)
        self.answers = answers

    def tool(self, name, operation, fields, timeout=60):
        if operation in self.answers:
            return self.answers[operation]
        return self.desktop.tool(name, operation, fields, timeout)


class Plain(Around):
    """A guest whose server is not ours: tools run there in the system's Python."""

    tool = None


class Meddler(Around):
    """Does `act(desktop)` after each reading of the tree, as a person beside the machine would."""

    def __init__(self, desktop, act):
        super().__init__(desktop)
        self.act = act

    def accessibility(self):
        tree = self.desktop.accessibility()
        self.act(self.desktop)
        return tree


class WithSudo(Around):
    """A guest as a virtual machine is: no namespace to enter, but sudo with root's rights over the
    network.

    `folder` holds the programs that root finds there.
    """

    def __init__(self, desktop, folder, password="password"):
        self.desktop, self.folder, self.password = desktop, folder, password
        fake = folder / "sudo"
        fake.write_text(
            f'#!/bin/sh\nread given; [ "$given" = {shlex.quote(password)} ] || exit 1\n'
            'while [ "$1" != -- ]; do shift; done; shift; exec "$@"\n'
        )
        fake.chmod(0o755)
        (folder / "sh").symlink_to("/bin/sh")
        self.namespace = None

    tool = None  # its server is not ours
    network_root = None  # nor is its network

    def give(self, name):
        """Give root a program of this machine."""
        (self.folder / name).symlink_to(f"/usr/sbin/{name}")

    def execute(self, argv, timeout=60):
        if isinstance(argv, list) and "sudo" in argv[2]:
            inside = [
                shutil.which("nsenter"),
                f"--net={self.desktop.namespace}",
                "/bin/sh",
                *argv[1:],
            ]
            inside[5:] = [word.replace("/usr/sbin:/sbin", str(self.folder)) for word in inside[5:]]
            process = subprocess.run(
                inside,
                capture_output=True,
                text=True,
                timeout=timeout,
                check=False,
                env={"PATH": f"{self.folder}", "LC_ALL": "C"},
            )
            return RunResult(
                "success",  # it ran, whatever it returned
                process.stdout,
                process.stderr,
                process.returncode,
            )
        return self.desktop.execute(argv, timeout)


@contextlib.contextmanager
def applied(effect, desktop, **options):
    """An effect that is surely undone."""
    result = perform(effect, desktop, **options)
    try:
        yield result
    finally:
        assert result.undo().ok


def windows(desktop):
    """The windows, bottom to top."""
    return Guest(desktop, "", None).x("state")["windows"]


def boxes(desktop):
    """Where the application windows are, and whether they are on the screen."""
    return {w["id"]: (w["box"], w["mapped"]) for w in windows(desktop) if w["type"] == "normal"}


def refused(effect, desktop, words):
    """What a machine lacks is said before anything is changed."""
    before = boxes(desktop)
    with pytest.raises(MissingCapabilityError, match=words):
        perform(effect, desktop)
    assert boxes(desktop) == before


def open_apps(desktop):
    """Chromium in front of Mousepad, both drawn."""
    from online_env.desktops.commands import launch

    launch(desktop, "mousepad")
    wait(lambda: len(boxes(desktop)) == 1)
    launch(desktop, "google-chrome")
    wait(lambda: "Encyclopedia" in desktop.accessibility())
    still(desktop.screenshot)
    return desktop


def active(desktop):
    """The window that has the focus."""
    state = Guest(desktop, "", None).x("state")
    return next(
        (w for w in state["windows"] if w["id"] == state["active"]), {"class": "", "title": ""}
    )


def browser_to_front(desktop):
    """Chromium is active."""
    desktop.execute(["wmctrl", "-a", "Chromium"])
    wait(lambda: "chrom" in active(desktop)["class"].lower())
    still(desktop.screenshot)


def reach(desktop, host="10.77.0.1", port=80):
    """Whether a new connection from the desktop comes through."""
    targets = [{"kind": "tcp", "host": host, "port": port}]
    return Guest(desktop, "", None).net("reach", 0.5, targets=targets)["reached"][0]["ok"]
