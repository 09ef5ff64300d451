"""What every corruption must hold, checked by trying: the suite behind `hijack check` and the project's own tests.

A check is a function `(cls) -> None` that raises `AssertionError` with the probable cause. Pictures are compared with
a plain reference that follows the definition pixel by pixel, so a mistake in any kernel shows.
"""

import importlib.util
import pickle
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from PIL import Image

from . import params as p
from .apply import apply
from .backends import NAMES, convert, to_numpy
from .corruption import Corruption, find
from .errors import HijackError, ParameterError, UnknownNameError
from .kernels import jit
from .plan import Paste, Plan
from .raster import render
from .types import Scene, Size, UInt8Array

SIZES: tuple[Size, ...] = ((1080, 1920), (720, 1280), (333, 517), (64, 48), (1, 1))
Check: TypeAlias = Callable[[type[Corruption]], None]


@dataclass(frozen=True)
class Result:
    """Outcome of one check: `problem` is empty when it passed."""

    check: str
    about: str
    problem: str

    @property
    def ok(self) -> bool:
        """Whether the check passed."""
        return not self.problem


def picture(size: Size) -> UInt8Array:
    """A test picture without two equal neighbours, the same on every machine: uint8 `[H, W, 3]`."""
    y, x = np.mgrid[0 : size[0], 0 : size[1]].astype(np.uint32)
    value = (x * 2654435761 + y * 2246822519) >> 8
    return np.stack([value & 255, (value >> 8) & 255, (x + 3 * y) & 255], axis=-1).astype(np.uint8)


def scene(size: Size) -> Scene:
    """A screen with a toolbar, a list, a form and a target, in proportion to `size`."""
    height, width = size
    rows = [(8 + 90 * i, 6, 80 + 90 * i, 40) for i in range(12)] + [
        (20, 120 + 60 * i, 420, 160 + 60 * i) for i in range(12)
    ]
    rows += [(1500, 200, 1860, 260), (1500, 300, 1860, 360), (1700, 980, 1860, 1040)]
    boxes = [
        [x1 * width // 1920, y1 * height // 1080, x2 * width // 1920, y2 * height // 1080] for x1, y1, x2, y2 in rows
    ]
    x1, y1, x2, y2 = boxes[-1]
    return Scene(size, np.array(boxes, np.int32), ("chrome",), (x1, y1, x2, y2))


def reference(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Apply a plan by its definition: stamp after stamp in exact integers, and Pillow's own resize."""
    out = image.astype(np.int64)
    for op in plan.ops:
        if isinstance(op, Paste):
            for x, y in op.at:
                _stamp(out, op, x, y)
        else:
            picture = Image.fromarray(out.astype(np.uint8))
            out = np.array(picture.resize((op.size[1], op.size[0]), Image.Resampling.BICUBIC)).astype(np.int64)
    return out.astype(np.uint8)


def _stamp(out: np.ndarray[Any, Any], op: Paste, x: int, y: int) -> None:
    """Blend one sprite: `d` becomes the nearest integer to `(d * (255 - alpha) + paint) / 255`."""
    sprite = render(op.sprite)
    h, w = sprite.size
    top, left, bottom, right = max(y, 0), max(x, 0), min(y + h, out.shape[0]), min(x + w, out.shape[1])
    if top >= bottom or left >= right:
        return
    part = (slice(top - y, bottom - y), slice(left - x, right - x))
    alpha, paint = sprite.alpha[part].astype(np.int64)[..., None], sprite.paint[part].astype(np.int64)
    below = out[top:bottom, left:right]
    out[top:bottom, left:right] = (2 * (below * (255 - alpha) + paint) + 255) // 510


def _plans(cls: type[Corruption]) -> Iterator[tuple[Plan, Size]]:
    """Yield the plans of all severities and sizes that the corruption accepts."""
    levels = [cls.at(severity) for severity in range(1, 6)] if cls.severities else [cls()]
    for size in SIZES:
        for spec in levels:
            try:
                yield spec.plan(scene(size), seed=3, sample="check", step=None), size
            except ParameterError:
                assert size != SIZES[0], "the default must fit a 1920x1080 screen"


def check_registered(cls: type[Corruption]) -> None:
    """It is found by name and by id, documented, and has a default for every parameter."""
    assert find(cls.name) is cls, f"{cls.name!r} finds another class; call @register on it"
    assert find(cls().id) is cls, f"{cls().id!r} is not found"
    assert cls.summary(), "the class needs a docstring: its first line is the documentation"
    for key, (parameter, _) in p.parameters(cls).items():
        assert parameter.doc, f"parameter {key} has no documentation"


def check_parameters(cls: type[Corruption]) -> None:
    """Unknown, wrong and out-of-range parameters are refused; values survive JSON."""
    try:
        type(cls())  # a default that does not pass its own check fails here
        cls().replace(no_such_parameter=1)
    except UnknownNameError:
        pass
    else:
        raise AssertionError("an unknown parameter is accepted")
    for key, (parameter, _) in p.parameters(cls).items():
        for bad in (object(), *(v for v in (_below(parameter), _above(parameter)) if v is not None)):
            try:
                cls(**{key: bad})
            except (ValueError, TypeError):
                continue
            raise AssertionError(f"{key}={bad!r} is accepted")
    assert cls(**cls().params()) == cls(), "params() does not give the corruption back"


def _below(parameter: p.Parameter) -> float | None:
    return None if parameter.low is None else parameter.low - 1


def _above(parameter: p.Parameter) -> float | None:
    return None if parameter.high is None else parameter.high + 1


def check_plan_is_data(cls: type[Corruption]) -> None:
    """Plans survive JSON and pickling unchanged, and editing one is noticed."""
    for plan, _ in _plans(cls):
        again = Plan.from_json(plan.to_json())
        assert again == plan, "Plan.from_json(plan.to_json()) differs: keep tuples and NumPy numbers out of recipes"
        assert again.digest() == plan.digest(), "the digest changes in a JSON round trip"
        assert pickle.loads(pickle.dumps(plan)) == plan, "the plan does not survive pickling"  # noqa: S301
        edited = plan.to_json().replace(f'"corruption":"{plan.corruption}"', '"corruption":"edited-v1"')
        try:
            Plan.from_json(edited)
        except HijackError:
            continue
        raise AssertionError("an edited plan is accepted")


def check_deterministic(cls: type[Corruption]) -> None:
    """The key alone decides: not the order, not the global generators, not what was planned before."""
    spec, screen = cls(), scene(SIZES[0])
    keys = [(seed, sample) for seed in (0, 1) for sample in ("a", "b", 3)]

    def digests(order: list[tuple[int, Any]]) -> dict[Any, str]:
        return {key: spec.plan(screen, seed=key[0], sample=key[1]).digest() for key in order}

    python, legacy = random.getstate(), _numpy_state()
    first = digests(keys)
    assert random.getstate() == python, "planning draws from Python's global generator; use the stream"
    assert np.array_equal(legacy, _numpy_state()), "planning draws from NumPy's global generator; use the stream"
    random.seed(99)
    np.random.seed(99)  # noqa: NPY002
    assert digests(keys[::-1]) == first, "the plan depends on the order of planning or on a global generator"
    random.setstate(python)


def _numpy_state() -> Any:
    state: Any = np.random.get_state()  # noqa: NPY002
    return state[1]


def check_backends(cls: type[Corruption]) -> None:
    """Every installed backend gives the bytes of the reference, and leaves its input as it was."""
    for plan, size in _plans(cls):
        image = picture(size)
        expected = reference(plan, image)
        for name, out in _outputs(plan, image):
            assert out.shape == expected.shape, f"{name}: shape {out.shape} instead of {expected.shape} at {size}"
            wrong = int((out != expected).sum())
            assert not wrong, f"{name}: {wrong} bytes differ from the definition at {size} ({plan.params})"
        assert np.array_equal(image, picture(size)), "apply wrote into its input"


def _outputs(plan: Plan, image: UInt8Array) -> Iterator[tuple[str, UInt8Array]]:
    """Yield the result of each backend and code path."""
    jit.start()
    for name in NAMES:
        if name == "numpy" or importlib.util.find_spec(name) is not None:
            yield name, to_numpy(apply(plan, convert(image, name)))
    planar = np.ascontiguousarray(image.transpose(2, 0, 1)).transpose(1, 2, 0)
    yield "numpy, channels first", apply(plan, planar)
    yield "numpy, strided", apply(plan, np.repeat(image, 2, axis=1)[:, ::2])
    yield "numpy, without Numba", _without_numba(plan, image)
    if importlib.util.find_spec("torch") is not None:
        yield "torch operations", _torch_operations(plan, image)
        yield from _on_a_gpu(plan, convert(image, "torch"))
    if importlib.util.find_spec("jax") is not None:
        yield "jax operations", to_numpy(jax_operations(plan, convert(image, "jax")))


def _without_numba(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Run the code that stands in where Numba is not installed."""
    from .kernels import lower
    from .kernels import numpy as cpu

    out = image.copy()
    for op in plan.ops:
        size: Size = (out.shape[0], out.shape[1])
        out = cpu.paste_plain(out, lower(op, size)) if isinstance(op, Paste) else cpu.resample_plain(out, op.size)
    return out


def _on_a_gpu(plan: Plan, image: Any) -> Iterator[tuple[str, UInt8Array]]:
    """Yield what torch gives on a GPU, where there is one."""
    import torch

    if torch.cuda.is_available():
        there = image.cuda()
        yield "torch on a GPU", to_numpy(apply(plan, there))
        yield (
            "torch on a GPU, channels last",
            to_numpy(apply(plan, there.permute(1, 2, 0).contiguous().permute(2, 0, 1))),
        )


def _torch_operations(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Run the code that other devices run, on the CPU."""
    from .kernels import lower
    from .kernels import torch as kernels

    out = convert(image.copy(), "torch")
    for op in plan.ops:
        size: Size = (int(out.shape[1]), int(out.shape[2]))
        out = kernels.paste_ops(out, lower(op, size)) if isinstance(op, Paste) else kernels.resample_ops(out, op.size)
    return to_numpy(out)


def jax_operations(plan: Plan, image: Any) -> Any:
    """Run the code that other devices run on a JAX array `[H, W, 3]`, wherever it is."""
    from .kernels import jax as kernels
    from .kernels import lower

    for op in plan.ops:
        size: Size = (int(image.shape[0]), int(image.shape[1]))
        image = kernels.paste(image, lower(op, size)) if isinstance(op, Paste) else kernels.resample(image, op.size)
    return image


def check_batches(cls: type[Corruption]) -> None:
    """A batch with a plan for each picture equals the pictures one by one; so does writing in place."""
    size = SIZES[2]
    try:
        plans = [cls().plan(scene(size), seed=3, sample=i, step=None) for i in range(3)]
    except ParameterError:
        return
    batch = np.stack([np.roll(picture(size), i, axis=1) for i in range(3)])
    singles = [apply(plan, image) for plan, image in zip(plans, batch, strict=True)]
    for out, single in zip(apply(plans, batch), singles, strict=True):
        assert np.array_equal(out, single), "a batch differs from its pictures one by one"
    if all(plan.out_size == size for plan in plans):
        own = batch.copy()
        assert apply(plans, own, inplace=True) is own, "inplace=True returns another array"
        assert np.array_equal(own, np.stack(singles)), "inplace=True gives other bytes"


def check_visible(cls: type[Corruption]) -> None:
    """A corruption of the observation changes the picture or says why not; the others change no pixel by themselves."""
    size = SIZES[0]
    plan = cls().plan(scene(size), seed=3, sample="check", step=None)
    changed = apply(plan, picture(size)).shape != (*size, 3) or not np.array_equal(
        apply(plan, picture(size)), picture(size)
    )
    if cls.scope == "observation":
        assert changed or plan.notes, "the picture stays as it was and no note says why"
        assert not plan.effects, "scope 'observation' must not have effects on the machine; use 'state' or 'transition'"
    else:
        assert plan.effects or plan.notes, f"scope {cls.scope!r} has no effect and no note says why"


CHECKS: tuple[Check, ...] = (
    check_registered,
    check_parameters,
    check_plan_is_data,
    check_deterministic,
    check_backends,
    check_batches,
    check_visible,
)


def run(cls: type[Corruption]) -> list[Result]:
    """Run all checks on one corruption; an exception of the corruption's own code is a problem, not a crash."""
    return [_run_one(check, cls) for check in CHECKS]


def _run_one(check: Check, cls: type[Corruption]) -> Result:
    about = (check.__doc__ or "").strip().split("\n")[0]
    try:
        check(cls)
    except AssertionError as error:
        return Result(check.__name__.removeprefix("check_"), about, str(error) or "failed")
    except Exception as error:  # noqa: BLE001  (a plug-in may raise anything; the report must go on)
        return Result(check.__name__.removeprefix("check_"), about, f"{type(error).__name__}: {error}")
    return Result(check.__name__.removeprefix("check_"), about, "")
