"""The screen read from the X server's memory: the guest's own picture, whole frames, and what goes
wrong with it."""

import contextlib
import fcntl
import io
import os
import signal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from online_env.embedded.guest.frame_format import FrozenScreen, PointerImage, to_rgb
from online_env.embedded.runtime.frame_reader import FrameReader

from support.processes import guest_server
from support.waiting import until

# Fills a window with one colour after the other; each colour is one request to X.
FLICKER = """
from Xlib import display, X
d = display.Display(); s = d.screen()
w = s.root.create_window(0, 0, s.width_in_pixels, s.height_in_pixels, 0, s.root_depth, override_redirect=1)
w.map(); gc = w.create_gc()
while True:
    for colour in (0xFF0000, 0x00FF00, 0x0000FF):
        gc.change(foreground=colour)
        w.fill_rectangle(gc, 0, 0, s.width_in_pixels, s.height_in_pixels)
        d.sync()
"""


@pytest.fixture(scope="module")
def desktop(embedded_machine):
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(size=(601, 803)) as desktop:  # rows whose length is no power of two
        yield desktop


def same(desktop):
    """The screen read from memory, once it is the picture that the guest sends (the clock may turn
    between them)."""

    def compared():
        with contextlib.closing(FrameReader(desktop.record)) as frames:
            picture = read_frame(frames)
        png = desktop.client._get("/screenshot").body
        return [picture] if (picture == np.asarray(Image.open(io.BytesIO(png)))).all() else []

    return until(compared, "a screenshot that is what the memory holds", pause=0.3)[0]


def read_frame(frames):
    """A reading that was quick enough; a busy machine may need several."""

    def read():
        with contextlib.suppress(TimeoutError):
            return [frames.read()]

    return until(read, "a reading in time")[0]


@pytest.mark.parametrize("place", [(400, 300), (0, 0), (802, 300), (500, 600)])
def test_it_is_the_guests_own_picture_with_one_pointer(desktop, place):
    desktop.client.input([{"type": "move", "x": place[0], "y": place[1]}])
    picture = same(desktop)
    assert (picture.shape, picture.dtype) == ((601, 803, 3), np.uint8)
    assert picture.flags.c_contiguous
    assert picture.flags.writeable
    desktop.client.input([{"type": "move", "x": 200, "y": 450}])
    different = (picture != same(desktop)).any(axis=2)
    different[560:, 600:] = False  # the clock
    changed_pixels = np.argwhere(different)
    near = [(abs(changed_pixels - point) < 40).all(axis=1) for point in (place[::-1], (450, 200))]
    assert near[0].any()
    assert near[1].any()
    assert (near[0] | near[1]).all()


def test_a_frame_is_never_two_halves(desktop):
    desktop.client.input([{"type": "move", "x": 802, "y": 600}])
    desktop.client.launch(["/usr/bin/python3", "-c", FLICKER])
    names = set()

    def all_seen():
        for _ in range(40):
            part = desktop.screenshot()[:560, :760]
            colour = part[0, 0]
            is_whole = bool((part == colour).all())
            assert is_whole or not names, "a picture of two colours"
            if is_whole:
                names.add(tuple(colour.tolist()))
        return len(names) == 3

    until(all_seen, "all three colours")
    desktop.execute(["pkill", "-f", "override_redirect"])


def test_nobody_can_make_the_memory_shorter(desktop):
    path = f"/proc/{desktop.record['keeper'][0]}/fd/{desktop.record['memory']}"
    descriptor = os.open(path, os.O_RDWR)
    try:
        with pytest.raises(PermissionError):
            os.ftruncate(descriptor, 0)
        assert fcntl.fcntl(descriptor, fcntl.F_GET_SEALS) & fcntl.F_SEAL_SHRINK
    finally:
        os.close(descriptor)


def test_the_screen_goes_on_when_a_machine_never_lets_go(desktop):
    with contextlib.closing(FrameReader(desktop.record)) as frames:
        guest = frames._opened_guest()
        guest.send(b"?")
        guest.recv(1 << 20)
        assert desktop.screenshot().any()
        assert desktop.execute("xdotool getmouselocation").ok  # X answers though nobody let go
        with pytest.raises((OSError, ValueError)):  # it lost its hold; the next reading begins anew
            frames.read()
        assert read_frame(frames).any()


def test_without_the_guest_server_it_says_so_and_then_goes_on(desktop):
    same(desktop)
    os.kill(guest_server(desktop.record), signal.SIGKILL)
    assert desktop.screenshot().any()  # over HTTP, which waits for the new server, or from it
    same(desktop)


@given(
    st.integers(1, 40),
    st.integers(1, 40),
    st.floats(0, 1e9),
    st.integers(-50, 50),
    st.integers(-50, 50),
)
def test_what_the_guest_tells_arrives(width, height, until, left, top):
    argb = np.random.default_rng(width).integers(0, 2**32, (height, width), dtype=np.uint32)
    result = FrozenScreen.unpack(
        FrozenScreen(width, height, until, PointerImage(left, top, argb)).pack()
    )
    assert (result.width, result.height, result.until, result.pointer.left, result.pointer.top) == (
        width,
        height,
        until,
        left,
        top,
    )
    assert (result.pointer.argb == argb).all()
    image = np.zeros((30, 30, 3), np.uint8)
    result.pointer.draw(image)  # inside, outside or across an edge


@given(st.binary(max_size=80))
def test_what_is_no_message_is_refused(data):
    try:
        result = FrozenScreen.unpack(data)
    except ValueError:
        return
    assert result.pointer.argb.size * 4 == len(data) - 40


def test_channels_and_blending():
    bgrx = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    assert (to_rgb(bgrx) == bgrx[..., 2::-1]).all()
    image = np.full((2, 2, 3), 100, np.uint8)
    PointerImage(1, 0, np.array([[0x80402010]], np.uint32)).draw(image)
    assert image[0, 1].tolist() == [0x40 + 50, 0x20 + 50, 0x10 + 50]
    assert (image[[0, 1, 1], [0, 0, 1]] == 100).all()
