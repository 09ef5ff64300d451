"""What every provider of `Desktop` promises, tried on all that can run here; a quirk of one of them
is a failure."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support import needs
from support.waiting import until as eventually

pytest.importorskip("lxml", reason=needs.ONLINE)

from lxml import etree

from hijack_data.plan import Effect
from online_env.desktops.http import HttpDesktop
from online_env.desktops.osworld import OsworldDesktop
from online_env.desktops.protocol import CAPABILITIES, Desktop
from online_env.effects import perform
from online_env.errors import DesktopError, GuestError, MissingCapabilityError

SIZE = (600, 1000)
HOME = "/home/user"
# The effect that needs a capability, and so shows whether the claim is true.
EFFECTS = {
    "firewall": Effect("firewall", {}),
    "lock": Effect("lock", {}),
    "windows": Effect("minimise", {}),
}


@dataclass
class Provided:
    """A desktop of one provider; `resets` says whether it can be made pristine."""

    desktop: Any
    resets: bool = True


@contextlib.contextmanager
def embedded(folder: Path) -> Iterator[Provided]:
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=SIZE) as desktop:
        yield Provided(desktop)


@contextlib.contextmanager
def http_with_token(folder: Path) -> Iterator[Provided]:
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=SIZE) as machine:
        token = Path(machine.record["token_file"]).read_text()
        with HttpDesktop(
            machine.record["guest"], token, source=machine.record["source"]
        ) as desktop:
            yield Provided(desktop, resets=False)


@contextlib.contextmanager
def http_plain(folder: Path) -> Iterator[Provided]:
    """As if the guest were OSWorld's: no token, so none of our own routes."""
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=SIZE, osworld=True) as machine:

        def pristine(task: object) -> str:
            machine.reset()
            return machine.record["guest"]

        with HttpDesktop(machine.record["guest"], resetter=pristine) as desktop:
            yield Provided(desktop)


@contextlib.contextmanager
def osworld(folder: Path) -> Iterator[Provided]:
    """Over OSWorld's own `DesktopEnv`, in its own Python."""
    from online_env.osworld.run import embedded_env

    with embedded_env(needs.osworld(), folder, size=SIZE, standby=False) as env:
        env.reset()
        yield Provided(OsworldDesktop(env, password="password"))


@pytest.fixture(
    scope="module",
    params=[embedded, http_with_token, http_plain, osworld],
    ids=lambda made: made.__name__,
)
def provided(
    request: pytest.FixtureRequest, embedded_machine: None, tmp_path_factory: Any
) -> Iterator[Provided]:
    with request.param(tmp_path_factory.mktemp("desktop")) as provided:
        yield provided


@pytest.fixture
def desktop(provided: Provided) -> Any:
    return provided.desktop


def names(desktop: Any) -> set[str]:
    """Names of everything in the accessibility tree, read now."""
    tree = etree.fromstring(desktop.accessibility().encode())
    assert tree.tag == "desktop-frame"
    return {str(node.get("name")) for node in tree.iter() if isinstance(node.tag, str)}


def test_it_is_a_desktop(desktop: Any) -> None:
    assert isinstance(desktop, Desktop)
    assert desktop.size == SIZE
    assert {"apps", "files", "accessibility"} <= desktop.capabilities <= CAPABILITIES


def test_screenshots_are_rgb_arrays_of_ones_own(desktop: Any) -> None:
    picture = desktop.screenshot()
    assert (picture.shape, picture.dtype) == ((*SIZE, 3), np.uint8)
    assert len(np.unique(picture[:500].reshape(-1, 3), axis=0)) > 1000, "no wallpaper"
    snapshot = picture.copy()
    desktop.run("pyautogui.moveTo(5, 300)")
    desktop.screenshot()
    assert (picture == snapshot).all(), "a later screenshot changes an earlier one"


def test_the_pointer_is_drawn_where_it_is(desktop: Any) -> None:
    spots = ((700, 200), (300, 400))
    pictures = []
    for x, y in spots:
        assert desktop.run(f"pyautogui.moveTo({x}, {y})").ok
        pictures.append(desktop.screenshot()[:540])  # without the panel's clock
    changed_pixels = np.argwhere((pictures[0] != pictures[1]).any(axis=2))
    near = [(abs(changed_pixels - (y, x)) < 40).all(axis=1) for x, y in spots]
    assert near[0].any()
    assert near[1].any()
    assert (near[0] | near[1]).all()


def test_the_tree_is_well_formed_and_never_old(desktop: Any) -> None:
    assert "conformance.txt" not in " ".join(names(desktop))
    desktop.write_file(f"{HOME}/Documents/conformance.txt", "ü <&> \x0b".encode())
    desktop.execute(f"mousepad {HOME}/Documents/conformance.txt >/dev/null 2>&1 &")
    eventually(lambda: "conformance.txt" in desktop.execute("wmctrl -l").output)
    eventually(lambda: "conformance.txt" in " ".join(names(desktop)))
    desktop.execute("pkill mousepad")
    eventually(lambda: "conformance.txt" not in desktop.execute("wmctrl -l").output)
    desktop.screenshot()
    assert "conformance.txt" not in " ".join(names(desktop))


def test_code_is_run(desktop: Any) -> None:
    result = desktop.run("print(6 * 7, 'é', type(time).__name__)")
    assert (result.ok, result.output.strip()) == (True, "42 é module")
    failed = desktop.run("1 / 0")
    assert not failed.ok
    assert failed.returncode == 1
    assert "ZeroDivisionError" in failed.error


def test_commands_are_run_as_the_user(desktop: Any) -> None:
    odd = """a "b" 'c' {d} \\n $HOME é"""
    assert desktop.execute(["printf", "%s", odd]).output == odd
    result = desktop.execute("id -un; pwd; echo err >&2; exit 3")
    assert (result.status, result.output, result.error, result.returncode) == (
        "success",
        f"user\n{HOME}\n",
        "err\n",
        3,
    )
    assert not result.ok
    assert desktop.execute(["true"]).ok


def test_a_command_that_cannot_start_is_an_answer(desktop: Any) -> None:
    absent = desktop.execute(["no-such-program", "x"])
    assert (absent.status, absent.returncode, absent.ok) == ("error", None, False)
    assert "No such file" in absent.error


def test_a_time_out_ends_the_command_and_is_an_answer(desktop: Any) -> None:
    late = desktop.execute("sleep 3334 & sleep 3333", timeout=1)
    assert (late.status, late.returncode, late.ok) == ("error", None, False)
    assert "timed out" in late.error
    eventually(lambda: desktop.execute(["pgrep", "-f", "^sleep 333[34]"]).output == "")


def test_what_goes_on_in_the_background_holds_nobody_up(desktop: Any) -> None:
    assert desktop.execute("sleep 3335 & echo started").output == "started\n"
    assert desktop.execute(["pkill", "-f", "^sleep 333[5]"]).ok, "it waited for what it started"


def test_big_output_arrives_or_is_cut_with_a_note(desktop: Any) -> None:
    result = desktop.execute(["/usr/bin/python3", "-c", "print('é' * 500_000)"])
    assert result.output == "é" * 500_000 + "\n"
    cut = desktop.execute("head -c 30000000 /dev/zero | tr '\\0' x; echo late >&2")
    assert cut.ok
    assert cut.error == "late\n"
    assert 2**20 < len(cut.output) < 2**24
    assert "output cut" in cut.output[-100:]


def test_files_go_there_and_back(desktop: Any) -> None:
    data = np.random.default_rng(0).bytes(300_000) + bytes(range(256)) + b"\r\n--"
    path = f'{HOME}/Documents/it\'s "one" ü.bin'
    for content in (data, b"", b"short"):
        desktop.write_file(path, content)
        assert bytes(desktop.read_file(path)) == content
    assert desktop.execute(["stat", "-c", "%U", path]).output == "user\n"


@pytest.mark.parametrize(
    "path", [f"{HOME}/none", f"{HOME}/Documents", "/etc/shadow", f"{HOME}/none/below"]
)
def test_files_that_the_user_may_not_read_are_errors(desktop: Any, path: str) -> None:
    with pytest.raises(GuestError):
        desktop.read_file(path)


@pytest.mark.parametrize("path", ["/etc/planted", f"{HOME}/Documents", "/proc/planted/x"])
def test_files_that_the_user_may_not_write_are_errors(desktop: Any, path: str) -> None:
    with pytest.raises(GuestError):
        desktop.write_file(path, b"x")
    assert not desktop.execute(["test", "-f", path]).ok


@pytest.mark.parametrize("capability", sorted(EFFECTS))
def test_what_is_claimed_works_and_what_is_missing_is_refused(
    desktop: Any, capability: str
) -> None:
    if capability not in desktop.capabilities:
        with pytest.raises(MissingCapabilityError, match=capability):
            perform(EFFECTS[capability], desktop)
        return
    applied = perform(EFFECTS[capability], desktop)
    try:
        probe = applied.probe()
        assert probe.ok, probe.problem
    finally:
        undone = applied.undo()
    assert undone.ok, undone.problem


def test_reset_is_pristine(provided: Provided) -> None:
    desktop = provided.desktop
    if not provided.resets:
        with pytest.raises(MissingCapabilityError, match="resetter"):
            desktop.reset()
        return
    desktop.execute("echo x > ~/Desktop/left; rm -rf ~/Documents; mousepad >/dev/null 2>&1 &")
    desktop.reset()
    assert desktop.execute("ls ~/Desktop; ls -d ~/Documents").output == f"{HOME}/Documents\n"
    assert "Mousepad" not in desktop.execute("wmctrl -l").output
    assert desktop.screenshot().shape == (*SIZE, 3)


def test_closing_twice_is_fine(desktop: Any) -> None:
    desktop.close()
    desktop.close()
    if not isinstance(desktop, HttpDesktop):  # there, only the connection is closed
        with pytest.raises(DesktopError):
            desktop.screenshot()
