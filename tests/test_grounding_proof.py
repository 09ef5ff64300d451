"""The proof that augmentation helps: its pages, its batches, its network and its figures are what
they claim."""

import dataclasses
import importlib
import itertools
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import hijack_data as hj

from support import needs

torch = pytest.importorskip("torch", reason="needs the extra [torch]")
BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"
PARTS = ("browser", "data", "markup", "model", "pages", "runs", "score", "train")


@pytest.fixture(scope="module")
def grounding():
    """The package of the benchmark; afterwards it is gone from the path again."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        package = importlib.import_module("grounding")
        for part in PARTS:
            importlib.import_module(f"grounding.{part}")
        yield package
    finally:
        sys.path.remove(str(BENCHMARKS))


@pytest.fixture(autouse=True)
def one_thread():
    """Threads that wait for each other make small networks slow on a busy machine."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def toys(grounding):
    """Pages of four coloured fields on grey, each named after its colour; the places differ from
    page to page."""
    colours = {
        "red": (220, 30, 30),
        "green": (20, 170, 40),
        "blue": (30, 50, 220),
        "yellow": (240, 220, 40),
    }
    items = []
    for n in range(24):
        rng = np.random.default_rng(n)
        image = np.full((128, 192, 3), rng.integers(90, 200), np.uint8)
        spots = rng.permutation(24)[:4]
        boxes = [
            (x * 32 + 4, y * 32 + 4, x * 32 + 28, y * 32 + 28)
            for x, y in zip(spots % 6, spots // 6, strict=True)
        ]
        for (x1, y1, x2, y2), colour in zip(boxes, colours.values(), strict=True):
            image[y1:y2, x1:x2] = colour
        page = grounding.pages.Page(
            f"toy-{n}",
            "train" if n < 16 else "new",
            image,
            np.array(boxes, np.int32),
            tuple(colours),
            (0, 1, 2, 3),
        )
        items.append(page)
    return items


# Pages


def test_a_seed_is_a_page(grounding):
    pages = [grounding.markup.write(seed) for seed in range(30)]
    assert pages == [grounding.markup.write(seed) for seed in range(30)]
    assert len(set(pages)) == 30
    names = {*grounding.markup.ACTIONS, *grounding.markup.PLACES, *grounding.markup.FIELDS}
    assert len(names) == sum(
        map(len, (grounding.markup.ACTIONS, grounding.markup.PLACES, grounding.markup.FIELDS))
    )
    calls = set()
    for html in pages:
        labels = re.findall(r"<(?:button|a)[^>]*>([^<]+)</|<span>([^<]+)</span>", html)
        labels = [value or second for value, second in labels]
        assert len(labels) == len(set(labels)), (
            "a label may be asked for only where it is the only one"
        )
        assert set(labels) <= names
        calls |= set(labels)
    assert calls == names


def test_one_may_ask_for_any_size_of_page(grounding):
    for seed in range(400):
        grounding.markup.write(seed)  # no list of labels runs out


@pytest.fixture
def chromium():
    needs.apps("chromium")


def test_boxes_are_where_the_pixels_are(grounding, chromium, tmp_path):
    style = "position:absolute;border:0;padding:0;color:transparent;"
    html = f"""<!doctype html><body style="margin:0;background:#fff">
      <button style="{style}left:50px;top:30px;width:100px;height:40px;background:#f00">Go</button>
      <button style="{style}left:300px;top:30px;width:100px;height:40px;background:#00f">Twice</button>
      <a href=# style="{style}left:500px;top:30px;width:90px;height:40px">Twice</a>
      <button style="{style}left:300px;top:130px;width:100px;height:40px">Below</button>
      <div style="{style}left:290px;top:120px;width:150px;height:90px;background:#ff0"></div>
      <button style="{style}left:590px;top:130px;width:100px;height:40px">Half out</button>
      <button style="{style}left:50px;top:2000px;width:100px;height:40px">Far down</button>
      <label style="{style}left:50px;top:200px">Name
        <input style="{style}left:0;top:30px;width:80px;height:30px"></label>"""
    with grounding.browser.Browser(tmp_path, (400, 640), density=2) as page:
        page.show(html)
        entries = {(c["label"], c["kind"]): c for c in page.value(f"{grounding.pages.CONTROLS}(2)")}
        picture = page.picture()
    assert picture.shape == (800, 1280, 3)
    assert {key: c["unique"] for key, c in entries.items()} == {
        ("Go", "button"): True,
        ("Twice", "button"): False,
        ("Twice", "a"): False,
        ("Name", "input"): True,
    }
    rows, columns = np.nonzero((picture == (255, 0, 0)).all(-1))
    red = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert entries["Go", "button"]["box"] == [int(v) for v in red] == [100, 60, 300, 140]
    assert entries["Name", "input"]["box"] == [100, 460, 260, 520]


def test_a_page_that_does_not_load_is_named(grounding, chromium, tmp_path):
    with grounding.browser.Browser(tmp_path, (400, 640)) as page:
        with pytest.raises(
            grounding.browser.BrowserError, match=r"http://127.0.0.1:9/ does not load: net::ERR"
        ):
            page.open("http://127.0.0.1:9/")
        with pytest.raises(grounding.browser.BrowserError, match="the page failed: ReferenceError"):
            page.value("nothing.here")
        with pytest.raises(grounding.browser.BrowserError, match=r"refuses Page\.fly"):
            page.call("Page.fly")


def test_rendering_is_done_once(grounding, chromium, tmp_path):
    folder = tmp_path / "pages"
    grounding.pages.render(folder, 2, 1, sites=False)
    entries = {path.name: path.read_bytes() for path in folder.iterdir()}
    stamp = (folder / "pages.json").stat().st_mtime_ns
    grounding.pages.render(folder, 2, 1, sites=False)
    assert (folder / "pages.json").stat().st_mtime_ns == stamp
    read = grounding.pages.load(folder)
    assert [page.split for page in read] == ["train", "train", "new"]
    for page in read:
        assert page.image.shape == (600, 960, 3)
        assert len(page.asked) >= 3
        assert (page.boxes[:, :2] >= 0).all()
        assert (page.boxes[:, 2:] <= (960, 600)).all()
        for x1, y1, x2, y2 in page.boxes[list(page.asked)]:
            assert len(np.unique(page.image[y1:y2, x1:x2].reshape(-1, 3), axis=0)) > 1, (
                "something is drawn there"
            )
    grounding.pages.render(folder, 1, 1, sites=False)
    assert [page.split for page in grounding.pages.load(folder)] == ["train", "new"]
    assert (folder / "seed-0000.png").read_bytes() == entries["seed-0000.png"]
    assert not (folder / "seed-0002.png").exists()


def test_other_peoples_folders_are_left_alone(grounding, chromium, tmp_path):
    (tmp_path / "thesis.png").write_text("years of work")
    with pytest.raises(
        FileExistsError, match="holds something else than pages; name an empty folder"
    ):
        grounding.pages.render(tmp_path, 1, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.png"]


def test_a_missing_browser_is_named(grounding, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(grounding.browser.BrowserError, match="apt-get install chromium"):
        grounding.pages.render(tmp_path / "pages", 1, 1)
    assert not (tmp_path / "pages").exists()


# Batches


def test_the_order_is_the_seeds_alone(grounding, toys):
    def names(seed):
        turns = itertools.islice(grounding.data.order(toys, 5, seed), 9)
        return [(epoch, [page.name for page in page_batch]) for epoch, page_batch in turns]

    assert names(3) == names(3)
    assert names(3) != names(4)
    assert [epoch for epoch, _ in names(3)] == [0] * 4 + [1] * 4 + [2]
    for epoch in (0, 1):
        once = [name for at, some in names(3) if at == epoch for name in some]
        assert len(once) == len(set(once)) == 20


def screen(grounding, boxes, name="page"):
    labels = tuple(f"label {n}" for n in range(len(boxes)))
    image = np.full((800, 1280, 3), 200, np.uint8)
    return grounding.pages.Page(
        name, "train", image, np.array(boxes, np.int32), labels, tuple(range(len(boxes)))
    )


def test_a_batch_is_corrupted_by_id_seed_and_epoch(grounding):
    pages = [screen(grounding, [(10, 10, 60, 40)], f"page-{n}") for n in range(6)]
    augment = grounding.data.augmentation(["pop_ups", "marks", "subtitle", "resolution"])
    first = grounding.data.batch_of(pages, augment, seed=1, epoch=0)
    assert first.pictures.shape == (6, 3, 400, 640)
    again = grounding.data.batch_of(pages[::-1], augment, seed=1, epoch=0)
    assert torch.equal(first.pictures, again.pictures.flip(0))
    for second in ({"seed": 2, "epoch": 0}, {"seed": 1, "epoch": 1}):
        assert not torch.equal(
            first.pictures, grounding.data.batch_of(pages, augment, **second).pictures
        )
    clean = grounding.data.batch_of(pages, None, seed=1)
    assert (clean.pictures == 200).all()
    assert clean.boxes.tolist() == [[5, 5, 30, 20]] * 6
    assert clean.of.tolist() == [0, 1, 2, 3, 4, 5]
    assert grounding.data.augmentation([]) is None


def test_what_is_hidden_is_not_asked_for(grounding):
    """The subtitle stands at the bottom: a control below its letters goes, one elsewhere stays."""
    plan = hj.Subtitle().plan(hj.Scene(size=(800, 1280)), seed=1)
    changed_mask = (hj.apply(plan, np.full((800, 1280, 3), 200, np.uint8)) != 200).any(-1)
    size = 8
    blocks = changed_mask.reshape(800 // size, size, 1280 // size, size).mean((1, 3))
    y, x = np.argwhere(blocks == 1)[0] * size
    page = screen(grounding, [(10, 10, 60, 40), (int(x), int(y), int(x) + size, int(y) + size)])
    assert grounding.data.corrupted(page, None).labels == ["label 0", "label 1"]
    assert grounding.data.corrupted(page, "subtitle").labels == ["label 0"]
    pictures = grounding.data.corrupted(page, "marks").pictures
    assert torch.equal(pictures, grounding.data.corrupted(page, "marks").pictures)
    assert not torch.equal(pictures, grounding.data.corrupted(page, None).pictures)


def test_the_corruptions_are_the_librarys_defaults(grounding):
    shape = {"resolution": {"restore": True}, "subtitle": {"fit": "shrink"}}
    for name, spec in grounding.data.CORRUPTIONS.items():
        assert spec == hj.make_corruption(name, **shape.get(name, {}))
    assert grounding.runs.Run("marks", 0).names == ("pop_ups", "subtitle", "resolution")
    assert grounding.runs.Run(None, 0).names == ()
    runs = grounding.runs.all_runs(["subtitle", "marks"], 2)
    assert len(runs) == len(set(runs)) == 6
    assert {run.seed for run in runs if run.held_out is None} == {0, 1}


# The network


def test_cells_boxes_and_clicks_agree(grounding):
    model = grounding.model
    boxes = torch.tensor([[16.0, 8.0, 40.0, 24.0], [3.9, 3.9, 4.1, 4.1], [0.0, 0.0, 3.0, 3.0]])
    right = model.inside(boxes, (5, 8))
    assert right[0].nonzero().tolist() == [[1, 2], [1, 3], [1, 4], [2, 2], [2, 3], [2, 4]]
    assert right[1].nonzero().tolist() == [[0, 0]]
    assert not right[2].any()
    scores = torch.zeros(2, 5, 8)
    scores[0, 2, 3], scores[1, 4, 7] = 5, 1
    assert model.clicks(scores).tolist() == [[28.0, 20.0], [60.0, 36.0]]


def test_the_loss_is_the_probability_of_the_right_cells(grounding):
    scores = torch.tensor([[[0.0, 0.0], [0.0, 0.0]]]).log_softmax(-1)
    right = torch.tensor([[[True, False], [False, True]]])
    assert grounding.model.loss_of(scores, right).item() == pytest.approx(np.log(2))
    sure = torch.tensor([[[50.0, 0.0], [0.0, 0.0]]])
    assert grounding.model.loss_of(sure, right).item() == pytest.approx(0, abs=1e-6)
    assert grounding.model.loss_of(sure, ~right).item() > 40


def test_labels_are_bags_of_letters(grounding):
    letters = grounding.model.letters
    assert letters("Save") == letters("save") != letters("Send")
    assert sorted(letters("save file")) == sorted(letters("file save"))
    assert letters("") == [0]
    assert all(0 <= run < grounding.model.BUCKETS for run in letters("Ünïcode, 100 %"))


def test_scores_belong_to_their_label_and_picture(grounding):
    torch.manual_seed(0)
    net = grounding.model.Grounder().eval()
    assert 200_000 < sum(p.numel() for p in net.parameters()) < 500_000
    pictures = torch.randint(0, 256, (2, 3, 64, 96), dtype=torch.uint8)
    outputs = net(pictures, ["one", "two", "one"], torch.tensor([0, 0, 1]))
    assert outputs.shape == (3, 8, 12)
    assert torch.allclose(outputs[2], net(pictures[1:], ["one"], torch.tensor([0]))[0], atol=1e-4)
    assert not torch.allclose(outputs[0], outputs[1], atol=1e-3)
    assert not torch.allclose(outputs[0], outputs[2], atol=1e-3)
    assert net(pictures, [], torch.zeros(0, dtype=torch.int64)).shape == (0, 8, 12)


def test_it_learns(grounding, toys):
    settings = grounding.train.Settings(steps=80, batch=4)
    train = [page for page in toys if page.split == "train"]
    new = [page for page in toys if page.split == "new"]
    net, losses = grounding.train.train(train, [], 0, settings)
    assert np.mean(losses[-10:]) < 0.5 * np.mean(losses[:10])
    requests, hit = grounding.train.evaluate(net, new, None).sum(0)
    assert requests == 32
    assert hit >= 24, "a random click on a field hits 8"
    again, same = grounding.train.train(train, [], 0, dataclasses.replace(settings, steps=3))
    assert same[0] == losses[0], "first weights and first batch are the seed's"
    assert not again.training


class Oracle(torch.nn.Module):
    """Knows where the fields are, and clicks `shift` pixels beside their middle."""

    def __init__(self, page, shift):
        super().__init__()
        self.page, self.shift = page, shift

    def forward(self, pictures, labels, of):
        scores = torch.zeros(len(labels), pictures.shape[2] // 8, pictures.shape[3] // 8)
        for n, label in enumerate(labels):
            x1, y1, x2, y2 = self.page.boxes[self.page.labels.index(label)] / 2
            scores[n, int((y1 + y2) / 2) // 8, int((x1 + x2) / 2 + self.shift) // 8] = 1
        return scores


def test_evaluation_counts_hits(grounding, toys):
    for shift, hits in ((0, 4), (-8, 4), (8, 0), (16, 0)):
        oracle = Oracle(toys[0], shift)
        assert grounding.train.evaluate(oracle, [toys[0]], None).tolist() == [[4, hits]], shift


# Figures


def test_intervals_hold_what_they_say(grounding):
    accuracy = grounding.score.accuracy
    rng = np.random.default_rng(0)
    hits = rng.binomial(10, 0.7, (5, 80))
    counts = np.stack([np.full_like(hits, 10), hits], -1)
    value, low, high = accuracy(counts)
    assert value == pytest.approx(hits.sum() / 4000)
    assert low < value < high
    assert 0.02 < high - low < 0.12
    assert str(grounding.score.Interval(0.5, 0.4, 0.625)) == "50.0% (40.0% to 62.5%)"
    assert accuracy(counts, counts) == (0, 0, 0)
    better = counts.copy()
    better[..., 1] = np.minimum(better[..., 1] + 1, 10)
    gain = accuracy(better, counts)
    assert 0 < gain.low <= gain.value <= gain.high <= 0.1
    paired, alone = gain.high - gain.low, high - low
    assert paired < alone / 2, "what both have in common cancels"


def test_pages_that_hang_together_widen_the_interval(grounding):
    hits = np.repeat(np.random.default_rng(1).integers(0, 2, (1, 40)) * 10, 5, axis=0)
    apart = np.stack([np.full_like(hits, 10), np.full_like(hits, 5)], -1)
    together = np.stack([np.full_like(hits, 10), hits], -1)
    apart, together = grounding.score.accuracy(apart), grounding.score.accuracy(together)
    assert apart.high - apart.low == pytest.approx(0)
    assert together.high - together.low > 0.2


def test_runs_are_kept_and_told_apart(grounding, toys, tmp_path, monkeypatch, capfd):
    """Two seeds without and with augmentation, end to end on toys; a second call computes
    nothing."""
    (tmp_path / "pages.json").write_text(json.dumps({"made_by": "toys"}))
    big = [dataclasses.replace(p, image=np.tile(p.image, (5, 5, 1))[:600, :960]) for p in toys[:3]]
    page_batch = [
        dataclasses.replace(p, split=split)
        for p, split in zip(big, ("train", "new", "site"), strict=True)
    ]
    monkeypatch.setattr(grounding.pages, "load", lambda folder: page_batch)
    settings = grounding.train.Settings(steps=2, batch=1)
    runs = grounding.runs.all_runs(["subtitle"], 2)
    results = grounding.runs.perform(tmp_path, runs, settings, jobs=1)
    assert set(results) == set(runs)
    for split in ("new", "site"):
        counts = grounding.runs.counts(results, "subtitle", split, "clean")
        assert counts.shape == (2, 1, 2)
        assert (counts[..., 0] == 4).all()
    monkeypatch.setattr(grounding.pages, "load", lambda folder: pytest.fail("nothing is missing"))
    assert grounding.runs.perform(tmp_path, runs, settings, jobs=1) == results
    assert len(list(tmp_path.rglob("*.tmp"))) == 0
    assert capfd.readouterr().err.count("loss") == 4
    second = dataclasses.replace(settings, steps=3)
    assert grounding.runs.fingerprint(tmp_path, second) != grounding.runs.fingerprint(
        tmp_path, settings
    )
    report = importlib.import_module("proof").report(results, ["subtitle"], settings, page_batch)
    assert "**subtitle is never trained with**" in report[2]
    assert report[2].count("\n| ") == 2 + 10, (
        "five conditions on two kinds of pages, below a heading"
    )
