"""The conformance suite notices broken kernels: each mutant changes one thing and must be
caught."""

import numpy as np
import pytest

from hijack_data import conformance
from hijack_data import resample as weights_module
from hijack_data.corruptions import Marks, PopUps, Resolution, Subtitle
from hijack_data.drawing import raster
from hijack_data.kernels import Stamp
from hijack_data.kernels.cpu import jit, resize
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
        (torch_kernels, "paste_ops", "torch operations"),
        (jax_kernels, "paste", "jax"),
    ],
)
def test_a_paste_one_pixel_off_is_caught(monkeypatch, cls, module, name, label):
    assert caught(cls) == ""
    right = getattr(module, name)
    monkeypatch.setattr(module, name, lambda image, stamps: right(image, shifted(stamps)))
    assert caught(cls).startswith(label)


def test_a_wrong_rounding_in_numpy_is_caught(monkeypatch):
    right = numpy_kernels._make_form

    def mutant(sprite):
        form = right(sprite)
        form.paint[:] -= 1
        return form

    monkeypatch.setattr(numpy_kernels, "_make_form", mutant)
    monkeypatch.setattr(raster, "_cache", raster._Cache(2**27))
    assert caught(Subtitle).startswith("numpy:")


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
