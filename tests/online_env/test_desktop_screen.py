"""A desktop from the machine: its screen in memory, and the ports that lead to it."""

import errno
import os
import socket
import struct
import threading
import time

import numpy as np
import pytest

from online_env.embedded.guest.frame_format import ASK, DONE, FrozenScreen, PointerImage
from online_env.embedded.runtime import forward, registry
from online_env.embedded.runtime.frame_reader import FrameReader
from online_env.embedded.runtime.framebuffer import FREEZE_SOCKET

from support.waiting import until


@pytest.fixture(autouse=True)
def run(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "RUN", tmp_path / "run")
    (tmp_path / "run/d1").mkdir(parents=True)
    return tmp_path / "run"


# The screen


def memory(width=8, height=4, bits=32, masks=(0xFF0000, 0xFF00, 0xFF), stride=None, colours=2):
    """What an X server keeps its screen in: XWDFile.h, with a colour map before the pixels."""
    stride = width * 4 if stride is None else stride
    fields = [0] * 25
    fields[0] = 100 + 3  # the header, and the name of the window
    fields[4], fields[5], fields[11], fields[12] = width, height, bits, stride
    fields[14:17] = masks
    fields[19] = colours
    rows = np.zeros((height, stride), np.uint8)
    rows[:, : width * 4] = np.arange(height * width * 4, dtype=np.uint8).reshape(height, -1)
    return struct.pack(">25I", *fields) + b"abc" + bytes(12 * colours) + rows.tobytes()


class Guest:
    """The other side of a desktop's door: it answers with the screens of a list."""

    def __init__(self, screens):
        self.screens = list(screens)
        self.copied = []
        self.callers = 0
        self._door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._door.bind(str(registry.folder("d1") / FREEZE_SOCKET))
        self._door.listen()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while self.screens:
            caller, _ = self._door.accept()
            self.callers += 1
            with caller:
                while self.screens and caller.recv(16) == ASK:
                    caller.send(self.screens.pop(0))
                    self.copied.append(caller.recv(16) == DONE)
        self._door.close()


def frozen(width=8, height=4, left=60.0, pointer=None):
    return FrozenScreen(
        width, height, time.monotonic() + left, pointer or PointerImage.none()
    ).pack()


@pytest.fixture
def frames(request):
    """Reads the screen in some memory; a guest freezes it as told."""
    opened_paths = []

    def make(data, *screens):
        descriptor = os.memfd_create("screen")
        os.write(descriptor, data)
        guest = Guest(screens)
        frame_reader = FrameReader({"id": "d1", "keeper": [os.getpid(), 0], "memory": descriptor})
        opened_paths.append((frame_reader, descriptor))
        return frame_reader, guest

    yield make
    for value, descriptor in opened_paths:
        value.close()
        os.close(descriptor)


@pytest.mark.parametrize("stride", [32, 48])
def test_the_screen_is_read_from_where_the_server_draws_it(frames, stride):
    value, guest = frames(memory(stride=stride), frozen(), frozen(6, 3), frozen())
    raw = np.arange(8 * 4 * 4, dtype=np.uint8).reshape(4, 8, 4)
    assert np.array_equal(value.read(), raw[..., 2::-1])
    assert np.array_equal(value.read(), raw[:3, :6, 2::-1]), "a screen that has become smaller"
    assert value.read().flags.writeable
    until(lambda: len(guest.copied) == 3, "the other side to hear of the third copy")
    assert (guest.callers, guest.copied) == (1, [True] * 3)


def test_what_was_drawn_since_the_last_picture_is_in_the_next(frames):
    height, width = 130, 8
    data = bytearray(memory(width, height))
    value, _ = frames(bytes(data), *(frozen(width, height) for _ in range(6)))
    descriptor = value._record["memory"]
    start = len(data) - height * width * 4
    for place in (0, 59 * width * 4 + 2, len(data) - start - 2):  # first, inner and last band
        before = value.read()
        before[...] = 7  # the caller's own
        os.pwrite(descriptor, b"\xa5", start + place)
        data[start + place] = 0xA5
        drawn = np.frombuffer(data, np.uint8, offset=start).reshape(height, width, 4)
        assert np.array_equal(value.read(), drawn[..., 2::-1])


def test_the_pointer_is_blended_over_it_as_far_as_it_is_inside(frames):
    argb = np.array([[0xFF010203, 0x80400000], [0x00000000, 0xFFFFFFFF]], np.uint32)
    pointer = PointerImage(-1, 3, argb)
    value, _ = frames(memory(), frozen(pointer=pointer))
    image = value.read()
    under = np.arange(8 * 4 * 4, dtype=np.uint8).reshape(4, 8, 4)[..., 2::-1]
    expected = under.copy()
    expected[3, 0] = [
        0x40 + round(int(v) * 0x7F / 255) if n == 0 else round(int(v) * 0x7F / 255)
        for n, v in enumerate(under[3, 0])
    ]
    assert np.array_equal(image, expected)


# A description says until when the screen is held, so it is made when the test runs.
@pytest.mark.parametrize(
    ("data", "screen", "message"),
    [
        (memory(), lambda: frozen(9, 4), "the screen is 9x4, its memory 8x4"),
        (memory(), lambda: frozen(8, 0), "the screen is 8x0, its memory 8x4"),
        (memory(bits=16), frozen, "the X server's memory is of another kind"),
        (memory(masks=(0xFF, 0xFF00, 0xFF0000)), frozen, "memory is of another kind"),
        (memory()[:-1], frozen, "the X server's memory is of another kind"),
        (memory(), lambda: b"no screen", "9 bytes are no description of a screen"),
        (memory(), lambda: frozen() + b"xxxx", "cannot reshape array"),
    ],
    ids=["wide", "flat", "bits", "masks", "short", "words", "long"],
)
def test_a_screen_that_is_none_is_refused(frames, data, screen, message):
    value, _ = frames(data, screen())
    with pytest.raises(ValueError, match=message):
        value.read()


def test_a_copy_that_took_too_long_is_not_used_and_the_next_one_is(frames):
    value, guest = frames(memory(), frozen(left=-0.1), frozen())
    with pytest.raises(TimeoutError, match="it may be two halves"):
        value.read()
    assert value.read().shape == (4, 8, 3)
    assert guest.callers == 2, "nothing of the failed exchange is left in the line"


# Ports


class Everybody:
    """Lets in as told."""

    def __init__(self, allowed):
        self.allow = lambda caller: allowed


@pytest.fixture
def port(run):
    """A port of the loopback interface that leads to a socket file, in threads of this process."""
    door = str(run / "door")
    inside = socket.socket(socket.AF_UNIX)
    inside.bind(door)
    inside.listen()
    with forward.listen(forward.LOOPBACK) as listener, inside:

        def call(owners):
            link = socket.create_connection(listener.getsockname(), timeout=20)
            caller, _ = listener.accept()
            threading.Thread(target=forward._connect, args=(caller, door, owners)).start()
            return link, inside

        yield call


def test_a_port_passes_everything_on_and_the_ends_one_by_one(port):
    link, inside = port(forward.Owners())
    with link:
        desktop, _ = inside.accept()
        with desktop:
            link.sendall(b"question" * 10_000)
            link.shutdown(socket.SHUT_WR)
            requests = b"".join(iter(lambda: desktop.recv(1 << 16), b""))
            assert requests == b"question" * 10_000
            desktop.sendall(b"answer")  # after the end of the question
        assert b"".join(iter(lambda: link.recv(1 << 16), b"")) == b"answer"


def test_another_user_is_refused_in_words_before_anything_reaches_the_desktop(port):
    link, inside = port(Everybody(False))
    with link:
        link.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        answer = b"".join(iter(lambda: link.recv(1 << 16), b""))
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 403 Forbidden\r\n")
    assert f"Content-Length: {len(body)}".encode() in head
    assert body == b"only the user who started this desktop (or root) may use it\n"
    inside.setblocking(False)
    with pytest.raises(BlockingIOError):
        inside.accept()


def test_a_port_that_is_taken_is_replaced_by_another():
    with forward.listen(forward.LOOPBACK) as first:
        expected = first.getsockname()[1]
        with forward.listen(forward.LOOPBACK, expected) as second:
            assert second.getsockname()[1] not in (0, expected)
    with pytest.raises(OSError, match=str(errno.EADDRNOTAVAIL)):
        forward.listen("192.0.2.7")


def test_who_used_sudo_is_an_owner_too(monkeypatch):
    monkeypatch.setenv("SUDO_UID", "1234")
    monkeypatch.setattr(forward.os, "geteuid", lambda: 0)
    assert forward.Owners()._allowed == {0, 1234}
    monkeypatch.setenv("SUDO_UID", "x")
    assert forward.Owners()._allowed == {0}
    monkeypatch.setattr(forward.os, "geteuid", lambda: 1000)
    assert forward.Owners()._allowed == {0, 1000}
