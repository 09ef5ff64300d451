"""When Numba fails, one warning names the cause, and the plain kernels give the same bytes."""

import importlib
import warnings

import numpy as np
import pytest

import hijack_data as hj
from hijack_data import extras
from hijack_data.conformance import picture, reference, scene
from hijack_data.errors import HijackWarning, ImageTypeError
from hijack_data.kernels.cpu import jit, pixels, resize

pytest.importorskip("numba")

SIZE = (200, 320)
PICTURES = 4


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """Numba has neither been imported by this process nor has it failed, and will be used."""

    kernels = [resize._kernel]

    def forget() -> None:
        jit._importable.cache_clear()
        for kernel in kernels:
            kernel.cache_clear()

    monkeypatch.setattr(jit, "_state", jit._State(forgone=jit.NUMBA_LOADING_MS))
    forget()
    yield
    forget()


def plans():
    overlay = hj.Subtitle(font_size=9).plan(scene(SIZE), seed=3, sample="a")
    resized = hj.Resolution().plan(scene(SIZE), seed=3, sample="a")
    return overlay, resized


def check_all_pictures():
    """Every picture has the bytes of the definition, whatever fails."""
    image = picture(SIZE)
    for _ in range(PICTURES):
        for plan in plans():
            assert np.array_equal(hj.apply(plan, image), reference(plan, image))


def check_one_warning(cause: str):
    with warnings.catch_warnings(record=True) as result:
        warnings.simplefilter("always")
        check_all_pictures()
    ours = [warning for warning in result if issubclass(warning.category, HijackWarning)]
    assert len(ours) == 1
    message = str(ours[0].message)
    assert cause in message
    assert "plain NumPy kernels" in message
    assert extras.remedy("fast") in message
    assert not jit.available()


@pytest.mark.parametrize(
    "error",
    [
        ImportError("Numba needs NumPy 2.3 or less"),
        ModuleNotFoundError("No module named 'llvmlite'", name="llvmlite"),
        OSError("libllvmlite.so: cannot open shared object file"),
        AttributeError("module 'numpy' has no attribute 'trapz'"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_a_broken_installation_of_numba_is_a_warning(monkeypatch, error):
    def broken(name: str) -> object:
        if name == "numba":
            raise error
        return importlib.import_module(name)

    monkeypatch.setattr(jit, "import_module", broken)
    check_one_warning(f"{type(error).__name__}: {error}")


def test_a_missing_numba_is_no_warning(monkeypatch):
    def absent(name: str) -> object:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(jit, "import_module", absent)
    check_all_pictures()  # a warning would be an error
    assert not jit.available()


def test_an_error_while_compiling_is_a_warning(monkeypatch):
    def refuse(*_: object) -> None:
        raise TypeError("LLVM: invalid pointer type")

    monkeypatch.setattr(jit, "compile_now", refuse)
    check_one_warning("TypeError: LLVM: invalid pointer type")


def fails_half_way(kernel):
    """A kernel whose first call does its work and then raises."""

    def run(*args: object) -> None:
        kernel(*args)
        raise SystemError("relocation out of range")

    return lambda: run


def test_an_error_in_the_first_call_is_a_warning(monkeypatch):
    monkeypatch.setattr(resize, "_kernel", fails_half_way(resize._kernel()))
    check_one_warning("SystemError: relocation out of range")


def test_numba_that_fails_in_the_middle_of_a_run_does_not_stop_it(monkeypatch):
    """The first pictures are resized without Numba; it fails when it would have paid."""
    image = picture(SIZE)
    saved = pixels.RESAMPLE_SAVED_MS_PER_BYTE * image.size
    monkeypatch.setattr(jit, "_state", jit._State(forgone=jit.NUMBA_LOADING_MS - 2 * saved))
    monkeypatch.setattr(resize, "_kernel", fails_half_way(resize._kernel()))
    _, resized = plans()
    for _ in range(2):
        assert np.array_equal(hj.apply(resized, image), reference(resized, image))
    with pytest.warns(HijackWarning, match="relocation out of range"):
        third = hj.apply(resized, image)
    assert np.array_equal(third, reference(resized, image))
    assert np.array_equal(hj.apply(resized, image), third)


def test_a_wrong_picture_is_an_error_and_no_failure_of_numba():
    with pytest.raises(ImageTypeError, match="not uint8"):
        jit.call_with_fallback(lambda: resize.resample(np.zeros((9, 9, 3)), (3, 3)), lambda: None)
    assert jit.available()
