"""One embedded desktop: what it is, what it keeps from the machine, and what `reset` brings
back."""

import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest

from hijack_data.errors import ParameterError
from online_env import EmbeddedDesktop
from online_env.desktops.protocol import CAPABILITIES
from online_env.embedded import home
from online_env.embedded.runtime import account, registry
from online_env.errors import DesktopError, UnknownDesktopError

from support.waiting import still
from support.waiting import until as _wait


def shell(desktop, command, timeout=30):
    """What a shell command of the desktop's user printed."""
    result = desktop.execute(command, timeout)
    return result.output.strip()


def test_is_a_desktop_with_a_wallpaper_and_a_panel(embedded_desktop):
    assert embedded_desktop.capabilities == CAPABILITIES
    picture = embedded_desktop.screenshot()
    assert picture.shape == (1080, 1920, 3)
    assert len(np.unique(picture[200:900].reshape(-1, 3), axis=0)) > 2000, "no wallpaper"
    panel = picture[1060, 600:1500].reshape(-1, 3)
    assert (panel == panel[0]).all(), "no panel at the bottom"
    assert not (picture[1060, 700] == picture[700, 700]).all()


def test_user_is_who_osworld_expects(embedded_desktop):
    assert shell(embedded_desktop, "id -un; echo $HOME; pwd") == "user\n/home/user\n/home/user"
    assert shell(embedded_desktop, "echo password | sudo -S id -u 2>/dev/null") == "0"
    assert embedded_desktop.execute(["sudo", "-k", "-n", "true"]).returncode != 0, (
        "sudo works without a password"
    )
    assert embedded_desktop.execute("echo wrong | sudo -k -S true").returncode != 0


def test_osworld_mode_needs_no_password(up):
    desktop = up(osworld=True)
    assert shell(desktop, "sudo -n id -u") == "0"


def test_home_is_ours_and_belongs_to_the_user(embedded_desktop):
    listed = shell(embedded_desktop, "ls /home/user").split()
    assert set(home.FOLDERS) <= set(listed)
    assert shell(embedded_desktop, "find /home/user ! -user user | wc -l") == "0"


def test_machine_is_out_of_reach(embedded_desktop, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("x")
    assert embedded_desktop.execute(["test", "-e", str(secret)]).returncode == 1
    assert embedded_desktop.execute(["ls", "/root"]).returncode != 0, "/root can be listed"
    assert not embedded_desktop.execute(["test", "-e", "/run/agenthijack"]).ok
    assert shell(embedded_desktop, "ps -e -o user= | sort -u").split() == ["root", "user"]
    assert int(shell(embedded_desktop, "ps -e -o pid= | wc -l")) < 60, (
        "the machine's processes are visible"
    )


def test_root_inside_cannot_harm_the_machine(embedded_desktop):
    sudo = "echo password | sudo -S sh -c"
    for command in (
        "mount -t tmpfs none /mnt",
        "mknod /dev/disk b 254 0",
        "echo 1 > /proc/sys/kernel/panic",
        "ip link set lo down",
        "nft flush ruleset",
    ):
        assert embedded_desktop.execute(f"{sudo} '{command}'").returncode != 0, f"{command} worked"
    assert (
        shell(embedded_desktop, f"{sudo} 'touch /usr/bin/planted && echo written' 2>/dev/null")
        == "written"
    )
    assert not Path("/usr/bin/planted").exists()


def test_the_desktop_has_no_interface_to_the_machine(embedded_desktop):
    names = shell(embedded_desktop, "ip -o link | cut -d: -f2 | cut -d@ -f1").split()
    assert names == ["lo", "eth0"]
    assert shell(embedded_desktop, "ip -o -4 addr show eth0").split()[3] == "10.77.0.2/24"
    assert not [name for name in os.listdir("/sys/class/net") if name.startswith("ah")]


def test_reset_is_pristine(up):
    desktop = up()
    desktop.write_file("/home/user/Desktop/left.txt", b"x")
    shell(
        desktop,
        "rm -rf ~/Documents ~/.config; echo password | sudo -S sh -c 'echo x > /etc/planted'",
    )
    desktop.reset()
    assert desktop.execute("test -d ~/Documents && test -d ~/.config && ! test -e /etc/planted").ok


def test_standby_makes_reset_quick(up):
    desktop = up(standby=True, name="quick")
    calls = [desktop.id]
    for _ in range(2):
        desktop.write_file("/home/user/Desktop/left.txt", b"x")
        assert desktop.wait_for_standby()
        spare = registry.load(f"quick-{len(calls) + 1}")
        assert registry.state(spare) == "ready"
        desktop.reset()
        assert desktop.record["init"] == spare["init"], "it was not the one that stood by"
        assert shell(desktop, "ls /home/user/Desktop") == ""
        calls.append(desktop.id)
    assert calls == ["quick", "quick-2", "quick-3"]


def test_width_and_height_in_the_wrong_order_are_told():
    warns = pytest.warns(UserWarning, match=r"1080 wide and 1920 high.*size=\(1080, 1920\)")
    with warns, pytest.raises(DesktopError, match="bad_name"):  # so that none is started
        EmbeddedDesktop.up(size=(1920, 1080), name="bad_name")


def test_a_dead_spare_is_replaced(up, leaves_nothing):
    desktop = up(standby=True, name=f"{leaves_nothing}a", size=(600, 800))
    assert desktop.wait_for_standby()
    spare = registry.load(f"{leaves_nothing}a-2")
    os.kill(spare["init"][0], signal.SIGKILL)
    _wait(lambda: not registry.alive(spare["init"]))
    desktop.reset()
    assert desktop.id == f"{leaves_nothing}a-3"
    assert desktop.execute(["true"]).ok
    desktop.close()


def test_several_side_by_side(up):
    first, second = up(size=(720, 1280)), up(size=(600, 800))
    assert first.id != second.id
    assert first.record["guest"] != second.record["guest"]
    first.write_file("/tmp/mine", b"1")
    assert second.execute(["test", "-e", "/tmp/mine"]).returncode == 1
    assert first.screenshot().shape == (720, 1280, 3)
    assert second.screenshot().shape == (600, 800, 3)


def test_apps_are_open_when_it_is_ready(up):
    desktop = up(apps=("editor", "terminal"))
    listed = shell(desktop, "wmctrl -lx").lower()
    assert "mousepad" in listed
    assert "xfce4-terminal" in listed


def test_browser_has_the_names_that_tasks_use(up, browser_machine):
    desktop = up(apps=("browser",))
    assert int(shell(desktop, "pgrep -c -x chrome")) > 0
    assert "Chromium" in shell(desktop, "wmctrl -lx")
    assert shell(desktop, "ls ~/.config/google-chrome/Default/Preferences") != ""


def test_the_browsers_command_is_there_only_with_a_browser(embedded_desktop):
    assert embedded_desktop.execute("command -v google-chrome").ok == bool(shutil.which("chromium"))


def test_lock_screen_takes_the_password(up):
    desktop = up()
    _wait(lambda: desktop.execute("mate-screensaver-command -l").ok)
    _wait(lambda: "is active" in shell(desktop, "mate-screensaver-command -q"))
    shell(desktop, "xdotool key shift")
    _wait(lambda: "password-text" in desktop.accessibility())
    still(desktop.screenshot)
    shell(desktop, "xdotool type --delay 30 password; xdotool key Return")
    _wait(lambda: "is inactive" in shell(desktop, "mate-screensaver-command -q"))


def test_attach_reaches_and_never_ends_it(up):
    from online_env.embedded.desktop import EmbeddedDesktop

    desktop = up()
    with EmbeddedDesktop.attach(desktop.id) as second:
        second.write_file("/tmp/from-other", b"1")
        with pytest.raises(DesktopError, match="another process"):
            second.reset()
    assert desktop.read_file("/tmp/from-other") == b"1"
    with pytest.raises(UnknownDesktopError, match="no running desktop 'nobody'"):
        EmbeddedDesktop.attach("nobody")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size": (10, 10)}, "200 to 8192"),
        ({"apps": ("browsr",)}, "did you mean 'browser'"),
        ({"size": 5}, "height, width"),
    ],
)
def test_wrong_wishes_are_refused_at_once(up, options, message):
    with pytest.raises((ParameterError, TypeError), match=message):
        up(**options)


@pytest.mark.parametrize("name", ["", "UPPER", "a/b", "..", "x" * 21, "-a", "a b"])
def test_names_that_could_leave_the_folder_are_refused(up, name):
    with pytest.raises(DesktopError, match="must be 1 to 20"):
        up(name=name)


def test_taken_name_is_refused(up):
    up(name="taken")
    with pytest.raises(DesktopError, match="there already"):
        up(name="taken")


def test_account_is_not_on_the_machine(embedded_desktop):
    with open("/etc/passwd") as handle:
        assert f":{account.UID}:" not in handle.read()
