"""Desktops that start from an image: like others, and nothing of the machine's is in them.

They use an image that is there, `$AGENTHIJACK_IMAGE` or any other: building one takes minutes.
"""

import os
from pathlib import Path

import numpy as np
import pytest

import hijack_data as hj
from online_env.corrupting.desktop_corruption import corrupt_desktop
from online_env.effects import resume
from online_env.embedded.image import cache
from online_env.errors import DesktopError

from support import needs, processes

NINE = (
    "pop_ups",
    "resolution",
    "marks",
    "subtitle",
    "multi_apps",
    "accidental_touch",
    "app_minimization",
    "network_error",
    "verification",
)
BUILD = f"{needs.HIJACK} desktop image build"
SECRET = "words of the machine"
PYTHON = "import sys; print(sys.version_info[:2])"


@pytest.fixture(scope="module")
def image(embedded_machine):
    """The name of an image."""
    expected = os.environ.get(cache.CHOICE, "")
    names = [expected] if expected not in ("", cache.HOST) else list(cache.names())
    for name in names:
        try:
            cache.resolve(name)
        except DesktopError:
            continue
        return name
    needs.skip(f"no image of the desktop in {cache.images_folder()}", BUILD)


@pytest.fixture(scope="module")
def desktop(image):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=(800, 1200), apps=("editor",), image=image) as desktop:
        yield desktop


def test_it_is_a_desktop_like_another(desktop, image):
    assert desktop.record["image"] == cache.resolve(image).name
    picture = desktop.screenshot()
    assert picture.shape == (800, 1200, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100
    assert "mousepad" in desktop.accessibility().lower()
    assert desktop.run("import pyautogui; print(pyautogui.size())").ok
    assert desktop.execute("id -un").output == "user\n"
    assert desktop.execute("hostname").output == "desktop\n"


def test_the_guest_server_runs_on_the_images_own_python(desktop, image):
    server = processes.guest_server(desktop.record)
    python = cache.resolve(image) / "root/usr/bin/python3"
    assert os.path.samestat(os.stat(f"/proc/{server}/exe"), python.resolve().stat())
    # and on the machine's where there is no image: else this test would prove nothing
    assert not os.path.samestat(os.stat(f"/proc/{os.getpid()}/exe"), python.resolve().stat())


def test_nothing_of_the_machine_can_be_read(desktop):
    needs.root("writing into system folders")
    name = f"zz-{os.getpid()}"
    marks = [Path(folder, name) for folder in ("/etc", "/usr/share", "/opt", "/var/lib", "/usr")]
    try:
        for path in marks:
            path.write_text(SECRET)
        for path in marks:
            result = desktop.execute(f"echo password | sudo -S cat {path}")
            assert "No such file" in result.error
        value = desktop.execute(
            f"echo password | sudo -S find / -xdev -name {name}; sudo -S cat /etc/shadow"
        )
        assert name not in value.output
    finally:
        for path in marks:
            path.unlink(missing_ok=True)
    inside = desktop.execute("cat /proc/self/mountinfo; env; ps ax").output
    assert str(cache.images_folder()) not in inside
    assert "agenthijack" not in inside


def test_our_code_and_the_guests_packages_are_not_there(desktop):
    result = desktop.execute(
        "echo password | sudo -S find / -name 'hijack*' -o -name 'online_env*' -o -name 'starlette*'"
        " -o -name uvicorn 2>/dev/null | grep -v ^/proc"
    )
    assert result.output == ""
    assert not desktop.execute(["python3", "-c", "import starlette"]).ok


@pytest.mark.parametrize("name", NINE)
def test_all_nine_are_applied_proved_and_undone(desktop, name):
    lacking = {"network_error": "firewall", "verification": "lock"}.get(name)
    if lacking is not None and lacking not in desktop.capabilities:
        needs.root(name)
    result = corrupt_desktop(desktop, hj.make_corruption(name), seed=3)
    assert result.ok, result.saw
    for record in reversed(result.records):
        assert resume(record, desktop).undo().ok
    if name == "accidental_touch":  # who knows what it opened
        desktop.reset()


def test_reset_is_pristine(image):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=(600, 800), image=image, standby=True) as desktop:
        desktop.write_file("/home/user/note", b"x")
        desktop.execute("echo password | sudo -S touch /usr/share/note")
        desktop.reset()
        assert desktop.record["image"] == cache.resolve(image).name
        assert not desktop.execute("test -e /home/user/note -o -e /usr/share/note").ok
    assert not (cache.resolve(image) / "root/usr/share/note").exists()


def test_an_unknown_image_is_refused_before_anything_starts(embedded_machine):
    from online_env.embedded.desktop import EmbeddedDesktop

    with pytest.raises(DesktopError, match=r"no image 'never-made'.*image build"):
        EmbeddedDesktop.up(image="never-made")
