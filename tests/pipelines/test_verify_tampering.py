"""Whoever changes a dataset and makes the manifest fit again is found out.

What a dataset says of its recordings alone (a task, an action of a whole step) is found by its
source.
"""

import json
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from PIL import Image

import hijack_data as hj
from hijack_data.cli import hijack
from pipelines import build, verify
from pipelines.errors import SourceError

from support.events import with_apps
from support.tampering import renew

Rows = list[dict[str, Any]]
SHARD = "data/train-00000.parquet"


@dataclass(frozen=True)
class Built:
    """A source, a materialised and a lazy dataset of it, and the rows that another seed gives."""

    source: Path
    materialised: Path
    lazy: Path
    others: Rows

    def copy(self, kind: str, to: Path) -> Path:
        return shutil.copytree(getattr(self, kind), to / "out")


@pytest.fixture(scope="module")
def built(assets: Path, tmp_path_factory: pytest.TempPathFactory, pictures: Any) -> Built:
    folder = tmp_path_factory.mktemp("built")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AGENTHIJACK_ASSETS", str(assets))
        source = with_apps(pictures(folder / "source"), ["chrome"])
        planners = {
            "marks": hj.Marks(number=4, mark_size=8),
            "half": hj.Resolution(scale=0.5),
            "covers": hj.PopUps(width=120, height=60),
            "touch": hj.AccidentalTouch(step=1),
            "locked": hj.Verification(step=2),
        }
        for name, seed, output in (
            ("one", 0, "materialised"),
            ("lazy", 0, "lazy"),
            ("two", 1, "materialised"),
        ):
            build(source, folder / name, corruptions=planners, seed=seed, output=output)
        remaining = pq.read_table(folder / "two" / SHARD).to_pylist()
    return Built(source, folder / "one", folder / "lazy", remaining)


@pytest.fixture(autouse=True)
def pack(assets: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AGENTHIJACK_ASSETS", str(assets))


def tamper(dataset: Path, change: Callable[[Rows], object]) -> None:
    """Change rows, and let the manifest say that they are so: hashes, sizes, and every count of
    rows."""
    table = pq.read_table(dataset / SHARD)
    rows = table.to_pylist()
    change(rows)
    pq.write_table(type(table).from_pylist(rows, schema=table.schema), dataset / SHARD)
    counts = dict(Counter(row["corruption"] for row in rows))

    def recount(manifest: dict[str, Any]) -> None:
        (shard,) = manifest["shards"]
        shard["rows"] = manifest["rows"] = len(rows)
        shard["counts"]["rows"] = counts
        manifest["counts"]["rows"] = {
            label: counts.get(label, 0) for label in manifest["counts"]["rows"]
        }

    renew(dataset, recount)


def at(rows: Rows, name: str) -> dict[str, Any]:
    return next(row for row in rows if row["id"] == name)


def sets(name: str, **values: Any) -> Callable[[Rows], object]:
    return lambda rows: at(rows, name).update(values)


def update_all(**values: Any) -> Callable[[Rows], object]:
    """Change all rows of the first trajectory alike."""
    return lambda rows: [row.update(values) for row in rows if row["trajectory_id"] == "t0"]


def swapped(one: str, two: str) -> Callable[[Rows], object]:
    def change(rows: Rows) -> None:
        i, j = (rows.index(at(rows, name)) for name in (one, two))
        rows[i], rows[j] = rows[j], rows[i]

    return change


def steps_swapped(rows: Rows) -> None:
    rows.sort(
        key=lambda row: (
            {0: 1, 1: 0}.get(row["step"], row["step"]) if row["trajectory_id"] == "t0" else 9
        )
    )


def without(name: str) -> Callable[[Rows], object]:
    return lambda rows: rows.remove(at(rows, name))


def twice(rows: Rows) -> None:
    rows.insert(rows.index(at(rows, MARKS)), dict(at(rows, MARKS)))


def acted(name: str, **values: Any) -> Callable[[Rows], object]:
    return lambda rows: at(rows, name)["action"].update(values)


def moved_step(rows: Rows) -> None:
    """The clean row and all that was made of it, so that they agree with each other."""
    for row in rows:
        if row["trajectory_id"] == "t0" and row["step"] == 0:
            shift = 1 if row["corruption"] == "half" else 2
            row["action"]["x"] += shift
            row["action_code"] = f"pyautogui.click({row['action']['x']}, {row['action']['y']})"


MARKS, HALF, COVERS = "t0/0000/marks", "t0/0000/half", "t0/0000/covers"
CLEAN, TOUCH, LOCKED = "t0/0000/clean", "t0/0001/touch+touch", "t0/0002/locked"

CAUGHT: dict[str, tuple[Callable[[Rows], object], str]] = {
    "rows swapped within a step": (swapped(MARKS, HALF), "another order"),
    "rows swapped between steps": (swapped(MARKS, "t0/0001/marks"), "t0"),
    "steps swapped": (steps_swapped, "stands after step"),
    "a row twice": (twice, "its id stands at 2 rows"),
    "a clean row deleted": (without(CLEAN), "has no clean row"),
    "a corrupted row deleted": (without(MARKS), f"row {MARKS}: is missing"),
    "a row that avoids elements deleted": (without(COVERS), "covers: "),
    "instruction of one row": (sets(MARKS, instruction="do evil"), "instruction is 'do evil'"),
    "instruction of the clean row": (sets(CLEAN, instruction="do evil"), "'do evil'"),
    "domain": (sets(MARKS, domain="games"), "domain is 'games'"),
    "source": (sets(MARKS, source="osworld"), "source is 'osworld'"),
    "trajectory_id": (sets(MARKS, trajectory_id="t7"), f"row {MARKS}: "),
    "step": (sets(MARKS, step=7), "7"),
    "id": (sets(MARKS, id="t0/0000/other"), f"id is 't0/0000/other', it should be '{MARKS}'"),
    "label": (sets(MARKS, corruption="half"), "row t0/0000/marks"),
    "label that is none": (sets(MARKS, corruption="spots"), "corruption is 'spots'"),
    "severity": (sets(MARKS, severity=5), "severity is 5, it should be None"),
    "seed": (sets(MARKS, seed=9), f"row {MARKS}: "),
    "action": (acted(MARKS, x=7), "action is {'type': 'click', 'x': 7"),
    "action of another size": (acted(HALF, x=100), "action is"),
    "action type": (acted(COVERS, type="right_click"), "'right_click'"),
    "action_code": (
        sets(HALF, action_code="pyautogui.click(1, 2)"),
        "it should be 'pyautogui.click(50, 25)'",
    ),
    "target_box": (sets(MARKS, target_box=[0, 0, 5, 5]), "it should be [90, 40, 130, 60]"),
    "target_box gone": (sets(HALF, target_box=None), "it should be [45, 20, 65, 30]"),
    "target_visible": (sets(COVERS, target_visible=0.5), "target_visible is 0.5"),
    "changed_pixels": (sets(COVERS, changed_pixels=3), "changed_pixels is 3"),
    "reminder": (sets(LOCKED, reminder="go on"), "reminder is 'go on'"),
    "reminder gone": (sets(LOCKED, reminder=None), "reminder is None"),
    "event": (sets(LOCKED, event="It rained."), "event is 'It rained.'"),
    "recovery action": (acted(TOUCH, type="wait"), "'wait'"),
    "recovery box": (sets(TOUCH, target_box=[0, 0, 9, 9]), "target_box is [0, 0, 9, 9]"),
    "answer to an event": (acted(LOCKED, type="click", x=3, y=3), "it should be {'type': 'wait'"),
    "fidelity": (sets(LOCKED, fidelity="exact"), "contradict"),
    "inserted": (sets(TOUCH, inserted=False), "inserted is False"),
    "a null": (sets(MARKS, action=None), "row t0/0000/marks: "),
}


@pytest.mark.parametrize("kind", ["materialised", "lazy"])
@pytest.mark.parametrize("name", CAUGHT)
def test_a_row_that_was_changed(name: str, kind: str, built: Built, tmp_path: Path) -> None:
    change, words = CAUGHT[name]
    out = built.copy(kind, tmp_path)
    tamper(out, change)
    problems = verify(out).problems
    assert problems, name
    assert any(words in problem for problem in problems), problems


def replaced(built: Built, name: str) -> Callable[[Rows], object]:
    """Put the row of another seed in the place of one: sound by itself, but for the column
    `seed`."""
    return lambda rows: at(rows, name).update({**at(built.others, name), "seed": 0})


def test_a_plan_of_another_seed(built: Built, tmp_path: Path) -> None:
    out = built.copy("materialised", tmp_path)
    tamper(out, replaced(built, MARKS))
    (problem,) = verify(out).problems
    assert f"row {MARKS}: " in problem
    assert "another picture" in problem or "seed 0 and the parameters" in problem


SOURCED: dict[str, Callable[[Rows], object]] = {
    "instruction of a trajectory": update_all(instruction="do evil"),
    "domain of a trajectory": update_all(domain="games"),
    "action of a whole step": moved_step,
    "a trajectory left out": lambda rows: rows.__delitem__(
        slice(0, sum(r["trajectory_id"] == "t0" for r in rows))
    ),
    "an event left out": without(TOUCH),
}


@pytest.mark.parametrize("name", SOURCED)
def test_what_only_the_source_knows(name: str, built: Built, tmp_path: Path) -> None:
    out = built.copy("materialised", tmp_path)
    assert verify(out, source=built.source).problems == []
    tamper(out, SOURCED[name])
    assert verify(out, source=built.source).problems


def test_a_plan_that_avoids_elements_is_made_again_from_the_source(
    built: Built, tmp_path: Path
) -> None:
    out = built.copy("materialised", tmp_path)
    note = "the pictures of covers, touch, locked were drawn again from their stored plans; that"
    assert any(note in text for text in verify(out).unproved)
    tamper(out, replaced(built, COVERS))
    problems = verify(out, source=built.source).problems
    assert any(f"row {COVERS}: " in problem for problem in problems)
    assert verify(out, source=built.source).unproved == []


@pytest.mark.parametrize("file", ["README.md", "config.yaml", "quarantine.jsonl"])
def test_a_file_beside_the_rows(file: str, built: Built, tmp_path: Path) -> None:
    out = built.copy("lazy", tmp_path)
    with (out / file).open("a") as text:
        text.write("\n")
    assert any(p.startswith(f"{file}: its SHA-256 is") for p in verify(out).problems)
    (out / file).unlink()
    assert f"{file}: missing" in verify(out).problems


EDITED: dict[str, Callable[[dict[str, Any]], object]] = {
    "seed": lambda m: m["parameters"].update(seed=3),
    "label_policy": lambda m: m["parameters"].update(label_policy="drop"),
    "fingerprint": lambda m: m["source"].update(fingerprint="0" * 64),
    "trajectories": lambda m: m["source"].update(trajectories=7),
    "rows": lambda m: m.update(rows=7),
    "counts": lambda m: m["counts"]["rows"].update(marks=7),
    "rejected": lambda m: m["counts"].update(rejected={"image": 1}),
    "config": lambda m: m.update(config="corruptions: [marks]\n"),
    "steps": lambda m: m["shards"][0].update(steps=9),
    "dropped": lambda m: m["shards"][0]["counts"].update(dropped={"marks": 1}),
}


@pytest.mark.parametrize("name", EDITED)
@pytest.mark.parametrize("fits", [True, False])
def test_a_manifest_that_was_edited(name: str, fits: bool, built: Built, tmp_path: Path) -> None:
    """With a new digest it is found by what it is derived from, without one by the digest."""
    out = built.copy("lazy", tmp_path)
    if fits:
        renew(out, EDITED[name])
    else:
        manifest = json.loads((out / "manifest.json").read_text())
        EDITED[name](manifest)
        (out / "manifest.json").write_text(json.dumps(manifest))
    problems = verify(out).problems
    assert problems
    assert fits or any("digest is not that of what it says" in problem for problem in problems)


@pytest.mark.parametrize(
    "name", ["more.parquet", "old/train-00000.parquet", "data/notes.txt", "rows.csv", "a/b.jsonl"]
)
def test_files_that_a_loader_may_take_for_rows(name: str, built: Built, tmp_path: Path) -> None:
    out = built.copy("lazy", tmp_path)
    (out / name).parent.mkdir(exist_ok=True)
    shutil.copy(out / SHARD, out / name)
    assert any(
        problem.startswith(f"{name}: not in the manifest") for problem in verify(out).problems
    )


@pytest.mark.parametrize(
    "name", ["LICENSE", "notes.md", "stats.html", ".gitattributes", ".cache/huggingface/x.json"]
)
def test_files_that_no_loader_takes_for_rows(name: str, built: Built, tmp_path: Path) -> None:
    out = built.copy("lazy", tmp_path)
    (out / name).parent.mkdir(parents=True, exist_ok=True)
    (out / name).write_text("text")
    assert verify(out).problems == []


def test_a_source_that_changed(built: Built, tmp_path: Path) -> None:
    source = shutil.copytree(built.source, tmp_path / "source")
    image = source / "images" / "t0-1.png"
    with Image.open(image) as picture:
        picture.transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(image)
    problems = verify(built.materialised, source=source).problems
    assert any("row t0/0001/clean" in problem for problem in problems)
    assert not any("t0/0000" in problem for problem in problems)


def test_the_command(built: Built, tmp_path: Path) -> None:
    arguments = ["verify", str(built.lazy), "--source"]
    assert CliRunner().invoke(hijack, [*arguments, str(built.source)]).exit_code == 0
    with pytest.raises(SourceError, match="no such file or folder"):
        verify(built.lazy, source=tmp_path / "none")
