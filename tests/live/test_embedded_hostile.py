"""What an agent may do to a desktop, and applications that stop: the desktop goes on, or says what
has ended."""

import contextlib
import socket
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from online_env.desktops.http import HttpDesktop
from online_env.embedded import view
from online_env.errors import DesktopError, GuestError

from support.processes import children, comm, traced
from support.waiting import until as wait_until

IMPOSTOR = """
import os, signal, socket, subprocess, time
if os.fork():
    os._exit(0)
with socket.socket() as taken:
    taken.bind(("127.0.0.1", 5000))
    taken.listen()
    for _ in range(3):
        found = subprocess.run(["pgrep", "-x", "desktop-server"], capture_output=True, text=True)
        for number in found.stdout.split():
            os.kill(int(number), signal.SIGKILL)
        time.sleep(0.5)
    open("/tmp/done", "w").close()
    time.sleep(100)
"""


@pytest.fixture(scope="module")
def desktop(embedded_machine):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=(600, 1000)) as desktop:
        yield desktop


@pytest.fixture
def editor(desktop):
    """The desktop with an empty Mousepad in front."""
    desktop.client.launch(["mousepad"])
    wait_until(
        lambda: any(
            row["active"] and "Mousepad" in row["title"] for row in desktop.client.windows()
        )
    )
    yield desktop
    desktop.execute("pkill -9 mousepad")
    wait_until(lambda: not any("Mousepad" in row["title"] for row in desktop.client.windows()))


def text_of(desktop):
    """What the editor holds."""
    desktop.client.input(
        [{"type": "hotkey", "keys": ["ctrl", "a"]}, {"type": "hotkey", "keys": ["ctrl", "c"]}]
    )
    time.sleep(0.3)
    return desktop.execute("timeout 3 xclip -o -selection clipboard").output


@pytest.mark.parametrize("how", ["STOP", "KILL"])
def test_an_application_that_hangs_or_is_killed_holds_nobody_up(editor, how):
    editor.execute(f"pkill -{how} mousepad")
    assert editor.screenshot().any()
    assert editor.accessibility().startswith("<desktop-frame")
    editor.client.input(
        [{"type": "click", "x": 400, "y": 300}, {"type": "type", "text": "unheard"}]
    )
    assert editor.run("pyautogui.moveTo(5, 5)").ok
    assert editor.execute(["true"]).ok
    if how == "STOP":  # it hung all the while
        state = editor.execute("ps -o state= -p $(pgrep -o -x mousepad)").output
        assert state.strip() == "T"
    editor.execute("pkill -CONT mousepad")


def test_ten_megabytes_of_text_are_refused_or_end_in_time(editor):
    much = "x" * 10_000_000
    with pytest.raises(GuestError, match="write a file"):
        editor.client.input([{"type": "type", "text": much}])
    refused = editor.run(f"pyautogui.write({much!r})")
    assert (refused.status, refused.returncode) == ("error", None)
    assert "Argument list too long" in refused.error
    refused = editor.execute(
        ["python", "-c", "import pyautogui; pyautogui.write('x' * 10_000_000)"]
    )
    assert (refused.returncode, "write a file" in refused.error) == (1, True)
    endless = "import pyautogui\nwhile True: pyautogui.write('y' * 1000)"
    assert "timed out" in editor.execute(["python", "-c", endless], timeout=2).error
    wait_until(lambda: set(text_of(editor)) <= {"y"})
    editor.client.input(
        [{"type": "hotkey", "keys": ["ctrl", "a"]}, {"type": "key", "key": "delete"}]
    )
    editor.client.input([{"type": "type", "text": "then Ω <as> ever"}])
    wait_until(lambda: text_of(editor) == "then Ω <as> ever")
    assert text_of(editor) == "then Ω <as> ever"  # nothing is still coming, and no key is held down


def test_ten_megabytes_go_through_a_file(editor):
    much = ("some text, ü\n" * 800_000).encode()
    editor.write_file("/home/user/Documents/much.txt", much)
    assert editor.read_file("/home/user/Documents/much.txt") == much


def test_a_body_over_the_limit_is_refused_and_no_harm_done(desktop):
    with pytest.raises(GuestError, match=r"larger than|failed"):
        desktop.write_file("/home/user/big", bytes(65 << 20))
    assert not desktop.execute(["test", "-e", "/home/user/big"]).ok


def test_a_display_that_hangs_is_told_in_time_and_may_come_back(desktop, monkeypatch):
    record = desktop.record
    display = next(pid for pid in children(record["init"][0]) if comm(pid) == "Xvfb")
    with open(record["token_file"]) as file:
        impatient = HttpDesktop(record["guest"], file.read(), timeout=2, source=record["source"])
    with impatient:
        monkeypatch.setattr(desktop, "_client", impatient)
        monkeypatch.setattr("online_env.embedded.runtime.frame_reader.READ_TIMEOUT_S", 1.0)
        desktop._frames.close()
        with traced(display):
            with pytest.raises(DesktopError, match="within 2 s"):
                desktop.screenshot()
            assert desktop.execute(["true"]).ok, "commands need no display"
        wait_until(lambda: answers(desktop.screenshot))
    assert desktop.screenshot().any()


def test_two_controllers_of_one_desktop_at_once(desktop):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.attach(desktop.id) as second, ThreadPoolExecutor(4) as pool:
        work = [
            pool.submit(act)
            for item in (desktop, second)
            for act in (
                lambda item=item: [item.screenshot().shape for _ in range(15)],
                lambda item=item: [
                    item.client.input([{"type": "move", "x": n, "y": 9}]) for n in range(15)
                ],
            )
        ]
        shapes = [shape for result in work for shape in result.result() if shape]
    assert shapes == [(600, 1000, 3)] * 30


def test_a_taken_port_is_told(desktop):
    with socket.socket() as busy_socket:
        busy_socket.bind(("127.0.0.1", 0))
        busy_socket.listen()
        port = busy_socket.getsockname()[1]
        with pytest.raises(DesktopError, match=f"port {port}.*another --port"):
            view.Viewer(desktop.record, port)


def test_nobody_inside_can_take_the_place_of_the_guest_server(up):
    desktop = up(size=(600, 800))
    desktop.client.launch(["/usr/bin/python3", "-c", IMPOSTOR])
    wait_until(lambda: answers(lambda: desktop.read_file("/tmp/done")))
    assert desktop.execute(["echo", "ours"]).output == "ours\n"
    assert desktop.client.health()["ready"]
    outside = HttpDesktop(desktop.record["guest"], source=desktop.record["source"])
    with outside, pytest.raises(GuestError, match="a token is needed"):
        outside.execute(["true"])


def test_no_request_for_a_desktop_that_has_gone_leaves_the_machine(up):
    desktop = up(size=(600, 800))
    client = desktop.client
    assert client.execute(["true"]).ok
    desktop.close()
    for ask in (client.screenshot, client.accessibility, lambda: client.execute(["true"])):
        # and not: was not answered, by wherever it went
        with pytest.raises(GuestError, match="failed"):
            ask()


def answers(act):
    """Whether `act` does not fail."""
    with contextlib.suppress(DesktopError):
        act()
        return True
    return False
