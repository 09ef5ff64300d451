"""Pictures that cannot be corrupted: an error of ours, and in place nothing is written before
it."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import as_strided
from PIL import Image

import hijack_data as hj
from hijack_data.array_overlap import overlaps
from hijack_data.backends import find_backend
from hijack_data.conformance import picture
from hijack_data.errors import ImageError, ImageTypeError, ParameterError, PlanError
from hijack_data.plan import Paste, Plan, Resample
from hijack_data.safety import changed_pixels

SIZE = (60, 90)
SCREEN = hj.Scene(SIZE)
MARKS = hj.Marks(number=5, mark_size=6).plan(SCREEN, seed=1)
SMALL = hj.Resolution(scale=0.5).plan(SCREEN, seed=1)
RECIPE = {"draw": "mark", "shape": "star", "size": 9, "color": "red"}
DRIFTED = Plan("test-v1", SIZE, ops=(Paste(RECIPE, ((3, 3),), "0" * 16),))
UNKNOWN = Plan("test-v1", SIZE, ops=(Paste({"draw": "nothing"}, ((3, 3),)),))


def grey(*lead: int) -> np.ndarray:
    return np.full((*lead, *SIZE, 3), 7, np.uint8)


# --- in place: nothing is written before it is refused


@pytest.mark.parametrize(
    ("bad", "error"),
    [(SMALL, ParameterError), (DRIFTED, PlanError), (UNKNOWN, PlanError)],
    ids=["changes the size", "has drifted", "cannot be drawn"],
)
@pytest.mark.parametrize("kind", ["list", "tuple", "batch", "torch", "torch list"])
def test_a_later_plan_that_is_refused(kind, bad, error):
    batch = grey(3)
    pictures = batch
    if kind in ("list", "tuple"):
        pictures = {"list": list, "tuple": tuple}[kind](batch)
    elif kind.startswith("torch"):
        torch = pytest.importorskip("torch")
        pictures = torch.from_numpy(batch).movedim(-1, -3)
        pictures = list(pictures) if kind == "torch list" else pictures
    with pytest.raises(error):
        hj.apply([MARKS, MARKS, bad], pictures, inplace=True)
    assert (batch == 7).all()


@pytest.mark.parametrize("bad", [DRIFTED, UNKNOWN], ids=["has drifted", "cannot be drawn"])
@pytest.mark.parametrize("resized", [False, True])
def test_a_later_operation_that_is_refused(bad, resized):
    between = (Resample((30, 45)), Resample(SIZE)) if resized else ()
    plan = Plan("test-v1", SIZE, ops=(*MARKS.ops, *between, *bad.ops))
    image = grey()
    with pytest.raises(PlanError):
        hj.apply(plan, image, inplace=True)
    assert (image == 7).all()


def test_a_later_operation_on_a_device(monkeypatch):
    torch = pytest.importorskip("torch")
    from hijack_data.backends import torch as kernels

    monkeypatch.setattr(kernels, "together", lambda _image: True)
    between = (Resample((30, 45)), Resample(SIZE))
    plan = Plan("test-v1", SIZE, ops=(*MARKS.ops, *between, *DRIFTED.ops))
    for plans, image in ((plan, grey()), ([MARKS, plan], grey(2)), ([MARKS, DRIFTED], grey(2))):
        with pytest.raises(PlanError):
            hj.apply(plans, torch.from_numpy(image).movedim(-1, -3), inplace=True)
        assert (image == 7).all()


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (lambda: np.zeros((5, 5, 3), np.uint8), "made for 90x60 but the picture is 5x5"),
        (lambda: Image.fromarray(grey()), "a PIL image cannot be written into"),
        (lambda: np.broadcast_to(np.uint8(7), (*SIZE, 3)), "read-only"),
        (lambda: grey().astype(np.float32), "float32"),
        (lambda: "picture", "cannot corrupt a builtins.str"),
    ],
)
def test_a_later_picture_that_is_refused(second, message):
    image = grey()
    with pytest.raises(hj.HijackError, match=message):
        hj.apply([MARKS, MARKS], [image, second()], inplace=True)
    assert (image == 7).all()


def test_a_picture_that_is_in_the_list_twice():
    batch = grey(2)
    torch = pytest.importorskip("torch")
    tensor = torch.from_numpy(batch).movedim(-1, -3)
    for twice in ([batch[0], batch[0]], [tensor[1], tensor[1]]):
        with pytest.raises(ParameterError, match="picture 1 is in the list twice"):
            hj.apply([MARKS, MARKS], twice, inplace=True)
    assert (batch == 7).all()
    hj.apply([MARKS, MARKS], list(batch), inplace=True)
    assert np.array_equal(batch, np.stack([hj.apply(MARKS, grey())] * 2))


# --- in place: views whose pixels share memory


def windows() -> np.ndarray:
    """Overlapping pictures, each one row further down."""
    memory = np.zeros((100, 90, 3), np.uint8)
    step = memory.strides[0]
    return as_strided(memory, (20, *SIZE, 3), (step, *memory.strides))


OVERLAPPING = {
    "windows": windows,
    "a picture of shared rows": lambda: as_strided(
        np.zeros(99_999, np.uint8), (*SIZE, 3), (100, 3, 1)
    ),
    "channels that are their neighbours": lambda: as_strided(
        np.zeros(99_999, np.uint8), (*SIZE, 3), (300, 1, 1)
    ),
    "rows upside down": lambda: as_strided(np.zeros(99_999, np.uint8), (*SIZE, 3), (100, 3, 1))[
        ::-1
    ],
    "one pixel": lambda: as_strided(np.zeros(3, np.uint8), (*SIZE, 3), (0, 0, 1)),
}


@pytest.mark.parametrize("name", OVERLAPPING)
def test_overlapping_views_are_refused(name):
    image = OVERLAPPING[name]()
    with pytest.raises(ParameterError, match="its pixels share memory"):
        hj.apply(MARKS, image, inplace=True)
    assert (image == 0).all()


@pytest.mark.parametrize("name", [name for name in OVERLAPPING if name != "rows upside down"])
def test_overlapping_tensors_are_refused(name):
    torch = pytest.importorskip("torch")
    array = OVERLAPPING[name]()
    lead = range(array.ndim - 3)
    strides = [array.strides[axis] for axis in (*lead, -1, -3, -2)]
    memory = torch.zeros(99_999, dtype=torch.uint8)
    image = memory.as_strided((*array.shape[:-3], 3, *SIZE), strides)
    with pytest.raises(ParameterError, match="its pixels share memory"):
        hj.apply(MARKS, image, inplace=True)
    assert (memory == 0).all()


def test_views_that_do_not_overlap_are_written_into():
    memory = np.full((2, 60, 181, 7), 7, np.uint8)
    views = (memory[0, :, 1::2, 2:5], memory[0, ::-1, ::-2, 5:2:-1][:, :90], memory[1, :, :90, ::3])
    for view in views:
        before = view.copy()
        hj.apply(MARKS, view, inplace=True)
        assert np.array_equal(view, hj.apply(MARKS, before))


@given(st.lists(st.tuples(st.integers(1, 5), st.integers(-9, 9)), min_size=1, max_size=4))
@settings(max_examples=300, deadline=None)
def test_overlap_is_that_of_the_places_written_out(axes):
    shape, strides = tuple(n for n, _ in axes), tuple(step for _, step in axes)
    places = [
        sum(i * s for i, s in zip(index, strides, strict=True)) for index in np.ndindex(shape)
    ]
    assert overlaps(shape, strides) == (len(set(places)) < len(places))


# --- lists


@pytest.mark.parametrize("plans", [MARKS, [MARKS, MARKS]])
def test_a_batch_inside_a_list_is_refused(plans):
    torch = pytest.importorskip("torch")
    tensor = torch.from_numpy(grey(4)).movedim(-1, -3)
    for item in (grey(4), tensor, grey(1)):
        with pytest.raises(
            ImageError, match=r"item 1 of the list has shape .* a list holds single"
        ):
            hj.apply(plans, [grey(), item])
    with pytest.raises(ImageError, match="item 1 of the list is itself a list"):
        hj.apply(plans, [grey(), [grey()]])


def test_a_list_of_single_pictures_is_taken():
    pictures = [picture(SIZE), Image.fromarray(picture(SIZE))]
    first, second = hj.apply(MARKS, pictures)
    assert np.array_equal(first, np.asarray(second))
    assert hj.apply(MARKS, []) == []


# --- pictures that hold no pixels


def test_pil_pictures_that_cannot_be_decoded():
    buffer = io.BytesIO()
    Image.fromarray(picture(SIZE)).save(buffer, "PNG")
    cut = Image.open(io.BytesIO(buffer.getvalue()[: len(buffer.getvalue()) // 2]))
    with pytest.raises(ImageError, match="cannot be decoded"):
        hj.apply(MARKS, cut)
    closed_image = Image.fromarray(picture(SIZE))
    closed_image.close()
    with pytest.raises(ImageError, match="cannot be decoded"):
        hj.apply(MARKS, closed_image)


def test_a_pil_picture_where_an_array_is_needed():
    with pytest.raises(ImageTypeError, match=r"got a PIL image where an array is needed.*asarray"):
        find_backend(Image.fromarray(picture(SIZE)))


@pytest.mark.filterwarnings("ignore:.*nested tensors is in prototype:UserWarning")
def test_tensors_without_pixels():
    torch = pytest.importorskip("torch")
    from torch._subclasses.fake_tensor import FakeTensorMode

    tensor = torch.zeros((3, *SIZE), dtype=torch.uint8)
    with FakeTensorMode():
        fake = torch.zeros((3, *SIZE), dtype=torch.uint8)
    kinds = {
        "nested": torch.nested.nested_tensor([tensor, tensor]),
        "fake": fake,
        "meta": tensor.to("meta"),
        "sparse": tensor.to_sparse(),
    }
    for name, bad in kinds.items():
        with pytest.raises(ImageTypeError, match=rf"{name}.*holds no pixels"):
            hj.apply(MARKS, bad)
    with pytest.raises(ImageTypeError, match=r"torch\.vmap holds no pixels"):
        torch.vmap(lambda image: hj.apply(MARKS, image))(torch.stack([tensor, tensor]))


def test_a_jax_array_that_was_given_away():
    jnp = pytest.importorskip("jax.numpy")
    image = jnp.asarray(picture(SIZE))
    image.delete()
    with pytest.raises(ImageError, match="deleted, or donated"):
        hj.apply(MARKS, image)


def test_what_looks_at_pixels_inside_a_program():
    jax = pytest.importorskip("jax")
    augmentation = hj.OneOf([hj.Marks(number=2, mark_size=5)])
    images = jax.numpy.asarray(grey(2))
    with pytest.raises(ImageTypeError, match=r"inside jax\.jit a picture has no pixels yet"):
        jax.jit(lambda batch: changed_pixels(batch[0], batch[1]))(images)
    with pytest.raises(ImageTypeError, match=r"plans are made on the host.*traces it"):
        jax.jit(lambda batch: augmentation(batch, ids=[1, 2], seed=1).image)(images)
    inside = jax.jit(lambda image: hj.apply(MARKS, image))(images[0])
    assert np.array_equal(np.asarray(inside), hj.apply(MARKS, grey()))


# --- places that are none


@pytest.mark.parametrize(
    "at",
    [
        ((1.7, 2),),
        ((True, False),),
        ((1, 2), (3,)),
        ((2**40, 1),),
        ((10**30, 1),),
        (5,),
        ("ab",),
        ((None, 1),),
    ],
)
def test_places_that_are_no_integers_are_refused_not_cut_off(at):
    with pytest.raises(PlanError, match="the places of a Paste must be points"):
        hj.apply(Plan("test-v1", SIZE, ops=(Paste(RECIPE, at),)), grey())
