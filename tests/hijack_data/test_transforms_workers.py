"""DataLoader workers: their number, the way they start and the order of samples change nothing."""

import copy
import hashlib
import multiprocessing
import pickle

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.conformance import picture

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")
from torch.utils.data import DataLoader, Dataset  # noqa: E402

import hijack_data.transforms as tr  # noqa: E402

SIZE = (120, 200)


class Rows(Dataset):
    """A map-style dataset of 12 screens."""

    def __init__(self, transform):
        self.transform = transform

    def __len__(self):
        return 12

    def __getitem__(self, index):
        image = torch.from_numpy(np.roll(picture(SIZE), index, 0).copy()).permute(2, 0, 1)
        return self.transform({"image": image, "id": f"row-{index}", "target": (50, 50)})


def augmentation():
    options = [
        tr.PopUps(width=120, height=80),
        tr.Marks(number=9, mark_size=5),
        tr.Resolution(scale=0.5, restore=True),
    ]
    return tr.OneOf(options, seed=3, p_clean=0.2, return_plan=True)


def load_samples(transform=None, **options):
    """What a loader yields: `{id: (plan, picture)}` as digests."""
    entries = {}
    for batch in DataLoader(Rows(transform or augmentation()), batch_size=3, **options):
        for key, plan, image in zip(batch["id"], batch["plan"], batch["image"], strict=True):
            entries[key] = plan.digest(), hashlib.sha256(image.numpy()).hexdigest()
    return entries


@pytest.fixture(scope="module")
def alone():
    return load_samples()


@pytest.mark.parametrize("workers", [1, 2, 3])
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning", "ignore:.*fork.*:RuntimeWarning")
@pytest.mark.filterwarnings("ignore:This DataLoader will create")
def test_forked_workers(alone, workers):
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("this system cannot fork")
    assert load_samples(num_workers=workers, multiprocessing_context="fork", shuffle=True) == alone
    assert len({plan for plan, _ in alone.values()}) > 6


@pytest.mark.filterwarnings("ignore:This DataLoader will create")
def test_spawned_workers(alone):
    assert load_samples(num_workers=1, multiprocessing_context="spawn", shuffle=True) == alone


def pickled(transform):
    return pickle.loads(pickle.dumps(transform))


@pytest.mark.parametrize("made", [lambda transform: transform, copy.deepcopy, pickled])
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning", "ignore:.*fork.*:RuntimeWarning")
def test_workers_that_stay_see_the_epoch_change(alone, made):
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("this system cannot fork")
    transform = made(augmentation())
    loader = DataLoader(
        Rows(transform),
        batch_size=3,
        num_workers=1,
        persistent_workers=True,
        multiprocessing_context="fork",
    )
    epochs = []
    for epoch in (0, 1, 0):
        transform.set_epoch(epoch)
        epochs.append(
            {
                k: p.digest()
                for batch in loader
                for k, p in zip(batch["id"], batch["plan"], strict=True)
            }
        )
    assert epochs[0] == epochs[2] == {key: plan for key, (plan, _) in alone.items()}
    assert epochs[1] != epochs[0]


def test_a_saved_epoch_is_replayed():
    plans = {
        key: plan.to_json()
        for batch in DataLoader(Rows(augmentation()))
        for key, plan in _pairs(batch)
    }
    assert load_samples(tr.Replay(plans, return_plan=True)) == load_samples()


def _pairs(batch):
    return zip(batch["id"], batch["plan"], strict=True)


def test_the_functional_form_gives_the_same():
    rows = [Rows(lambda sample: sample)[i] for i in range(12)]
    spec = hj.OneOf(
        [
            hj.PopUps(width=120, height=80),
            hj.Marks(number=9, mark_size=5),
            hj.Resolution(scale=0.5, restore=True),
        ],
        p_clean=0.2,
    )
    batch = torch.stack([row["image"] for row in rows])
    res = spec(batch, ids=[row["id"] for row in rows], targets=[(50, 50)] * 12, seed=3)
    out = augmentation()(
        {"image": batch, "id": [row["id"] for row in rows], "target": [(50, 50)] * 12}
    )
    assert out["plan"] == res.plans
    assert torch.equal(out["image"], res.image)
    assert out["target_visible"] == [s.target_visible for s in res.safety]
    drags = [hj.Action("drag", 50, 50, 150 - i, 80) for i in range(12)]
    judged = spec(
        batch,
        ids=[row["id"] for row in rows],
        targets=[(50, 50)] * 12,
        ends=[d.end for d in drags],
        seed=3,
    ).safety
    sample = {
        "image": batch,
        "id": [row["id"] for row in rows],
        "target": [(50, 50)] * 12,
        "action": drags,
    }
    assert augmentation()(sample)["target_visible"] == [s.target_visible for s in judged]
    assert judged != res.safety
