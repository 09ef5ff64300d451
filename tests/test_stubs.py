"""Editors see every argument of the transforms: signatures, docstrings, and the stub of both."""

import doctest
import importlib
import inspect

import numpy as np
import pytest

tr = pytest.importorskip("hijack_data.transforms", reason="needs the extra [torch]")

import hijack_data as hj  # noqa: E402
from hijack_data.params import parameters  # noqa: E402

from support import stubs  # noqa: E402


def test_the_stub_is_what_make_stubs_writes():
    assert stubs.STUB.read_text(encoding="utf-8") == stubs.stub(), "run: make stubs"


@pytest.mark.parametrize("name", ["PopUps", "Marks", "Subtitle", "Resolution"])
def test_a_transform_shows_the_parameters_of_its_corruption(name):
    cls = getattr(tr, name)
    arguments = inspect.signature(cls).parameters
    parameter_names = parameters(cls.spec)
    shared = [key for key in inspect.signature(tr.Corrupt).parameters if key != "planner"]
    assert list(arguments) == ["severity", *parameter_names, *shared]
    planner = cls(id_from="content").settings.planner
    for key, argument in arguments.items():
        assert f"\n    {key}: " in cls.__doc__
        if key in parameter_names:  # the default that is shown is the one that is used
            assert argument.default == getattr(planner, key)


def test_a_subclass_has_the_signature_of_its_own_constructor():
    class Mine(tr.Marks):
        def __init__(self, count: int) -> None:
            super().__init__(number=count)

    assert list(inspect.signature(Mine).parameters) == ["count"]
    assert Mine(7).settings.planner.number == 7


@pytest.mark.parametrize("name", [name for name in tr.__all__ if name != "PICTURE_KEYS"])
def test_the_example_of_a_transform_runs(name):
    import torch

    image = torch.full((3, 1080, 1920), 235, dtype=torch.uint8)
    names = {"tr": tr, "hj": hj, "image": image}
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(tr, name), name, globs=names)
    assert example.examples
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0


@pytest.mark.parametrize("name", ["Corrupt", "RandomCorrupt"])
def test_the_example_of_a_grain_transform_runs(name):
    grain = pytest.importorskip("grain")
    hg = importlib.import_module("hijack_data.grain")
    names = {"grain": grain, "hg": hg, "hj": hj, "np": np}
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(hg, name), name, globs=names)
    assert example.examples
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0
    arguments = inspect.signature(getattr(hg, name)).parameters
    assert all(f"\n        {key}: " in getattr(hg, name).__doc__ for key in arguments)
