"""Images of the desktop in the cache and as files: whole or not at all, and never changed
unnoticed."""

import dataclasses
import hashlib
import io
import json
import os
import signal
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
import zstandard
from click.testing import CliRunner

from hijack_data.errors import ParameterError, StorageError
from online_env.embedded.image import archive, cache, file_entries, image_checks, manifest
from online_env.embedded.image.image_commands import image as commands
from online_env.errors import DesktopImageError

from support import images

ROOT = Path(__file__).resolve().parents[2]
# Writes half an image under the lock, says so, and waits to be killed.
HALF = """
import sys, time
from online_env.embedded.image import cache
with cache.cache_lock(print) as folder, cache.build_folder(folder) as fresh:
    (fresh / "root").mkdir(mode=0o500)
    (fresh / "manifest.json").write_text("{")
    print("half", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.delenv(cache.CHOICE, raising=False)
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "images"))
    return tmp_path / "images"


@pytest.fixture
def packed(tmp_path):
    """A tiny image as a file; it is not in the cache any more."""
    result = images.publish()
    path = tmp_path / "tiny.tar.zst"
    archive.write(result, path)
    cache.remove("tiny", print)
    return path


def run(*words):
    return CliRunner().invoke(commands, list(words), catch_exceptions=True)


def test_the_same_files_are_the_same_image(tmp_path):
    values = [tmp_path / name for name in ("one", "two", "other")]
    for path in values:
        path.mkdir()
    ids = [images.fill(path, "x" if path.name == "other" else "hello").id for path in values]
    assert ids[0] == ids[1] != ids[2]
    text = (values[0] / manifest.NAME).read_text()
    assert str(tmp_path) not in text
    assert manifest.read(values[0] / manifest.NAME).to_json() == text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.update(version=2), "version 2 is newer"),
        (lambda data: data.update(format="x"), "not the manifest of a desktop image"),
        (lambda data: data.pop("size"), "lacks a field"),
        (lambda data: data.update(packages=[{"name": "a"}]), "lacks a field"),
        (lambda data: data.update(more=1), "lacks a field or has a wrong one"),
    ],
)
def test_a_manifest_of_another_kind_is_refused(change, message):
    path = images.publish() / manifest.NAME
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(DesktopImageError, match=message):
        manifest.read(path)


@pytest.mark.parametrize("part", [manifest.NAME, manifest.FILES])
def test_a_file_that_nests_without_an_end_is_refused(packed, part):
    nested = b"[" * 100_000

    def change(info, content):
        if info.name == manifest.NAME and part == manifest.FILES:
            data = json.loads(content)
            data["files_sha256"] = hashlib.sha256(nested).hexdigest()
            return info, json.dumps(data).encode()
        return info, nested if info.name == part else content

    repack(packed, change)
    with pytest.raises(DesktopImageError, match=f"{part}:?.* is (not JSON|no entry of a file)"):
        cache.import_file(packed, None, print)
    assert cache.images() == {}


def test_an_image_goes_out_and_comes_back(packed, folder):
    called, result = cache.import_file(packed, None, print)
    assert called == "core"
    outcome = cache.resolve("core")
    assert outcome == folder / result.id
    assert cache.resolve(result.id[:5]) == outcome
    assert cache.verify(outcome) == []
    program = outcome / "root/usr/bin/sudo"
    assert program.stat().st_mode & 0o7777 == 0o4755
    assert program.stat().st_mtime == file_entries.EPOCH
    assert (outcome / "root/closed").stat().st_mode & 0o7777 == 0o700
    assert os.readlink(outcome / "root/bin") == "usr/bin"
    # the same again changes nothing, and gives another name
    before = outcome.stat().st_ino
    cache.import_file(packed, "second", print)
    assert cache.names() == {"core": result.id, "second": result.id}
    assert outcome.stat().st_ino == before


def test_images_are_closed_to_others(folder):
    images.publish()
    assert folder.stat().st_mode & 0o077 == 0


CHANGES = {
    "content": (lambda root: (root / "etc/words").write_text("HELLO"), "etc/words: has another"),
    "size": (lambda root: (root / "etc/words").write_text("hi"), "etc/words: has 2 bytes, not 5"),
    "mode": (lambda root: (root / "usr/bin/sudo").chmod(0o755), "sudo: has the permissions 755"),
    "missing": (lambda root: (root / "etc/words").unlink(), "etc/words: is missing"),
    "more": (lambda root: (root / "etc/new").touch(), "etc/new: is not a file of the image"),
    "kind": (
        lambda root: [(root / "etc/words").unlink(), (root / "etc/words").mkdir()],
        "etc/words: is a folder, not a file",
    ),
    "link": (
        lambda root: [(root / "bin").unlink(), (root / "bin").symlink_to("/bin")],
        "root/bin: has another content",
    ),
    "pipe": (lambda root: os.mkfifo(root / "etc/pipe"), "etc/pipe: is not a file of the image"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_verify_says_which_file_was_changed(name):
    change, message = CHANGES[name]
    result = images.publish()
    assert run("verify", "tiny").exit_code == 0
    change(result / "root")
    value = run("verify", "tiny")
    assert value.exit_code == 1
    assert message in value.output
    assert "1 files differ" in value.output


def test_verify_finds_a_changed_manifest_or_list():
    result = images.publish()
    listed = result / manifest.FILES
    text = listed.read_text()
    listed.write_text(text.replace("words", "WORDS"))
    assert cache.verify(result) == [f"{listed}: is missing or was changed"]
    listed.write_text(text)
    path = result / manifest.NAME
    path.write_text(path.read_text().replace("signature", "none"))
    assert "manifest.json: was changed" in cache.verify(result)[0]


@pytest.mark.parametrize("name", [*CHANGES, "root", "manifest", "list"])
def test_an_image_that_was_damaged_is_whole_once_it_is_imported_again(name, packed):
    damage = {
        "root": lambda result: file_entries.remove(result / cache.ROOT),
        "manifest": lambda result: (result / manifest.NAME).write_text("{"),
        "list": lambda result: (result / manifest.FILES).unlink(),
    }
    _, value = cache.import_file(packed, None, print)
    result = cache.images_folder() / value.id
    if name in damage:
        damage[name](result)
    else:
        CHANGES[name][0](result / "root")
    cache.import_file(packed, None, print)
    assert cache.verify(cache.resolve("core")) == []


def test_an_image_that_was_damaged_is_whole_once_it_is_built_again():
    result = images.publish()
    (result / "root/etc/words").write_text("HELLO")
    before = result.stat().st_ino
    assert images.publish() == result
    assert cache.verify(result) == []
    assert images.publish() == result
    assert result.stat().st_ino != before


def test_a_damaged_image_that_a_desktop_runs_from_stays(monkeypatch, packed):
    _, value = cache.import_file(packed, None, print)
    result = cache.images_folder() / value.id
    (result / "root/etc/words").write_text("HELLO")
    record = {"id": "d1", "image": result.name}
    monkeypatch.setattr(cache.registry, "records", lambda: [record])
    with pytest.raises(DesktopImageError, match="in use by d1; end them first"):
        cache.import_file(packed, None, print)
    assert (result / "root/etc/words").read_text() == "HELLO"


def test_a_changed_image_is_not_exported(tmp_path):
    result = images.publish()
    (result / "root/etc/words").write_text("HELLO")
    with pytest.raises(DesktopImageError, match="etc/words: is not as the image's manifest says"):
        archive.write(result, tmp_path / "x.tar.zst")
    assert not (tmp_path / "x.tar.zst").exists()


@pytest.mark.parametrize("part", [0.0, 0.3, 0.6, 0.95])
def test_a_file_that_is_cut_off_is_refused_and_leaves_nothing(packed, folder, part):
    data = packed.read_bytes()
    packed.write_bytes(data[: int(len(data) * part)])
    with pytest.raises(DesktopImageError, match=r"cut off|is no image"):
        cache.import_file(packed, None, print)
    assert cache.images() == {}
    assert list(folder.glob(".building-*")) == []


def test_a_file_that_is_damaged_or_something_else_is_refused(packed, tmp_path):
    second = tmp_path / "other.tar.zst"
    second.write_text("words")
    with pytest.raises(DesktopImageError, match="damaged"):
        cache.import_file(second, None, print)
    with pytest.raises(DesktopImageError, match="cannot be read"):
        cache.import_file(tmp_path / "none", None, print)


def repack(path, change):
    """Write an image's file again, with each member as `change(info, content)` gives it."""
    raw = zstandard.ZstdDecompressor().stream_reader(path.read_bytes())
    out = io.BytesIO()
    with tarfile.open(fileobj=raw, mode="r|") as old, tarfile.open(fileobj=out, mode="w") as new:
        for info in old:
            file = old.extractfile(info) if info.isfile() else None
            content = b"" if file is None else file.read()
            info, content = change(info, content)
            if info is not None:
                info.size = len(content)
                new.addfile(info, io.BytesIO(content))
    path.write_bytes(zstandard.compress(out.getvalue()))


def test_a_tampered_file_is_named(packed, folder):
    def change(info, content):
        return info, b"HELLO" if info.name == "root/etc/words" else content

    repack(packed, change)
    with pytest.raises(DesktopImageError, match="root/etc/words is not as its manifest says"):
        cache.import_file(packed, None, print)
    assert cache.images() == {}


def test_a_file_that_would_leave_the_folder_is_refused(packed, tmp_path):
    def change(info, content):
        if info.name == "root/etc/words":
            info.name = "../../escaped"
        return info, content

    repack(packed, change)
    with pytest.raises(DesktopImageError, match=r"'\.\./\.\./escaped' in the place of"):
        cache.import_file(packed, None, print)
    assert not list(tmp_path.rglob("escaped"))


def test_what_a_list_may_not_hold():
    for path in ("/etc/passwd", "root/../../x", "", "root//x"):
        with pytest.raises(DesktopImageError, match="cannot be in an image"):
            file_entries.parse(file_entries.Entry(path, "file").to_json(), "list")
    # a file below a link would be written where that leads
    with pytest.raises(DesktopImageError, match="list:1: is no entry"):
        file_entries.parse("[1, 2]\n", "list")


def test_an_image_with_a_file_below_a_link_is_refused(tmp_path):
    folder = tmp_path / "made"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    entries = [
        file_entries.Entry("out", "link", content=str(tmp_path)),
        file_entries.Entry("out/escaped", "file", 0o644, 1, 0, file_entries.digest(_one(tmp_path))),
    ]
    (folder / manifest.FILES).write_text(file_entries.listing(entries))
    (tmp_path / "escaped").write_text("x")
    result = dataclasses.replace(
        images.fill(_new(tmp_path)), files_sha256=file_entries.digest(folder / manifest.FILES)
    )
    (folder / manifest.NAME).write_text(result.to_json())
    archive.write(folder, tmp_path / "bad.tar.zst")
    (tmp_path / "escaped").unlink()
    with pytest.raises(DesktopImageError, match="out/escaped"):
        archive.unpack(tmp_path / "bad.tar.zst", _new(tmp_path))
    assert not (tmp_path / "escaped").exists()


def _one(top):
    (top / "one").write_text("x")
    return top / "one"


def _new(top):
    path = top / f"new{len(list(top.iterdir()))}"
    path.mkdir()
    return path


def test_an_image_for_another_architecture_is_refused(packed, monkeypatch):
    cache.import_file(packed, None, print)
    monkeypatch.setattr(cache.debian, "ARCHITECTURES", {os.uname().machine: "m68k"})
    for act in (lambda: cache.resolve("core"), lambda: cache.import_file(packed, None, print)):
        with pytest.raises(DesktopImageError, match="this machine is m68k"):
            act()


def test_a_full_disk_is_said_before_anything_is_written(packed, monkeypatch):
    usage = type("Usage", (), {"free": 1})
    monkeypatch.setattr(cache.shutil, "disk_usage", lambda folder: usage)
    with pytest.raises(StorageError, match=r"MB are needed.*AGENTHIJACK_IMAGES"):
        cache.import_file(packed, None, print)


def test_a_folder_that_runs_no_programs_is_refused_and_found_by_the_doctor(monkeypatch):
    flags = type("Flags", (), {"f_flag": os.ST_NOEXEC})
    monkeypatch.setattr(cache.os, "statvfs", lambda folder: flags)
    with pytest.raises(DesktopImageError, match=r"noexec.*AGENTHIJACK_IMAGES"):
        images.publish()
    folder_finding, _ = image_checks.findings(None)
    assert folder_finding[1] is False
    assert "noexec" in folder_finding[2]
    assert "AGENTHIJACK_IMAGES" in folder_finding[3]


def test_a_killed_process_leaves_nothing_half(folder):
    command = [sys.executable, "-c", HALF]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
        assert len(list(folder.glob(".building-*"))) == 1
        assert cache.images() == {}
        with pytest.raises(DesktopImageError):
            cache.resolve("building")
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    result = images.publish()
    assert list(folder.glob(".building-*")) == []
    assert list(cache.images()) == [result.name]


def test_a_second_build_waits_and_says_for_whom(folder):
    command = [sys.executable, "-c", HALF.replace("60", "1")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    output = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
        with cache.cache_lock(output.append):
            assert process.wait(10) == 0
    holder = f"process {process.pid} on {os.uname().nodename}"
    assert output == [f"waiting: {folder} is being written by {holder}"]


@pytest.mark.parametrize("name", ["", "Upper", "a/b", "-x", ".x", "a_b", "x" * 41, "host"])
def test_names_that_no_image_can_have(name):
    with pytest.raises(ParameterError):
        cache.check_name(name)


def test_unknown_images_are_answered_with_those_there_are():
    with pytest.raises(DesktopImageError, match=r"no image 'web'.*there are: none"):
        cache.resolve("web")
    images.publish()
    with pytest.raises(DesktopImageError, match="did you mean 'tiny'"):
        cache.resolve("tony")


def test_which_image_a_desktop_starts_from(monkeypatch):
    result = images.publish()
    assert cache.find_image_folder(None) is None
    assert cache.find_image_folder("tiny") == result
    monkeypatch.setenv(cache.CHOICE, "tiny")
    assert cache.find_image_folder(None) == result
    assert cache.find_image_folder("host") is None
    assert image_checks.is_asked_for(None)
    assert not image_checks.is_asked_for("host")
    monkeypatch.setenv(cache.CHOICE, "gone")
    _, value = image_checks.findings(None)
    assert value[1] is False
    assert "no image 'gone'" in value[2]


def test_an_image_in_use_is_not_removed(monkeypatch):
    result = images.publish()
    second = images.publish("other", "other")
    record = {"id": "d1", "image": result.name}
    monkeypatch.setattr(cache.registry, "records", lambda: [record])
    with pytest.raises(DesktopImageError, match="in use by d1"):
        cache.remove("tiny", print)
    assert cache.remove("other", print) == second.name
    assert cache.names() == {"tiny": result.name}
    assert not second.exists()


def test_commands(packed):
    assert run("list").output.startswith("no images in ")
    assert run("import", str(packed), "--name", "web").exit_code == 0
    assert run("list").output.startswith("web ")
    (row,) = json.loads(run("list", "--json").output)
    assert row["names"] == ["web"]
    again = packed.with_name("again.tar.zst")
    assert run("export", "web", str(again)).exit_code == 0
    assert archive.read_manifest(again).id == row["id"]
    assert run("remove", "web").output == f"image {row['id']} is gone\n"
    assert "no image 'web'" in str(run("verify", "web").exception)


def test_the_kind_of_a_file_system(tmp_path):
    mounts = tmp_path / "mounts"
    mounts.write_text("a / ext4 rw 0 0\nb /mem tmpfs rw 0 0\nc /memory xfs rw 0 0\n")
    assert image_checks.file_system(Path("/mem/x"), mounts) == "tmpfs"
    assert image_checks.file_system(Path("/memory"), mounts) == "xfs"
    assert image_checks.file_system(Path("/other"), mounts) == "ext4"
