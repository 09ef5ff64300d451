"""Grain transforms and JAX: seeded by ids, the same for any number of threads, no compilation for
each new plan."""

import numpy as np
import pytest
from PIL import Image

import hijack_data as hj
from hijack_data.conformance import jax_operations, picture, reference
from hijack_data.errors import (
    HijackWarning,
    ImageError,
    ImageTypeError,
    ParameterError,
    ParameterTypeError,
)
from hijack_data.safety import target_visible

grain = pytest.importorskip("grain.python")
import hijack_data.grain as hg  # noqa: E402

SIZE = (120, 200)
SPEC = hj.OneOf(
    [hj.PopUps(width=120, height=80), hj.Marks(number=9, mark_size=5), hj.Resolution()], p_clean=0.2
)


def rows(count=12, ids=True):
    values = [{"image": np.roll(picture(SIZE), i, 0), "target": (50, 50)} for i in range(count)]
    return [{**row, "id": f"row-{i}"} for i, row in enumerate(values)] if ids else values


def digests(elements):
    return {e["id"]: e["plan"].digest() for e in elements}


def test_elements_are_corrupted_by_their_id():
    dataset = grain.MapDataset.source(rows()).map(hg.Corrupt(SPEC, seed=3, return_plan=True))
    for row, out in zip(rows(), dataset, strict=True):
        plan = SPEC.plan(hj.Scene(size=SIZE, target=(50, 50)), seed=3, sample=row["id"], step=0)
        assert out["plan"] == plan
        assert np.array_equal(out["image"], reference(plan, row["image"]))
        assert out["target"] == ((25, 25) if plan.out_size != SIZE else (50, 50))
        assert 0 <= out["target_visible"] <= 1
    assert "plan" not in hg.Corrupt(SPEC).map(rows()[0])


def test_a_drag_is_judged_at_both_ends():
    spec, drag = hj.Marks(number=12, mark_size=20), hj.Action("drag", 50, 50, 150, 80)
    scene, shares = hj.Scene(size=SIZE, target=(50, 50)), {}
    for policy in ("keep", "avoid"):
        corrupt = hg.Corrupt(spec, seed=3, label_policy=policy, return_plan=True)
        values = [corrupt.map({**row, "action": drag}) for row in rows()]
        shares[policy] = [e["target_visible"] for e in values]
        assert shares[policy] == [target_visible(e["plan"], (50, 50), (150, 80)) for e in values]
    plans = [
        hj.plugin.plan_avoiding(spec, scene, seed=3, sample=e["id"], step=0, end=drag.end)
        for e in values
    ]
    assert [e["plan"] for e in values] == [plan or hj.Plan.clean(SIZE) for plan in plans]
    starts = [
        e["target_visible"] for e in map(hg.Corrupt(spec, seed=3, return_plan=True).map, rows())
    ]
    assert min(shares["avoid"]) == 1.0 > min(shares["keep"])
    assert shares["keep"] != starts


def test_threads_order_and_loader_change_nothing():
    expected = digests(
        grain.MapDataset.source(rows()).map(hg.Corrupt(SPEC, seed=3, return_plan=True))
    )
    threaded = (
        grain.MapDataset.source(rows())
        .shuffle(seed=5)
        .map(hg.Corrupt(SPEC, seed=3, return_plan=True))
    )
    assert digests(threaded.to_iter_dataset(grain.ReadOptions(num_threads=4))) == expected
    loader = grain.DataLoader(
        data_source=rows(),
        sampler=grain.IndexSampler(12, grain.NoSharding(), shuffle=True, num_epochs=1, seed=4),
        operations=[hg.Corrupt(SPEC, seed=3, return_plan=True)],
        worker_count=0,
    )
    assert digests(loader) == expected


def test_an_entry_epoch_draws_anew():
    source = grain.MapDataset.source(rows()).repeat(2)
    with_epoch = source.map_with_index(lambda i, e: {**e, "epoch": i // 12})
    plans = [e["plan"] for e in with_epoch.map(hg.Corrupt(SPEC, return_plan=True))]
    assert plans[:12] != plans[12:]
    by_visit = with_epoch.seed(7).random_map(hg.RandomCorrupt(SPEC, return_plan=True))
    assert [e["plan"] for e in by_visit] == plans  # the epoch decides, not the generator


def test_a_second_epoch_without_one_is_said():
    again = grain.MapDataset.source(rows()).repeat(2).map(hg.Corrupt(SPEC))
    with pytest.warns(HijackWarning, match=r"map_with_index.*RandomCorrupt") as output:
        list(again)
    assert len(output) == 1


def loader(epochs=2, workers=0):
    return grain.DataLoader(
        data_source=rows(),
        sampler=grain.IndexSampler(12, grain.NoSharding(), shuffle=True, num_epochs=epochs, seed=4),
        operations=[hg.RandomCorrupt(SPEC, seed=3, return_plan=True)],
        worker_count=workers,
    )


def test_random_corrupt_draws_anew_in_each_epoch_and_resumes_within_one():
    run = [(e["id"], e["plan"].digest()) for e in loader()]
    first, second = dict(run[:12]), dict(run[12:])
    assert sum(first[key] != second[key] for key in first) >= 9  # a fifth of both may be clean
    assert [(e["id"], e["plan"].digest()) for e in loader()] == run
    iterator = iter(loader())
    for _ in range(17):
        next(iterator)
    state = iterator.get_state()
    resumed = iter(loader())
    resumed.set_state(state)
    assert [(e["id"], e["plan"].digest()) for e in resumed] == run[17:]

    dataset = (
        grain.MapDataset.source(rows())
        .seed(5)
        .shuffle()
        .repeat(2)
        .random_map(hg.RandomCorrupt(SPEC, seed=3, return_plan=True))
    )
    run = [(e["id"], e["plan"].digest()) for e in dataset]
    first, second = dict(run[:12]), dict(run[12:])
    assert sum(first[key] != second[key] for key in first) >= 9
    iterator = iter(dataset.to_iter_dataset(grain.ReadOptions(num_threads=2)))
    for _ in range(17):
        next(iterator)
    resumed = iter(dataset.to_iter_dataset(grain.ReadOptions(num_threads=2)))
    resumed.set_state(iterator.get_state())
    assert [(e["id"], e["plan"].digest()) for e in resumed] == run[17:]


def test_two_maps_that_draw_alike_are_refused():
    first, second = (hg.Corrupt(spec, p=0.5) for spec in (SPEC, hj.Resolution(restore=True)))
    with pytest.raises(ParameterError, match="both draw alike"):
        second.map(first.map(rows()[0]))
    by_visit = hg.RandomCorrupt(SPEC, p=0.5)
    generator = np.random.default_rng(1)
    by_visit.random_map(by_visit.random_map(rows()[0], generator), generator)


def test_without_ids_grains_generator_decides():
    def made(seed):
        dataset = grain.MapDataset.source(rows(ids=False)).seed(seed)
        return [e["plan"] for e in dataset.random_map(hg.RandomCorrupt(SPEC, return_plan=True))]

    assert made(1) == made(1) != made(2)
    with pytest.raises(ParameterError, match="no 'id' entry"):
        hg.Corrupt(SPEC).map(rows(ids=False)[0])


def test_other_names_and_pil():
    element = {"screen": Image.fromarray(picture(SIZE)), "key": "row-0", "target": (50, 50)}
    out = hg.Corrupt(SPEC, seed=3, image_key="screen", id_key="key").map(element)
    assert np.array_equal(
        np.asarray(out["screen"]), hg.Corrupt(SPEC, seed=3).map(rows()[0])["image"]
    )


@pytest.mark.parametrize(
    ("element", "error", "message"),
    [
        ({"picture": 1, "id": 1}, ImageError, r"holds no picture.*picture \(int\).*image_key="),
        (
            {"image": np.zeros((2, *SIZE, 3), np.uint8), "id": ["a", "b"]},
            ImageError,
            "before batching",
        ),
        ({"image": np.zeros((*SIZE, 3), np.float32), "id": 1}, ImageTypeError, "float32"),
        ({"image": b"png", "id": 1}, ImageError, r"holds no picture.*image \(bytes\)"),
        ([1], ParameterTypeError, "must be a dictionary, got list"),
    ],
)
def test_wrong_elements(element, error, message):
    with pytest.raises(error, match=message):
        hg.Corrupt(SPEC).map(element)


def test_wrong_settings():
    with pytest.raises(ParameterTypeError, match="a corruption such as Marks"):
        hg.Corrupt(hj.Marks)
    with pytest.raises(ParameterError, match="keep or avoid"):
        hg.Corrupt(hj.Marks(), label_policy="drop")


# --- JAX


def test_the_number_of_compilations_does_not_grow():
    """A thousand pictures with random texts, sizes, places and numbers need a handful of
    programs."""
    jnp = pytest.importorskip("jax.numpy")
    from hijack_data.kernels import jax_ops as kernels

    image = jnp.asarray(picture(SIZE))
    words = {"window_string": "go", "prefix_string": "", "suffix_string": ""}
    options = [
        hj.PopUps(width=150, height=100, size="uniform", **words),
        hj.Resolution(scale=0.5, restore=True),
        *(hj.Marks(number=n, mark_size=5) for n in (5, 20)),
    ]
    aug, screen = hj.OneOf(options), hj.Scene(size=SIZE)

    def run(first, last):
        for i in range(first, last):
            text = hj.Subtitle(
                subtitle_text=f"sample {i * 7919}", font_size=8 + i % 9, fit="shrink"
            )
            planner = text if i % 5 == 0 else aug
            jax_operations(planner.plan(screen, seed=1, sample=i), image)
        return kernels.compilations()

    start = kernels.compilations()
    early = run(0, 60)
    assert run(60, 1000) == early
    assert early - start <= 12


def test_donation_leaves_the_callers_picture_alone():
    jnp = pytest.importorskip("jax.numpy")
    image = jnp.asarray(picture(SIZE))
    plan = hj.Sequence(
        [hj.Subtitle(font_size=8), hj.Marks(number=5, mark_size=5), hj.PopUps(width=90, height=60)]
    ).plan(hj.Scene(size=SIZE), seed=1)
    for run in (hj.apply, jax_operations):
        assert np.array_equal(np.asarray(run(plan, image)), reference(plan, picture(SIZE)))
    assert np.array_equal(np.asarray(image), picture(SIZE))
