"""Check the pixels of a plan: every backend against a plain reference, and the scope."""

import importlib.util
from collections.abc import Iterator
from typing import Any

import numpy as np

from .._apply import apply
from ..backends import convert, to_numpy
from ..choices import BACKENDS
from ..corruption import Corruption
from ..errors import ParameterError
from ..kernels.cpu import jit
from ..plan import Paste, Plan
from ..types import Size, UInt8Array
from . import cases
from .base import expect
from .cases import levels, picture, scene
from .reference import reference

SCOPE_SEEDS = 4
STEPS_COMPARED = 100


def check_backends(cls: type[Corruption]) -> None:
    """Every installed backend gives the bytes of the reference and leaves its input unchanged."""
    for plan, size in cases.plans(cls):
        image = picture(size)
        expected = reference(plan, image)
        for name, out in _outputs(plan, image):
            expect(
                out.shape == expected.shape,
                f"{name}: shape {out.shape} instead of {expected.shape} at {size}",
            )
            differing = int((out != expected).sum())
            expect(
                not differing,
                f"{name}: {differing} bytes differ from the definition at {size} ({plan.params})",
            )
        expect(np.array_equal(image, picture(size)), "apply wrote into its input")


def _outputs(plan: Plan, image: UInt8Array) -> Iterator[tuple[str, UInt8Array]]:
    """Yield the result of each backend and code path."""
    jit.start()
    for name in BACKENDS:
        if name == "numpy" or _is_installed(name):
            yield name, to_numpy(apply(plan, convert(image, name)))
    planar = np.ascontiguousarray(image.transpose(2, 0, 1)).transpose(1, 2, 0)
    yield "numpy, channels first", apply(plan, planar)
    strided = np.repeat(image, 2, axis=1)[:, ::2]
    yield "numpy, strided", apply(plan, strided)
    yield "numpy, without Numba", _without_numba(plan, image)
    if _is_installed("torch"):
        yield "torch operations", _torch_operations(plan, image)
        yield from _gpu_outputs(plan, convert(image, "torch"))
    if _is_installed("jax"):
        yield "jax operations", to_numpy(jax_operations(plan, convert(image, "jax")))


def _is_installed(name: str) -> bool:
    return importlib.util.find_spec(name) is not None


def _without_numba(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Run the code that is used where Numba is not installed."""
    from ..kernels import lower
    from ..kernels.cpu import pixels as cpu

    out = image.copy()
    for op in plan.ops:
        if isinstance(op, Paste):
            out = cpu.paste(out, lower(op, (out.shape[0], out.shape[1])))
        else:
            out = cpu.resample_plain(out, op.size)
    return out


def _gpu_outputs(plan: Plan, image: Any) -> Iterator[tuple[str, UInt8Array]]:
    """Yield the results of torch on a GPU, if there is one."""
    import torch

    if not torch.cuda.is_available():
        return
    on_gpu = image.cuda()
    yield "torch on a GPU", to_numpy(apply(plan, on_gpu))
    channels_last = on_gpu.permute(1, 2, 0).contiguous()
    same_axes = channels_last.permute(2, 0, 1)
    yield "torch on a GPU, channels last", to_numpy(apply(plan, same_axes))


def _torch_operations(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Run on the CPU the tensor operations that other devices run."""
    from ..kernels import lower
    from ..kernels import torch_ops as kernels

    out = convert(image.copy(), "torch")
    for op in plan.ops:
        if isinstance(op, Paste):
            size: Size = (int(out.shape[1]), int(out.shape[2]))
            out = kernels.paste_ops(out, lower(op, size))
        else:
            out = kernels.resample_ops(out, op.size)
    return to_numpy(out)


def jax_operations(plan: Plan, image: Any) -> Any:
    """Run the operations that other devices run on a JAX array `[H, W, 3]` of any device."""
    from ..kernels import jax_ops as kernels
    from ..kernels import lower

    for op in plan.ops:
        if isinstance(op, Paste):
            size: Size = (int(image.shape[0]), int(image.shape[1]))
            image = kernels.paste(image, lower(op, size))
        else:
            image = kernels.resample(image, op.size)
    return image


def check_batches(cls: type[Corruption]) -> None:
    """A batch with a plan for each picture equals the pictures one by one, also in place."""
    size = cases.SIZES[2]
    try:
        plans = [cls().plan(scene(size), seed=3, sample=i, step=None) for i in range(3)]
    except ParameterError:
        return
    image = picture(size)
    batch = np.stack([np.roll(image, i, axis=1) for i in range(3)])
    singles = [apply(plan, frame) for plan, frame in zip(plans, batch, strict=True)]
    together = apply(plans, batch)
    for out, single in zip(together, singles, strict=True):
        expect(np.array_equal(out, single), "a batch differs from its pictures one by one")
    if all(plan.out_size == size for plan in plans):
        in_place = batch.copy()
        expect(
            apply(plans, in_place, inplace=True) is in_place, "inplace=True returns another array"
        )
        expect(np.array_equal(in_place, np.stack(singles)), "inplace=True gives other bytes")


def check_scope(cls: type[Corruption]) -> None:
    """A plan draws, acts on the machine, or changes the agent's input, as its scope says."""
    plans = [plan for plan, _ in cases.plans(cls)]
    full = scene(cases.SIZES[0])
    for spec in cases.variants(cls):
        plans += [spec.plan(full, seed=seed, sample="scope") for seed in range(SCOPE_SEEDS)]
    for plan in plans:
        check_declared(cls, plan)
        _check_plan_scope(plan, cls.scope)


def _check_plan_scope(plan: Plan, scope: str) -> None:
    if scope in ("observation", "action"):
        kinds = ", ".join(effect.kind for effect in plan.effects)
        expect(
            not plan.effects,
            f"scope {scope!r} with effects on the machine ({kinds}); use scope 'state' or "
            "'transition'",
        )
    if scope != "action":
        expect(
            not plan.inputs, f"scope {scope!r} with faults of the agent's input; use scope 'action'"
        )
    if scope != "observation":
        expect(
            not plan.ops,
            f"scope {scope!r} with operations on the picture; the machine shows its own: leave ops "
            "empty, or use scope 'observation'",
        )


def check_declared(cls: type[Corruption], plan: Plan) -> None:
    """Fail if a plan has an effect that the class does not declare."""
    if cls.scope == "observation":
        return
    for effect in plan.effects:
        expect(
            effect.kind in cls.effects,
            f"scope {cls.scope!r} with the effect {effect.kind!r}; effects is {cls.effects}: name "
            "it there",
        )


def check_visible(cls: type[Corruption]) -> None:
    """A plan changes picture, machine or input, or a note says why not."""
    size = cases.SIZES[0]
    image = picture(size)
    for spec in levels(cls):
        plan = spec.plan(scene(size), seed=3, sample="check", step=None)
        if plan.notes:
            continue
        if cls.scope == "observation":
            visible = not np.array_equal(apply(plan, image), image)
            expect(visible, f"the picture stays as it was and no note says why ({plan.params})")
        elif cls.scope == "action":
            expect(plan.inputs, "scope 'action' has no fault of the input and no note says why")
        else:
            expect(plan.effects, f"scope {cls.scope!r} has no effect and no note says why")


def check_levels(cls: type[Corruption]) -> None:
    """Severities differ in what a plan does, or in the steps at which it does so."""
    full = scene(cases.SIZES[0])
    by_level: list[object] = []
    for spec in levels(cls):
        plans = [spec.plan(full, seed=seed, sample="levels") for seed in range(SCOPE_SEEDS)]
        if not any(plan.ops or plan.effects or plan.inputs for plan in plans):
            return  # `check_visible` judges a plan that does nothing
        steps = [spec.is_due(step) for step in range(-1, STEPS_COMPARED)]
        by_level.append(([(plan.ops, plan.effects, plan.inputs) for plan in plans], steps))
    expect(
        len(by_level) == 1 or any(level != by_level[0] for level in by_level),
        "all severities do the same: use the parameters that they set, or declare none",
    )
