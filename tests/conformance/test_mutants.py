"""The conformance suite notices broken kernels: each mutant changes one thing and must be
caught."""

from functools import cache

import numpy as np
import pytest

from hijack_data import conformance
from hijack_data import resample as weights_module
from hijack_data.conformance import screens
from hijack_data.corruptions import Marks, PopUps, Resolution, Subtitle
from hijack_data.drawing import raster
from hijack_data.kernels import Stamp
from hijack_data.kernels.cpu import blend, jit, resize
from hijack_data.kernels.cpu import pixels as numpy_kernels

torch_kernels = pytest.importorskip("hijack_data.kernels.torch_ops", exc_type=ImportError)
jax_kernels = pytest.importorskip("hijack_data.kernels.jax_ops", exc_type=ImportError)
needs_numba = pytest.mark.skipif(
    not jit.available(), reason="needs Numba: pip install 'agenthijack[fast]'"
)


def caught(cls) -> str:
    return conformance.run_check(conformance.check_backends, cls).problem


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(screens, "SIZES", ((600, 1700),))


def shifted(stamps):
    return [Stamp(s.sprite, s.ys, np.maximum(s.xs - 1, 0)) for s in stamps]


@pytest.mark.parametrize("cls", [Marks, PopUps, Subtitle])
@pytest.mark.parametrize(
    ("module", "name", "label"),
    [
        (numpy_kernels, "paste", "numpy"),
        (numpy_kernels, "paste_plain", "numpy"),
        (torch_kernels, "paste_ops", "torch operations"),
        (jax_kernels, "paste", "jax"),
    ],
)
def test_a_paste_one_pixel_off_is_caught(monkeypatch, cls, module, name, label):
    assert caught(cls) == ""
    right = getattr(module, name)
    monkeypatch.setattr(module, name, lambda image, stamps: right(image, shifted(stamps)))
    assert caught(cls).startswith(label)


@pytest.mark.parametrize("numba", [True, False], ids=["with Numba", "without Numba"])
def test_a_wrong_rounding_in_numpy_is_caught(monkeypatch, numba):
    """With Numba only the conformance suite runs this code; without, every NumPy picture does."""
    right = numpy_kernels._make_form

    def mutant(sprite):
        form = right(sprite)
        form.paint[:] -= 1
        return form

    if not numba:
        monkeypatch.setattr(jit, "available", lambda: False)
    monkeypatch.setattr(numpy_kernels, "_make_form", mutant)
    monkeypatch.setattr(raster, "_cache", raster._Cache(2**27))
    assert caught(Subtitle).startswith(
        "numpy, without Numba" if numba and jit.available() else "numpy:"
    )


@needs_numba
@pytest.mark.parametrize(
    ("cls", "column"),
    [(Marks, 0), (Marks, 1), (Marks, 9), (PopUps, 9), (Subtitle, 9), (Subtitle, 10)],
)
def test_a_compiled_paste_that_reads_its_rows_wrongly_is_caught(monkeypatch, cls, column):
    """A place off by one pixel, a colour by one level of blue."""
    right = blend.paste

    def mutant(image, rows):
        rows[:, column] = np.maximum(rows[:, column] - 1, 0) if column < 2 else rows[:, column] ^ 1
        right(image, rows)

    monkeypatch.setattr(blend, "paste", mutant)
    assert caught(cls).startswith("numpy:")


@needs_numba
@pytest.mark.parametrize(
    ("method", "mutant"),
    [
        ("mask", lambda line, base, at, _done: line.load(line.bytes, base, at)),
        ("spread", lambda line, mask: [line.builder.zext(mask, line.words)] * 3),
        (
            "differs",
            lambda line, _mask, value: line.builder.icmp_unsigned(
                "!=", line.i64(value), line.i64(255)
            ),
        ),
    ],
)
def test_a_compiled_paste_with_a_wrong_instruction_is_caught(monkeypatch, method, mutant):
    """The end of a line blended twice, masks that are not spread over the channels, any mask taken
    for opaque."""
    with monkeypatch.context() as patch:
        patch.setattr(
            jit, "compile_now", lambda njit, function, signature: njit(signature)(function)
        )
        patch.setattr(blend._Line, method, mutant)
        patch.setattr(blend, "_kernel", cache(blend._kernel.__wrapped__))
        assert caught(Subtitle if method == "mask" else Marks).startswith("numpy:")


def test_a_wrong_rounding_in_torch_is_caught(monkeypatch):
    right = torch_kernels._pixels

    def mutant(sprite, device):
        dy, dx, keep, paint = right(sprite, device)
        return dy, dx, keep, paint - 1

    monkeypatch.setattr(torch_kernels, "_pixels", mutant)
    assert caught(Subtitle).startswith("torch operations")


def test_a_wrong_rounding_in_jax_is_caught(monkeypatch):
    right = jax_kernels._padded_pixels

    def mutant(sprite, ys, xs, shape):
        index, keep, paint = right(sprite, ys, xs, shape)
        return index, np.maximum(keep, 1) - 1, paint

    monkeypatch.setattr(jax_kernels, "_padded_pixels", mutant)
    assert caught(Subtitle).startswith("jax")


@pytest.mark.parametrize("target", ["torch operations", "jax"])
def test_a_weight_off_by_a_millionth_is_caught(monkeypatch, target):
    right = weights_module.weights

    def mutant(n_in, n_out):
        table = right(n_in, n_out)
        taps = table.taps.copy()
        taps[:, 0] += 4096
        return type(table)(table.first, taps)

    module = torch_kernels if target.startswith("torch") else jax_kernels
    monkeypatch.setattr(module, "weights", mutant)
    assert caught(Resolution).startswith(target)


@needs_numba
def test_a_wrong_compiled_resample_is_caught(monkeypatch):
    right = resize.resample
    monkeypatch.setattr(resize, "resample", lambda image, size, **kw: right(image, size, **kw) ^ 1)
    assert caught(Resolution).startswith("numpy")


def test_a_wrong_pillow_fallback_is_caught(monkeypatch):
    monkeypatch.setattr(jit, "available", lambda: False)
    assert caught(Resolution) == ""
    monkeypatch.setattr(numpy_kernels, "Image", _BilinearImage)
    assert caught(Resolution).startswith("numpy")


class _BilinearImage:
    """Pillow with the wrong filter."""

    class Resampling:
        BICUBIC = 2

    @staticmethod
    def fromarray(array):
        from PIL import Image

        return Image.fromarray(array)
