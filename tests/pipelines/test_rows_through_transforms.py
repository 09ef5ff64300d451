"""Rows of our own datasets through our own transforms: every column says what a build would say."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hijack_data as hj
from hijack_data.actions.recorded_actions import SCREENAGENT, SIZELESS
from hijack_data.coords import CoordMap
from hijack_data.errors import LabelError
from hijack_data.labels import Move
from hijack_data.labels.dataset_rows import detect_dialect, map_action_code
from hijack_data.plan import Plan
from hijack_data.types import Action
from pipelines import build, open_dataset
from pipelines.readers.recorded_actions import RecordedStep, observed_code

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")
import hijack_data.transforms as tr  # noqa: E402
from pipelines.loaders.torch import TorchDataset, collate  # noqa: E402

SEED = 5
PLANNERS: dict[str, Any] = {
    "resolution": hj.Resolution(scale=0.5),
    "marks": hj.Marks(number=90, mark_size=9),
    "both": hj.Sequence([hj.Resolution(scale=0.75), hj.Marks(number=9, mark_size=9)]),
}


@pytest.fixture(params=["materialised", "lazy"])
def dataset(request: Any, recording: Any, add_line: Any, good_line: Any, tmp_path: Path) -> Path:
    source = recording(trajectories=2, steps=2)
    drag = {"type": "drag", "x": 21, "y": 41, "x2": 299, "y2": 181, "keys": ["shift"], "amount": 2}
    code = "pyautogui.moveTo(21, 41)\npyautogui.dragTo(x=299, y=181)"
    box = [11, 31, 31, 51]
    for name, change in {
        "drag": {"action": drag, "action_code": code, "target_box": box},
        "wait": {"action": {"type": "wait"}, "action_code": "", "target_box": None},
        "point": {"action": {"type": "click", "x": 33, "y": 77}, "target_box": None},
    }.items():
        add_line(source, good_line(name, 0, image="images/t0-0.png", **change))
    build(source, tmp_path / "out", corruptions=PLANNERS, output=request.param, seed=SEED)
    return tmp_path / "out"


def same(made: Any, built: dict[str, Any]) -> None:
    """Compare every column of a row that a transform made with the one that the build made."""
    # a name that the configuration chose; a transform has the names of the parts
    if built["corruption"] == "both":
        name = "resolution+marks"
        built = {**built, "corruption": name, "id": built["id"].replace("both", name)}
    for key, value in built.items():
        if key == "screenshot":
            picture = (
                made[key].permute(1, 2, 0).numpy()
                if hasattr(made[key], "permute")
                else np.asarray(made[key])
            )
            assert np.array_equal(picture, np.asarray(value))
        else:
            assert made[key] == value, key


def pairs(dataset: Path) -> list[tuple[int, dict[str, Any]]]:
    """The number of each clean row, with each corrupted row of its step."""
    rows = list(open_dataset(dataset))
    numbers = {
        (row["trajectory_id"], row["step"]): i
        for i, row in enumerate(rows)
        if row["corruption"] == "clean"
    }
    return [
        (numbers[row["trajectory_id"], row["step"]], row)
        for row in rows
        if row["corruption"] != "clean"
    ]


def test_torch_rows_equal_the_rows_of_a_build(dataset: Path) -> None:
    data, result = TorchDataset(dataset), pairs(dataset)
    assert len(result) == 7 * 3
    for number, row in result:
        value = tr.Replay(row["plan"])(data[number])
        same(value, row)
        assert value["boxes"].tolist() == ([row["target_box"]] if row["target_box"] else [])
        if row["corruption"] == "resolution":
            same(tr.Resolution(scale=0.5, seed=SEED)(data[number]), row)


def test_rows_of_pictures_and_batches_do_so_too(dataset: Path) -> None:
    rows, result = open_dataset(dataset), pairs(dataset)
    for number, row in result:
        same(tr.Replay(row["plan"])(rows[number]), row)
    halves = [(number, row) for number, row in result if row["corruption"] == "resolution"]
    data = TorchDataset(dataset)
    batch = tr.Resolution(scale=0.5, seed=SEED)(collate([data[number] for number, _ in halves]))
    for i, (_, row) in enumerate(halves):
        same({key: batch[key][i] for key in row}, row)


def test_the_plan_of_a_row_that_is_corrupted_again_is_the_whole(dataset: Path) -> None:
    for row in open_dataset(dataset):
        for form in (True, "json"):
            made = tr.Marks(seed=SEED, number=60, return_plan=form)(row)
            plan = made["plan"] if form is True else Plan.from_json(made["plan"])
            assert plan.digest() == made["plan_digest"]
            assert plan.size == Plan.from_json(row["plan"]).size
            if row["target_visible"] is not None and plan.out_size == plan.size:
                assert made["target_visible"] <= row["target_visible"]


def test_grain_rows_do_so_too(dataset: Path) -> None:
    hg = pytest.importorskip("hijack_data.grain")
    from pipelines.loaders.grain import GrainSource

    source = GrainSource(dataset)
    for number, row in pairs(dataset):
        if row["corruption"] == "resolution":
            same(hg.Corrupt(hj.Resolution(scale=0.5), seed=SEED).map(source[number]), row)


def test_rows_of_datasets_do_so_too(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    datasets = pytest.importorskip("datasets")
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    dataset_rows = datasets.load_dataset(
        str(dataset), split="train", cache_dir=str(tmp_path / "cache")
    )
    half = tr.Resolution(scale=0.5, seed=SEED)
    half.set_epoch(0)
    if "base_screenshot" in dataset_rows.features:
        with pytest.raises(LabelError, match=r"lazy row.*pipelines\.render"):
            dataset_rows.with_transform(half)[0]
        return
    for number, row in pairs(dataset):
        if row["corruption"] == "resolution":
            same(dataset_rows.with_transform(half)[number], row)
            mapped = dataset_rows.select([number]).map(half)[0]
            same(mapped, {**row, "screenshot": mapped["screenshot"]})


def test_a_row_that_is_corrupted_already_says_both(dataset: Path) -> None:
    data = TorchDataset(dataset)
    clean = {
        row["trajectory_id"]: row for row in open_dataset(dataset) if row["corruption"] == "clean"
    }
    for row in (data[i] for i in range(len(data))):
        if row["corruption"] != "marks" or row["target_box"] is None:
            continue
        out = tr.Resolution(scale=0.5, seed=9)(row)
        plan = Plan.from_json(out["plan"])
        assert out["corruption"] == "marks+resolution"
        assert out["id"] == f"{row['trajectory_id']}/{row['step']:04d}/marks+resolution"
        assert plan.digest() == out["plan_digest"]
        assert (out["seed"], out["severity"]) == (9, None)
        end = row["action"]["x2"], row["action"]["y2"]
        box = clean[row["trajectory_id"]]["target_box"]
        calls = hj.judge(
            plan,
            data[0]["screenshot"],
            out["screenshot"],
            target=box,
            end=None if None in end else end,
        )
        assert out["target_visible"] == calls.target_visible
        assert out["changed_pixels"] == out["screenshot"][0].numel()
        more = tr.Marks(seed=9, number=3)(row)
        assert more["changed_pixels"] is None  # the clean screenshot is not at hand
        assert more["plan"] != row["plan"]


def test_a_clean_plan_changes_nothing(dataset: Path) -> None:
    row = TorchDataset(dataset)[0]
    out = tr.OneOf([hj.Resolution()], p_clean=1)(row)
    assert {key: out[key] for key in row if key not in ("screenshot", "boxes")} == {
        key: row[key] for key in row if key not in ("screenshot", "boxes")
    }


def test_a_row_without_some_columns_keeps_the_others_true(dataset: Path) -> None:
    number, built_row = next(
        (n, row) for n, row in pairs(dataset) if row["corruption"] == "resolution"
    )
    row = TorchDataset(dataset)[number]
    few = {
        key: row[key]
        for key in ("id", "screenshot", "action", "target_box", "action_code", "width")
    }
    out = tr.Resolution(scale=0.5, seed=SEED)(few)
    assert {key: out[key] for key in few if key != "screenshot"} == {
        key: built_row[key] if key != "id" else row["id"] for key in few if key != "screenshot"
    }
    no_plan = {key: value for key, value in row.items() if key != "plan"}
    corrupted = {**no_plan, "corruption": "marks"}
    with pytest.raises(LabelError, match="no column 'plan'"):
        tr.Resolution(scale=0.5)(corrupted)


def test_avoid_protects_the_target_of_a_row(dataset: Path) -> None:
    data = TorchDataset(dataset)
    avoid = tr.Marks(seed=1, number=60, label_policy="avoid", return_plan=True)
    keep = tr.Marks(seed=1, number=60, return_plan=True)
    hidden = 0
    for i in range(len(data)):
        row = data[i]
        if row["target_box"] is None or row["corruption"] != "clean":
            continue
        assert avoid(row)["target_visible"] == 1
        hidden += keep(row)["target_visible"] < 1
    assert hidden


SIZE, SMALL = (1080, 1920), (540, 960)
CLICK, DRAG = Action("click", 961, 541), Action("drag", 100, 200, 300, 400)


@pytest.mark.parametrize(
    ("code", "dialect", "action"),
    [
        ("pyautogui.click(961, 541)", "pyautogui", CLICK),
        ("import pyautogui as p\np.click(961, 541)", "pyautogui", CLICK),
        ("WAIT", SIZELESS, Action("wait")),
        ("", SIZELESS, CLICK),
        ("Click [5]", SIZELESS, CLICK),
        ("Thought: a\nAction: click(start_box='(500,501)')", "ui_tars", Action("click", 960, 541)),
        ("Action: click(start_box='(967,547)')", "ui_tars_1.5", CLICK),
        ("Action: type(content='(1, 2)')", "ui_tars_1.5", Action("type", text="(1, 2)")),
        ('{"type": "click", "x": 961, "y": 541, "button": "left"}', "openai", CLICK),
        ('{"type": "drag", "path": [{"x": 100, "y": 200}, {"x": 300, "y": 400}]}', "openai", DRAG),
        ('{"action": "left_click", "coordinate": [961, 541]}', "anthropic", CLICK),
        ('{"action_type": "CLICK", "parameters": {"x": 961, "y": 541}}', "computer_13", CLICK),
        (
            '[{"mouse_action_type": "click", "mouse_position": {"width": 961, "height": 541}}]',
            SCREENAGENT,
            CLICK,
        ),
        (
            '[{"function": {"name": "click", "arguments": {"coordinate": [500, 501]}}}]',
            SIZELESS,
            Action("click", 960, 541),
        ),
    ],
)
def test_the_dialect_of_a_row_is_told_by_what_it_says(
    code: str, dialect: str, action: Action
) -> None:
    result = detect_dialect(code, action, SIZE)
    assert result == dialect or (result, dialect) == (SIZELESS, "ui_tars")
    step = RecordedStep(0, "", action, code, dialect=dialect)
    assert map_action_code(code, action, Move(SIZE, SMALL)) == observed_code(
        CoordMap(SMALL, SIZE), step
    )


def test_text_that_means_the_action_in_two_spaces_is_an_error_where_it_would_change() -> None:
    """On such a picture, thousandths and pixels of the smart-resized one are nearly the same."""
    square, half = (1000, 1000), (500, 500)
    code = "click(start_box='(37,0)')"
    with pytest.raises(LabelError, match="nothing says in which dialect"):
        map_action_code(code, Action("click", 37, 0), Move(square, half))
    corner = "click(start_box='(0,0)')"
    assert map_action_code(corner, Action("click", 0, 0), Move(square, half)) == corner


def test_a_dialect_that_cannot_be_told_is_an_error() -> None:
    for code in (
        "click(961, 541)",
        "Action: click(start_box='(1,2)')",
        '{"do": "click", "at": [961, 541]}',
    ):
        with pytest.raises(LabelError, match="nothing says in which dialect; declare it"):
            map_action_code(code, CLICK, Move(SIZE, SMALL))
