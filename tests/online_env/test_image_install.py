"""What `hijack desktop install` does on each host, and what desktops start from afterwards."""

import http.server
import threading
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner

from online_env.desktop_commands import desktop as commands
from online_env.embedded import packages
from online_env.embedded.image import archive, cache, image_checks, image_setup
from online_env.embedded.runtime import network, program_paths
from online_env.embedded.runtime.desktop_config import SetupError
from online_env.errors import DesktopImageError

from support import images

DEBIAN_12 = 'NAME="Debian GNU/Linux"\nID=debian\nVERSION_ID="12"\n'
UBUNTU = 'ID=ubuntu\nID_LIKE=debian\nVERSION_ID="24.04"\n'


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.delenv(cache.CHOICE, raising=False)
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "images"))
    return tmp_path / "images"


@pytest.fixture
def packed(tmp_path):
    """A tiny image as a file; it is not in the cache any more."""
    path = tmp_path / "tiny.tar.zst"
    archive.write(images.publish(), path)
    cache.remove("tiny", print)
    return path


def run(*words):
    return CliRunner().invoke(commands, ["install", *words])


@pytest.mark.parametrize(
    ("text", "user", "apt", "expected"),
    [
        (DEBIAN_12, 0, True, True),
        (DEBIAN_12, 1000, True, False),
        (DEBIAN_12, 0, False, False),
        (DEBIAN_12.replace("12", "13"), 0, True, False),
        (UBUNTU, 0, True, False),
        (None, 0, True, False),
    ],
)
def test_only_root_on_debian_12_gets_packages(tmp_path, monkeypatch, text, user, apt, expected):
    monkeypatch.setattr(image_setup.os, "geteuid", lambda: user)
    monkeypatch.setattr(image_setup.shutil, "which", lambda name: name if apt else None)
    release = tmp_path / "os-release"
    if text is not None:
        release.write_text(text)
    assert image_setup.prefers_packages(release) is expected


def test_a_file_becomes_what_desktops_start_from(packed, folder):
    result = run("--image", str(packed))
    assert result.exit_code == 0, result.output
    assert "desktops start from the image core" in result.output
    assert cache.find_image_folder(None) == cache.resolve("core")
    assert cache.find_image_folder(cache.HOST) is None
    assert image_checks.is_asked_for(None)
    cache.remove("core", print)
    assert cache.find_image_folder(None) is None
    assert not (folder / "default").exists()


def test_an_image_that_is_here_is_taken(monkeypatch):
    images.publish(name="mine")
    monkeypatch.setattr(image_setup, "prefers_packages", lambda: False)
    result = run("--profile", "core")
    assert "desktops start from the image mine" in result.output
    assert run("--image", "mine").exit_code == 0
    assert "no image 'other'" in str(run("--image", "other").exception)


def test_the_present_profiles_stay(monkeypatch):
    """As with apt, where a second `install` takes nothing away."""
    built_images = []

    def build(recipe, name, report):
        built_images.append(recipe.profiles)
        return "new", None

    images.publish(name="mine")
    cache.make_default("mine")
    monkeypatch.setattr(image_setup.build, "build", build)
    monkeypatch.setattr(image_setup, "_own_archives", list)
    assert image_setup.ensure_image(["media"], None, None, print) == "new"
    assert built_images[-1] == ("core", "media")


@pytest.fixture
def server(tmp_path):
    """The address of a web server that has the files of the test."""
    handler = partial(http.server.SimpleHTTPRequestHandler, directory=str(tmp_path))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as threading_httpserver:
        threading.Thread(target=threading_httpserver.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{threading_httpserver.server_port}"
        threading_httpserver.shutdown()


def test_an_image_is_fetched(packed, server, folder):
    assert image_setup.ensure_image((), f"{server}/{packed.name}", None, print) == "core"
    assert cache.verify(cache.resolve("core")) == []
    assert [path.name for path in folder.iterdir() if path.is_file()] == [".lock"]


def test_what_cannot_be_fetched_is_named(packed, server):
    packed.write_bytes(packed.read_bytes()[:-100])
    for name, reason in (("none", "not found"), (packed.name, "is cut off")):
        with pytest.raises(DesktopImageError, match=f"{server}/{name}.*({reason})"):
            image_setup.ensure_image((), f"{server}/{name}", None, print)
    nobody = "http://127.0.0.1:9/x"
    with pytest.raises(DesktopImageError, match=r"cannot be fetched.*--image FILE"):
        image_setup.ensure_image((), nobody, None, print)
    with pytest.raises(DesktopImageError, match="there is no such file"):
        image_setup.ensure_image((), "gone.tar.zst", None, print)
    assert cache.images() == {}


def test_without_an_archive_it_says_what_to_give(monkeypatch):
    def refuse():
        raise DesktopImageError("names no archive; give one with --mirror URL")

    monkeypatch.setattr(image_setup.sources, "from_machine", refuse)
    with pytest.raises(DesktopImageError, match=r"--mirror URL, or an image .* --image FILE"):
        image_setup.ensure_image(("web",), None, None, print)


def test_host_and_image_exclude_each_other():
    result = run("--host", "--image", "x")
    assert result.exit_code == 2
    assert "without --image" in result.output


def test_what_an_image_lacks(monkeypatch):
    images.publish(name="mine")
    monkeypatch.setattr(packages, "missing", lambda names: ["of the machine"])
    assert image_setup.lacking("web") == ["of the machine"]
    cache.make_default("mine")
    assert image_setup.lacking("web") == list(packages.PROFILES["web"])


def test_a_program_comes_from_the_machine_or_from_the_image(tmp_path, monkeypatch):
    program = tmp_path / "usr/bin/never-there"
    program.parent.mkdir(parents=True)
    program.write_text("")
    result = program_paths.command("never-there", str(tmp_path))
    assert result[-1] == str(program)
    assert Path(result[0]).name.startswith("ld-linux-")
    assert result[0].startswith(str(tmp_path))
    assert program_paths.command("sh", str(tmp_path)) == [program_paths.shutil.which("sh")]
    with pytest.raises(SetupError, match=r"never-there is not installed.*hijack desktop install"):
        program_paths.command("never-there")
    network.remove("never-there")  # nothing of it is there: fine
