"""The machine of a task's author, in a folder: what is read, what counts as changed, what is
removed."""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("lxml", reason=needs.ONLINE)

from hijack_data.errors import UnknownNameError
from online_env.desktops.protocol import RunResult
from online_env.embedded.sites.state import SiteState
from online_env.errors import DesktopError, GuestError, MissingPackageError
from online_env.tasks import Machine
from online_env.tasks.folder_desktop import FolderDesktop

ODD = ("a b.txt", "-rf", "two\nlines.txt", "ü%.txt", "[x]*?.txt", "back\\slash.txt", "tab\t.txt")


class Noting(FolderDesktop):
    """A folder that notes the commands it was given."""

    def __init__(self, home: Path) -> None:
        super().__init__(home)
        self.ran: list[list[str]] = []

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        self.ran.append([argv] if isinstance(argv, str) else list(argv))
        return super().execute(argv, timeout)


@pytest.fixture
def home(tmp_path: Path) -> Path:
    folder = tmp_path / "home"
    folder.mkdir()
    return folder


@pytest.fixture
def machine(home: Path, tmp_path: Path) -> Machine:
    return Machine(Noting(home), SiteState(tmp_path / "sites"))


# What is read


@pytest.mark.parametrize("name", [*ODD, "deep/er/a.txt"])
def test_a_file_of_any_name_is_written_and_read(machine: Machine, name: str) -> None:
    machine.write(name, "ä\n")
    assert machine.read(name) == "ä\n".encode()
    assert machine.exists(name)
    machine.write(name, b"\x00")
    assert machine.read(name) == b"\x00"


def test_what_is_no_file_cannot_be_read(machine: Machine, home: Path) -> None:
    (home / "folder").mkdir()
    (home / "gone").symlink_to("nowhere")
    assert [machine.read(name) for name in ("folder", "gone", "nothing")] == [None] * 3
    assert [machine.text(name) for name in ("folder", "gone", "nothing")] == [None] * 3
    assert [machine.exists(name) for name in ("folder", "gone", "nothing")] == [True, True, False]


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"one\r\ntwo\r\n", "one\ntwo\n"),
        (b"\xef\xbb\xbfone", "one"),
        (b"on\xe9", "on\ufffd"),
        (b"", ""),
        (b"a\rb", "a\rb"),
    ],
)
def test_a_text_has_plain_line_ends_and_no_mark(machine: Machine, data: bytes, text: str) -> None:
    machine.write("a.txt", data)
    assert machine.text("a.txt") == text


def test_the_names_in_a_folder_are_those_right_in_it(machine: Machine, home: Path) -> None:
    (home / "folder" / "sub" / "deeper").mkdir(parents=True)
    for name in (*ODD, ".hidden"):
        (home / "folder" / name).touch()
    assert machine.names("folder") == {*ODD, ".hidden", "sub"}
    assert machine.names("nothing") is None


def test_a_file_that_goes_while_it_is_read_is_none(machine: Machine) -> None:
    machine.write("a.txt", "")

    def gone(path: str) -> bytes:
        raise GuestError(f"{path}: no such file", status)

    machine.desktop.read_file = gone  # type: ignore[method-assign]
    status = 404
    assert machine.read("a.txt") is None
    status = 500
    with pytest.raises(GuestError):
        machine.read("a.txt")


def test_a_command_that_fails_is_told_with_what_it_said(machine: Machine) -> None:
    assert machine.run("pwd") == f"{machine.home}\n"
    with pytest.raises(DesktopError, match=r"cat nothing' failed on the desktop with 1: .*No such"):
        machine.run("cat", "nothing")


# What changed


def test_files_of_any_name_are_seen_to_change(machine: Machine, home: Path) -> None:
    for name in ODD:
        (home / name).write_text("one")
    machine.remember()
    assert list(machine.unexpected_changes()) == []
    for name in ODD:
        (home / name).write_text("two")
    assert list(machine.unexpected_changes()) == [f"{name} was changed" for name in sorted(ODD)]
    for name in ODD:
        (home / name).unlink()
    assert list(machine.unexpected_changes()) == [f"{name} is gone" for name in sorted(ODD)]
    assert list(machine.unexpected_changes("*")) == []


def test_an_empty_home_can_be_compared(machine: Machine, home: Path) -> None:
    machine.remember()
    assert machine.before.files == {}
    machine.write("a.txt", "")
    assert list(machine.unexpected_changes()) == ["a.txt was added"]
    (home / "a.txt").unlink()
    assert list(machine.unexpected_changes()) == []


@pytest.mark.parametrize(
    "change",
    [
        lambda path: path.chmod(0o755),
        lambda path: (path.unlink(), path.mkdir()),
        lambda path: (path.unlink(), path.symlink_to("b.txt")),
        lambda path: (path.unlink(), os.mkfifo(path)),
    ],
)
def test_a_file_that_became_another_thing_was_changed(machine: Machine, home: Path, change) -> None:
    for name in ("a.txt", "b.txt"):
        machine.write(name, "one")
        (home / name).chmod(0o644)
    machine.remember()
    change(home / "a.txt")
    assert list(machine.unexpected_changes()) == ["a.txt was changed"]


def test_a_link_that_leads_elsewhere_was_changed(machine: Machine, home: Path) -> None:
    for name in ("a.txt", "b.txt"):
        machine.write(name, "one")
    (home / "link").symlink_to("a.txt")
    machine.remember()
    assert list(machine.unexpected_changes()) == []
    (home / "link").unlink()
    (home / "link").symlink_to("b.txt")
    assert list(machine.unexpected_changes()) == ["link was changed"]


def test_a_file_that_was_only_touched_is_untouched(machine: Machine, home: Path) -> None:
    machine.write("a.txt", "one")
    machine.remember()
    os.utime(home / "a.txt", (1, 1))
    assert list(machine.unexpected_changes()) == []


def test_nothing_can_be_compared_before_a_task_was_prepared(machine: Machine) -> None:
    with pytest.raises(DesktopError, match=r"^nothing was noted of the machine: call task\.setup"):
        list(machine.unexpected_changes())


# What is removed


def test_what_was_added_is_removed_and_nothing_else(machine: Machine, home: Path) -> None:
    machine.write("kept/a.txt", "one")
    machine.begin()
    (home / "new" / "deep").mkdir(parents=True)
    for name in (*ODD, "kept/b.txt", "new/c.txt", "new/deep/d.txt", "kept/a.txt"):
        (home / name).write_text("two")
    with machine.sites.update("shop") as state:
        state["cart"] = {"mug": 1}
    machine.clear(["unknown application"])
    assert sorted(path.name for path in home.rglob("*")) == ["a.txt", "kept"]
    assert machine.sites.read("shop") == {}
    machine.clear([])  # again


def test_any_number_of_added_files_is_removed(machine: Machine, home: Path) -> None:
    machine.begin()
    for number in range(1000):
        (home / f"{number:03}.txt").touch()
    (home / "folder").mkdir()
    for number in range(1000):
        (home / "folder" / f"{number:03}.txt").touch()
    machine.clear([])
    assert list(home.iterdir()) == []
    desktop = machine.desktop
    assert isinstance(desktop, Noting)
    assert max(len(argv) for argv in desktop.ran) < 500, "a command takes only so many arguments"


def test_without_a_beginning_no_file_is_removed(machine: Machine, home: Path) -> None:
    machine.write("a.txt", "one")
    machine.clear([])
    assert (home / "a.txt").exists()


# Applications


def test_what_is_not_installed_is_named_with_its_profile(machine: Machine) -> None:
    desktop = machine.desktop
    assert isinstance(desktop, Noting)
    machine.check_installed(["an application of an author"])
    assert desktop.ran == []
    desktop.execute = lambda argv, timeout=60: RunResult(  # type: ignore[method-assign]
        "success", returncode=127
    )
    with pytest.raises(MissingPackageError) as caught:
        machine.check_installed(["libreoffice_calc"])
    assert str(caught.value) == (
        "soffice is not on the desktop, and the task uses it: "
        "hijack desktop install --profile office"
    )


def test_an_application_is_started_as_a_person_would_type_it(machine: Machine) -> None:
    line = machine.command_line("geany", "/home/user/a b.txt")
    assert line == "geany --new-instance '/home/user/a b.txt'"
    with pytest.raises(UnknownNameError, match=r"no application 'gean' for tasks; did you mean"):
        machine.command_line("gean")
