"""Files, trash and archives of tasks, in a folder."""

import io
import os
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)

from hijack_data.rng import Stream
from online_env.desktops.protocol import RunResult
from online_env.tasks import Machine
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit.archives import make_locked_zip, make_zip, unpack
from online_env.tasks.kit.sample_files import (
    arrangement_problems,
    kind_and_digest,
    mode,
    move_files,
    paths_below,
    sample_file,
)
from online_env.tasks.kit.trash import move_to_trash, take_out, trashed_files


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """A home folder with two files, noted."""
    result = Machine(FolderDesktop(tmp_path))
    result.write("in/a.txt", "one\n")
    result.write("in/sub/b.txt", "two\n")
    result.remember()
    return result


NOBODY = 65534
AS_NOBODY = ("setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups")


class WithoutRights(FolderDesktop):
    """A folder whose commands run without the rights of root."""

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        assert not isinstance(argv, str)
        start = () if os.geteuid() else AS_NOBODY
        return super().execute([*start, *argv], timeout)


@pytest.fixture
def unprivileged() -> Iterator[Machine]:
    """A home folder with a script, for a user whom modes bind, noted."""
    with tempfile.TemporaryDirectory() as folder:
        os.chown(folder, os.geteuid() or NOBODY, -1)
        result = Machine(WithoutRights(Path(folder)))
        result.run("sh", "-c", "mkdir jobs && echo one >jobs/a.sh && echo two >b.txt")
        result.remember()
        yield result
        result.run("chmod", "-R", "u+rwX", "jobs", "b.txt")


@pytest.mark.parametrize(
    ("change", "problems"),
    [
        (("000", "b.txt"), ["b.txt was changed"]),
        (("644", "jobs"), ["jobs was changed", "jobs/a.sh is gone"]),
    ],
)
def test_what_cannot_be_read_is_told(
    unprivileged: Machine, change: Sequence[str], problems: list[str]
) -> None:
    unprivileged.run("chmod", *change)
    assert list(unprivileged.unexpected_changes()) == problems


def test_a_file_of_a_snapshot_has_a_kind_a_digest_and_a_mode(machine: Machine) -> None:
    was = machine.snapshot().files["in/a.txt"]
    machine.run("chmod", "4711", "in/a.txt")
    look = machine.snapshot().files["in/a.txt"]
    assert (kind_and_digest(look), mode(look)) == (kind_and_digest(was), 0o4711)
    assert kind_and_digest("f 0") == ("f", "") != kind_and_digest(was)


@pytest.mark.parametrize(
    ("name", "start"), [("a.png", b"\x89PNG"), ("b.JPG", b"\xff\xd8"), ("c.pdf", b"%PDF")]
)
def test_a_sample_file_is_what_its_suffix_says(name: str, start: bytes) -> None:
    assert sample_file(name).startswith(start)
    assert sample_file(name) == sample_file(name)
    assert sample_file(name) != sample_file(name, "another text")


def test_a_sample_text_says_what_it_is_told() -> None:
    assert sample_file("a.csv", "x;y") == b"x;y\n"


def test_moves_and_copies_as_asked_are_no_problem(machine: Machine) -> None:
    move_files(machine, [("in/a.txt", "out/a.txt")])
    move_files(machine, [("in/sub/b.txt", "out/b.txt"), ("in/sub/b.txt", "out/c.txt")], "cp")
    machine.run("mkdir", "empty")
    copied = [("in/sub/b.txt", "out/b.txt"), ("in/sub/b.txt", "out/c.txt")]
    assert not list(arrangement_problems(machine, [("in/a.txt", "out/a.txt")], copied, ["empty"]))


def test_a_copy_is_no_move(machine: Machine) -> None:
    move_files(machine, [("in/a.txt", "out/a.txt")], "cp")
    assert list(arrangement_problems(machine, [("in/a.txt", "out/a.txt")])) == [
        "in/a.txt is still there"
    ]


def test_another_file_in_the_place_is_told(machine: Machine) -> None:
    machine.write("out/a.txt", "something else\n")
    machine.run("rm", "in/a.txt")
    items = list(arrangement_problems(machine, [("in/a.txt", "out/a.txt")]))
    assert items == ["out/a.txt is not the file that was in/a.txt"]


def test_a_file_that_never_was_is_told(machine: Machine) -> None:
    machine.write("out/c.txt", "three\n")
    items = list(arrangement_problems(machine, copied=[("in/c.txt", "out/c.txt")]))
    assert items == ["out/c.txt is not the file that was in/c.txt"]


def test_files_may_change_places(machine: Machine) -> None:
    swap = [("in/a.txt", "in/sub/b.txt"), ("in/sub/b.txt", "in/a.txt")]
    machine.write("in/a.txt", "two\n")
    machine.write("in/sub/b.txt", "one\n")
    assert not list(arrangement_problems(machine, swap))


def test_modes_of_what_was_moved_do_not_count_and_those_of_others_do(machine: Machine) -> None:
    move_files(machine, [("in/a.txt", "out/a.txt")])
    machine.run("chmod", "600", "out/a.txt")
    assert not list(arrangement_problems(machine, [("in/a.txt", "out/a.txt")]))
    machine.run("chmod", "600", "in/sub/b.txt")
    items = list(arrangement_problems(machine, [("in/a.txt", "out/a.txt")]))
    assert items == ["in/sub/b.txt was changed"]


def test_a_link_in_the_place_of_a_file_is_not_the_file(machine: Machine) -> None:
    machine.run("mkdir", "out")
    machine.run("mv", "in/a.txt", "in/sub/a.txt")
    machine.run("ln", "-s", "../in/sub/a.txt", "out/a.txt")
    items = list(arrangement_problems(machine, [("in/a.txt", "out/a.txt")]))
    assert items == ["in/sub/a.txt was added", "out/a.txt is not the file that was in/a.txt"]


@pytest.mark.parametrize("name", ["[1].txt", "a?.txt", "ü *.txt", "two\nlines.txt", " "])
def test_a_name_with_any_signs_may_be_named(machine: Machine, name: str) -> None:
    move_files(machine, [("in/a.txt", f"out/{name}")])
    assert list(arrangement_problems(machine, [("in/a.txt", f"out/{name}")])) == []
    assert list(machine.unexpected_changes("in/a.txt")) == [
        "out was added",
        f"out/{name} was added",
    ]


def test_a_pattern_allows_what_is_below_it_and_the_folders_above(machine: Machine) -> None:
    machine.write("new/deep/a.txt", "one\n")
    machine.write("other/a.txt", "one\n")
    assert list(machine.unexpected_changes("new/*")) == ["other was added", "other/a.txt was added"]
    assert list(machine.unexpected_changes("new/deep/a.txt", "other/*.txt")) == []


def test_what_is_hidden_is_not_looked_at(machine: Machine) -> None:
    machine.write(".config/a.txt", "one\n")
    machine.write("in/.hidden", "one\n")
    assert list(machine.unexpected_changes()) == []


def test_what_was_not_asked_for_is_told(machine: Machine) -> None:
    machine.write("more.txt", "")
    machine.write("folder", "a file")
    assert list(arrangement_problems(machine, folders=["folder"])) == [
        "more.txt was added",
        "there is no folder folder",
    ]


def test_the_files_below_a_folder_are_those_of_before(machine: Machine) -> None:
    machine.write("in/new.txt", "")
    assert sorted(paths_below(machine, "in")) == ["a.txt", "sub/b.txt"]


def test_the_trash_gives_back_what_was_thrown_away(machine: Machine) -> None:
    move_to_trash(machine, "in/ü %.txt", b"three")
    assert trashed_files(machine) == {"in/ü %.txt": b"three"}
    take_out(machine, "in/ü %.txt")
    assert machine.read("in/ü %.txt") == b"three"
    assert trashed_files(machine) == {}


def test_an_archive_holds_its_files_and_folders() -> None:
    files = {"top/a.txt": b"1", "b.txt": b"2"}
    data = make_zip(files)
    assert unpack(data) == files
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert "top/" in archive.namelist()


def test_a_tar_archive_is_read_without_its_leading_dot() -> None:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:xz") as archive:
        entry = tarfile.TarInfo("./top/a.txt")
        entry.size = 3
        archive.addfile(entry, io.BytesIO(b"one"))
    assert unpack(buffer.getvalue()) == {"top/a.txt": b"one"}


def damaged() -> bytes:
    """Return a compressed ZIP archive, some bytes of which are others."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.txt", " ".join(map(str, range(900))))
    data = buffer.getvalue()
    return data[:60] + b"\xff" * 40 + data[100:]


@pytest.mark.parametrize("data", [None, b"", b"no archive", make_zip({"a": b"1"})[:40], damaged()])
def test_what_is_no_archive_is_none(data: bytes | None) -> None:
    assert unpack(data) is None


def test_a_locked_archive_shows_its_files_and_gives_none() -> None:
    data = make_locked_zip({"a.txt": 40, "b.txt": 7}, Stream(3, "locked"))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert {entry.filename: entry.file_size for entry in archive.infolist()} == {
            "a.txt": 40,
            "b.txt": 7,
        }
        with pytest.raises(RuntimeError, match="password"):
            archive.read("a.txt")
        with pytest.raises((RuntimeError, zipfile.BadZipFile)):
            archive.read("a.txt", b"password")
    assert unpack(data) is None


def test_the_trash_names_a_file_by_the_place_that_it_had(machine: Machine) -> None:
    move_to_trash(machine, "in/a b.txt", b"one")
    machine.run("mkdir", "-p", ".local/share/Trash/files/folder")
    machine.write(".local/share/Trash/info/folder.trashinfo", "[Trash Info]\nPath=/x\n")
    machine.write(".local/share/Trash/files/a b.2.txt", b"two")
    outside = "[Trash Info]\nPath=/srv/a%20b.txt\nDeletionDate=2024-05-06T07:08:09\n"
    machine.write(".local/share/Trash/info/a b.2.txt.trashinfo", outside)
    assert trashed_files(machine) == {"in/a b.txt": b"one", "/srv/a b.txt": b"two"}
