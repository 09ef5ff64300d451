"""The compiled resize: Pillow's bytes for every size and memory layout, and a clean answer without
Numba."""

import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

import hijack_data as hj
from hijack_data import resample
from hijack_data.errors import ImageError, ImageTypeError, MissingDependencyError, ParameterError
from hijack_data.kernels.cpu import jit, resize
from hijack_data.kernels.cpu.pixels import resample_plain

from support.guarded import run
from support.resizing import resize_with_pillow

needs_numba = pytest.mark.skipif(
    not jit.available(), reason="needs Numba: pip install 'agenthijack[fast]'"
)

SIDE = st.one_of(st.integers(1, 20), st.integers(1, 150))


def picture(seed: int, height: int, width: int, contrast: bool = False) -> np.ndarray:
    """Noise; with `contrast` only 0 and 255, whose overshoots must be clipped at both ends."""
    rng = np.random.default_rng(seed)
    if contrast:
        return rng.integers(0, 2, (height, width, 3), dtype=np.uint8) * np.uint8(255)
    return rng.integers(0, 256, (height, width, 3), dtype=np.uint8)


def channels_first(image: np.ndarray) -> np.ndarray:
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(image, -1, -3)), -3, -1)


def inside(image: np.ndarray) -> np.ndarray:
    """The same pixels inside a larger picture: rows are contiguous, the whole is not."""
    return np.pad(image, ((3, 2), (1, 5), (0, 0)))[3:-2, 1:-5]


LAYOUTS = {
    "channels last": np.ascontiguousarray,
    "channels first": channels_first,
    "crop": inside,
    "crop, channels first": lambda image: np.moveaxis(
        np.pad(np.moveaxis(image, 2, 0), 2)[2:-2, 2:-2, 2:-2], 0, 2
    ),
    "upside down": lambda image: image[::-1].copy()[::-1],
    "mirrored": lambda image: image[:, ::-1].copy()[:, ::-1],
    "channels reversed": lambda image: image[:, :, ::-1].copy()[:, :, ::-1],
    "columns first": lambda image: image.swapaxes(0, 1).copy().swapaxes(0, 1),
    "every second pixel": lambda image: image.repeat(2, axis=1)[:, ::2],
    "every second byte": lambda image: image.repeat(2, axis=2)[:, :, ::2],
}


@needs_numba
@settings(max_examples=250, deadline=None)
@given(
    seed=st.integers(0, 99),
    source=st.tuples(SIDE, SIDE),
    size=st.tuples(SIDE, SIDE),
    contrast=st.booleans(),
    layout=st.sampled_from(list(LAYOUTS)),
    threads=st.integers(1, 3),
)
@example(seed=0, source=(1, 1), size=(1, 1), contrast=False, layout="channels first", threads=3)
@example(seed=0, source=(1, 1), size=(40, 70), contrast=False, layout="channels last", threads=1)
@example(seed=0, source=(90, 61), size=(90, 61), contrast=False, layout="channels first", threads=2)
@example(seed=0, source=(90, 61), size=(90, 33), contrast=True, layout="channels last", threads=2)
@example(seed=0, source=(90, 61), size=(200, 61), contrast=True, layout="channels first", threads=2)
@example(seed=0, source=(16, 16), size=(15, 15), contrast=True, layout="channels first", threads=1)
@example(seed=0, source=(17, 17), size=(48, 48), contrast=True, layout="channels first", threads=1)
def test_gives_the_bytes_of_pillow(seed, source, size, contrast, layout, threads):
    image = picture(seed, *source, contrast)
    strided = LAYOUTS[layout](image)
    np.testing.assert_array_equal(
        resize.resample(strided, size, threads), resize_with_pillow(image, size)
    )
    np.testing.assert_array_equal(strided, image)


@needs_numba
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_memory_layout(layout):
    image = picture(3, 45, 83)
    np.testing.assert_array_equal(
        resize.resample(LAYOUTS[layout](image), (30, 50)), resize_with_pillow(image, (30, 50))
    )


@needs_numba
@pytest.mark.parametrize("contrast", [False, True])
@pytest.mark.parametrize("layout", ["channels last", "channels first"])
@pytest.mark.parametrize(
    ("source", "size"),
    [
        ((30, 4000), (11, 3)),
        ((4000, 30), (3, 11)),
        ((4000, 30), (1, 1)),
        ((9, 3), (5, 4000)),
        ((3, 9), (4000, 5)),
        ((2, 4000), (2, 3999)),
        ((1500, 20), (700, 20)),
        ((1170, 540), (585, 270)),
        ((60, 40), (40, 30)),  # the last that Pillow 13 resizes along rows first,
        ((61, 40), (40, 30)),  # and the first along columns
        ((1080, 150), (540, 75)),
        ((1079, 131), (809, 98)),
    ],
)
def test_extreme_and_tall_pictures(source, size, layout, contrast):
    image = picture(1, *source, contrast)
    for threads in (1, 2):
        np.testing.assert_array_equal(
            resize.resample(LAYOUTS[layout](image), size, threads), resize_with_pillow(image, size)
        )


LONG = [
    ((3, 8000), (48, 128_000)),
    ((8000, 3), (128_000, 48)),
    ((3, 100_000), (5, 70_000)),
    ((100_000, 3), (50_000, 3)),
    ((2, 200_000), (2, 1000)),
    ((70_000, 2), (66_000, 1)),
]


@pytest.mark.parametrize(("source", "size"), LONG)
def test_long_sides_are_resized_with_numba_and_without(source, size):
    """Beyond 65536 pixels a side, as the pictures of whole web pages are."""
    image = picture(2, *source)
    expected = resize_with_pillow(image, size)
    np.testing.assert_array_equal(resample_plain(image, size), expected)
    if jit.available():
        np.testing.assert_array_equal(resize.resample(image, size), expected)
        np.testing.assert_array_equal(resize.resample(channels_first(image), size), expected)


def test_a_long_plan_does_not_depend_on_numba(monkeypatch):
    image = picture(2, 4, 8000)
    plan = hj.Resolution(scale=16).plan(hj.Scene((4, 8000)), seed=1)
    expected = hj.apply(plan, image)
    monkeypatch.setattr(jit, "available", lambda: False)
    assert np.array_equal(hj.apply(plan, image), expected)
    assert np.array_equal(expected, resize_with_pillow(image, (64, 128_000)))


def test_the_tables_that_are_remembered_are_bounded(monkeypatch):
    first = resample.weights(4000, 700)
    assert resample.weights(4000, 700) is first
    monkeypatch.setattr(resample, "_tables", resample.Cache(100_000))
    for side in range(1, 200):
        resample.weights(4000, side)
    assert 0 < resample._tables.used <= 100_000


@needs_numba
def test_a_real_screenshot(shared_data):
    path = sorted((shared_data / "screenshots").glob("*.png"))[0]
    image = np.asarray(Image.open(path).convert("RGB"))
    assert not image.flags.writeable
    size = (image.shape[0] * 2 // 3, image.shape[1] * 2 // 3)
    np.testing.assert_array_equal(resize.resample(image, size), resize_with_pillow(image, size))


@needs_numba
@pytest.mark.parametrize("size", [(20, 60), (20, 7), (40, 50)])
def test_the_result_has_the_memory_layout_of_the_input(size):
    image = picture(2, 40, 50)
    for threads in (1, 2):
        assert resize.resample(image, size, threads).flags.c_contiguous
        planar = resize.resample(channels_first(image), size, threads)
        assert np.moveaxis(planar, 2, 0).flags.c_contiguous
        assert not np.shares_memory(planar, image)


@needs_numba
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("size", [(21, 40), (3, 5)])
def test_batches(size, threads):
    batch = np.stack([picture(seed, 37, 50) for seed in range(4)])
    expected = np.stack([resize_with_pillow(image, size) for image in batch])
    last = resize.resample(batch, size, threads)
    first = resize.resample(channels_first(batch), size, threads)
    every_second = resize.resample(batch[::2], size, threads)
    np.testing.assert_array_equal(last, expected)
    np.testing.assert_array_equal(first, expected)
    np.testing.assert_array_equal(every_second, expected[::2])
    assert last.flags.c_contiguous
    assert np.moveaxis(first, 3, 1).flags.c_contiguous


@pytest.mark.parametrize(
    ("image", "size", "threads", "error", "says"),
    [
        (np.zeros((4, 4, 3), np.float32), (2, 2), 1, ImageTypeError, "float32"),
        (np.zeros((4, 4), np.uint8), (2, 2), 1, ImageError, r"\(4, 4\)"),
        (np.zeros((4, 4, 4), np.uint8), (2, 2), 1, ImageError, r"\(4, 4, 4\)"),
        (np.zeros((3, 4, 4), np.uint8), (2, 2), 1, ImageError, r"\(3, 4, 4\)"),
        (np.zeros((0, 4, 3), np.uint8), (2, 2), 1, ImageError, r"\(0, 4, 3\)"),
        (np.zeros((0, 4, 4, 3), np.uint8), (2, 2), 1, ImageError, r"\(0, 4, 4, 3\)"),
        (np.zeros((4, 4, 3), np.uint8), (0, 2), 1, ParameterError, r"\(0, 2\)"),
        (np.zeros((4, 4, 3), np.uint8), (2, -1), 1, ParameterError, r"\(2, -1\)"),
        (np.zeros((4, 4, 3), np.uint8), (2, 10**30), 1, ParameterError, str(10**30)),
        (np.zeros((4, 4, 3), np.uint8), (2, 2), 0, ParameterError, "threads is 0"),
    ],
)
def test_refusals_say_the_value(image, size, threads, error, says):
    with pytest.raises(error, match=says):
        resize.resample(image, size, threads)


def test_without_numba(monkeypatch):
    def absent(name: str) -> object:
        raise ModuleNotFoundError(name, name=name)

    monkeypatch.setattr(jit, "import_module", absent)
    jit._importable.cache_clear()
    resize._kernel.cache_clear()
    try:
        assert jit.available() is False
        with pytest.raises(MissingDependencyError, match=r"pip install .*\[fast\]'"):
            resize.resample(np.zeros((4, 4, 3), np.uint8), (2, 2))
    finally:
        jit._importable.cache_clear()
        resize._kernel.cache_clear()


def test_compiles_without_a_cache_when_no_folder_is_writable():
    compilations = []

    def njit(signature: str, nogil: bool, cache: bool = False):
        compilations.append((signature, nogil, cache))
        if cache:
            raise RuntimeError("no locator available")
        return lambda function: function

    function = resize_with_pillow
    assert jit.compile_now(njit, function, "signature") is function
    assert compilations == [("signature", True, True), ("signature", True, False)]


GUARDED = """
import numpy as np
from hijack_data.kernels.cpu import jit, resize
from support.guarded import guarded
inside = guarded(16)
for height, width in [(1, 1), (16, 16), (17, 33), (100, 50), (33, 200)]:
    size = height * width * 3
    for flat in (inside[:size], inside[-size:]):
        for image in (flat.reshape(height, width, 3), np.moveaxis(flat.reshape(3, height, width), 0, 2)):
            for to in [(1, 1), (height // 2 + 1, width // 2 + 1), (height, 2 * width), (2 * height, width)]:
                resize.resample(image, to)
"""


@needs_numba
@pytest.mark.skipif(sys.platform != "linux", reason="needs mprotect")
def test_reads_nothing_beyond_the_picture(tmp_path):
    run(GUARDED, tmp_path)


COLD = """
import sys
import numpy as np
from hijack_data.kernels.cpu import jit, resize
assert "numba" not in sys.modules, "importing the module loads Numba"
assert resize.resample(np.full((40, 40, 3), 7, np.uint8), (20, 20)).tolist() == [[[7] * 3] * 20] * 20
"""


@needs_numba
def test_a_cold_start_warns_of_nothing_and_fills_the_cache(tmp_path):
    run(COLD, tmp_path)
    assert {path.name.split("-")[0] for path in tmp_path.rglob("*.nbc")} == {
        "resize._band",
        "resize._block_across",
    }
