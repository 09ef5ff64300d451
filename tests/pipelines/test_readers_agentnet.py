import copy
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from hijack_data.types import Action
from pipelines.readers import detect_format, get_reader

from support.recordings import read_source

read = partial(read_source, name="agentnet")


RAW = {
    "task_id": "raw",
    "instruction": "raise the volume",
    "traj": [
        {"index": 0, "image": "a.png", "value": {"code": "pyautogui.click(x=0.5, y=0.25)"}},
        {"index": 1, "image": "a.png", "value": {"code": "computer.terminate(status='success')"}},
    ],
}
BENCH = {
    "task_id": "bench",
    "high_level_task_description": "raise the volume",
    "user_task_description": "louder",
    "meta_info": {"domain": "Daily", "applications": ["vlc"]},
    "steps": [
        {
            "step_num": 3,
            "image": "a.png",
            "action": "pyautogui.click(x=0.5, y=0.25)",
            "ground_truth_actions": [
                {"type": "scroll", "metadata": {"bboxes": []}},
                {
                    "type": "click",
                    "metadata": {
                        "bboxes": [
                            {"rel_bbox": [0.1, 0.1, 0, 0]},
                            {"rel_bbox": [0.4, 0.2, 0.2, 0.1]},
                        ]
                    },
                },
            ],
        },
        {
            "step_num": 4,
            "image": "a.png",
            "action": "computer.wait()",
            "ground_truth_actions": [{"metadata": {}}],
        },
    ],
}


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder = tmp_path / "source"
    (folder / "images").mkdir(parents=True)
    Image.new("RGB", (200, 100)).save(folder / "images" / "a.png")
    return folder


def test_fractions_become_pixels_of_the_screenshot(source: Path) -> None:
    (source / "raw.jsonl").write_text(json.dumps(RAW))
    (source / "bench.json").write_text(json.dumps(BENCH))
    trajectories, rejected = read(source)
    assert not rejected
    bench, raw = trajectories
    assert (raw.id, raw.source, raw.instruction) == ("raw", "agentnet", "raise the volume")
    assert raw.steps[0].action == Action("click", x=100, y=25)
    assert raw.steps[0].action_code == "pyautogui.click(x=100, y=25)"
    assert raw.steps[1].action.type == "done"
    assert (bench.instruction, bench.domain, bench.apps) == ("raise the volume", "Daily", ("vlc",))
    assert [s.index for s in bench.steps] == [3, 4]
    assert bench.steps[0].action == Action("click", x=100, y=25)
    assert [s.target_box for s in bench.steps] == [(80, 20, 120, 30), None]


def test_screenshots_may_lie_beside_the_file(source: Path) -> None:
    (source / "images" / "a.png").rename(source / "a.png")
    (source / "images").rmdir()
    (source / "raw.jsonl").write_text(json.dumps(RAW))
    assert read(source / "raw.jsonl") == read(source)
    assert not read(source)[1]


def test_a_task_with_the_annotators_description_only(source: Path) -> None:
    bench = {key: value for key, value in BENCH.items() if key != "high_level_task_description"}
    (source / "bench.json").write_text(json.dumps(bench))
    assert read(source)[0][0].instruction == "louder"


def change(record: dict[str, Any], path: str, value: object) -> dict[str, Any]:
    """Return a copy with the value at `path` (`traj.0.image`) replaced; `None` removes it."""
    changed_record = copy.deepcopy(record)
    *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    node: Any = changed_record
    for key in parents:
        node = node[key]
    node[last] = value
    return changed_record


@pytest.mark.parametrize(
    ("record", "path", "value", "field", "reason"),
    [
        (RAW, "task_id", None, "task_id", "missing"),
        (RAW, "instruction", ["a"], "instruction", "string"),
        (RAW, "traj", {}, "traj", "list"),
        (RAW, "traj", [], "traj", "empty"),
        (BENCH, "steps", "none", "steps", "list"),
        (BENCH, "meta_info", {"domain": 3}, "meta_info.domain", "string"),
    ],
)
def test_a_bad_trajectory_is_rejected_whole(
    record: dict[str, Any], path: str, value: object, field: str, reason: str, source: Path
) -> None:
    bad = change(record, path, value)
    (source / "bad.json").write_text(json.dumps(bad))
    (source / "good.jsonl").write_text(json.dumps({**RAW, "task_id": "good"}))
    trajectories, rejected = read(source)
    assert [t.id for t in trajectories] == ["good"]
    assert [(r.file, r.field) for r in rejected] == [("bad.json", field)]
    assert reason in rejected[0].reason


@pytest.mark.parametrize(
    ("record", "path", "value", "field", "reason"),
    [
        (RAW, "traj.0", 5, "", "object"),
        (RAW, "traj.0.index", None, "index", "missing"),
        (RAW, "traj.0.index", 1, "index", "was there before"),
        (RAW, "traj.0.image", "b.png", "image", "not in the source folder"),
        (RAW, "traj.0.image", "../../b.png", "image", "leaves the source"),
        (RAW, "traj.0.image", "/etc/passwd", "image", "absolute"),
        (RAW, "traj.0.value", None, "value", "object"),
        (RAW, "traj.0.value.code", None, "value.code", "missing"),
        (RAW, "traj.0.value.code", "click(", "value.code", "line 1"),
        (RAW, "traj.0.value.code", "pyautogui.click(x=640, y=480)", "value.code", "outside"),
        (RAW, "traj.0.value.code", "pyautogui.click(x=-0.2, y=0.5)", "value.code", "negative"),
        (
            RAW,
            "traj.0.value.code",
            "pyautogui.click(x=1e999, y=0.5)",
            "value.code",
            "a number beyond",
        ),
        (RAW, "traj.0.value.code", "pyautogui.click(x=float('nan'), y=0.5)", "value.code", ""),
        (RAW, "traj.0.value.code", "pyautogui.click(" + "(" * 5000, "value.code", ""),
        (BENCH, "steps.0.step_num", -1, "step_num", "integer"),
        (BENCH, "steps.0.action", 3, "action", "string"),
        (BENCH, "steps.0.ground_truth_actions", [4], "ground_truth_actions[0]", "object"),
        (
            BENCH,
            "steps.0.ground_truth_actions.1.metadata.bboxes",
            [{"rel_bbox": [0.4, 0.2, float("nan"), 0.1]}],
            "ground_truth_actions[1].metadata",
            "rel_bbox",
        ),
        (
            BENCH,
            "steps.0.ground_truth_actions.1.metadata.bboxes",
            [{"rel_bbox": [40, 20, 20, 10]}],
            "ground_truth_actions[1].metadata",
            "leaves the screen",
        ),
    ],
)
def test_a_bad_step_is_rejected_and_the_others_stay(
    record: dict[str, Any], path: str, value: object, field: str, reason: str, source: Path
) -> None:
    (source / "some.json").write_text(json.dumps(change(record, path, value)))
    (source.parent / "b.png").write_bytes((source / "images" / "a.png").read_bytes())
    trajectories, rejected = read(source)
    assert [len(t.steps) for t in trajectories] == [1]
    assert [(r.file, r.field) for r in rejected] == [("some.json", field)]
    assert record["task_id"] in rejected[0].where
    assert reason in rejected[0].reason


def test_a_task_id_that_appears_twice(source: Path) -> None:
    (source / "a.jsonl").write_text(json.dumps(RAW) + "\n" + json.dumps(RAW))
    (source / "b.json").write_text(json.dumps({**BENCH, "task_id": "raw"}))
    trajectories, rejected = read(source)
    assert [t.id for t in trajectories] == ["raw"]
    assert [(r.file, r.where, r.field) for r in rejected] == [
        ("a.jsonl", "line 2", "task_id"),
        ("b.json", "", "task_id"),
    ]


def test_a_key_twice_does_not_hide_the_format_of_a_file(source: Path) -> None:
    twice = '"instruction": "mute", "instruction": '
    text = json.dumps(RAW).replace('"instruction": ', twice)
    (source / "a.jsonl").write_text(text)
    (source / "b.json").write_text(text)
    assert detect_format(source) == "agentnet"
    trajectories, rejected = read(source)
    assert trajectories == []
    assert [(r.file, r.where, r.field) for r in rejected] == [
        ("a.jsonl", "line 1", "instruction"),
        ("b.json", "", "instruction"),
    ]


def test_files_that_are_not_json(source: Path) -> None:
    (source / "a.json").write_bytes(b"\xff\xfe")
    (source / "b.json").write_bytes(b"")
    (source / "c.jsonl").write_bytes(b"{\n" + json.dumps(RAW).encode() + b"\n\xff\n")
    (source / "d.json").symlink_to("/etc/hostname")
    (source / "e.json").symlink_to("none.json")
    trajectories, rejected = read(source)
    assert len(trajectories) == 1
    assert [(r.file, r.where) for r in rejected] == [
        ("a.json", ""),
        ("b.json", ""),
        ("c.jsonl", "line 1"),
        ("c.jsonl", "line 3"),
        ("d.json", ""),
        ("e.json", ""),
    ]
    assert ["UTF-8" in r.reason for r in rejected] == [True, False, False, True, False, False]


def test_the_real_agentnet_recording(shared_data: Path) -> None:
    trajectories, rejected = read(shared_data / "trajectories" / "agentnet_raw")
    assert not rejected
    (trajectory,) = trajectories
    assert [s.index for s in trajectory.steps] == list(range(15))
    # 0.9722, 0.9701 of 1276x718
    assert trajectory.steps[0].action == Action("click", x=1241, y=697)
    assert trajectory.steps[3].action == Action("drag", x=580, y=193, x2=524, y2=199)
    assert trajectory.steps[5].action == Action("scroll", x=505, y=563, amount=-3)
    assert trajectory.steps[14].action == Action("done")


def test_the_real_agentnetbench_tasks(shared_data: Path) -> None:
    folder = shared_data / "trajectories" / "agentnetbench"
    trajectories, rejected = read(folder)
    assert not rejected
    assert [(t.id, len(t.steps)) for t in trajectories] == [
        ("s_5473959e0f6e21f7", 10),
        ("s_7f27a11115e596eb", 11),
        ("s_a96285eb665bef92", 10),
    ]
    pointed = [s for t in trajectories for s in t.steps if s.action.point]
    assert all(s.target_box for s in pointed)
    for step in pointed:
        (x, y), (x1, y1, x2, y2) = step.action.point, step.target_box  # type: ignore[misc]
        assert x1 <= x < x2, step
        assert y1 <= y < y2, step


def test_boxes_agree_with_the_pixels_that_the_annotators_noted(shared_data: Path) -> None:
    folder = shared_data / "trajectories" / "agentnetbench"
    by_id = {t.id: {s.index: s.target_box for s in t.steps} for t in read(folder)[0]}
    for file in folder.glob("*.json"):
        record = json.loads(file.read_text())
        for step in record["steps"]:
            noted = [
                b for a in step["ground_truth_actions"] for b in a["metadata"].get("bboxes", [])
            ]
            if noted:
                x, y, width, height = noted[0]["abs_bbox"]
                box = by_id[record["task_id"]][step["step_num"]]
                assert box == pytest.approx((x, y, x + width, y + height), abs=1)


@pytest.mark.parametrize("inner", ["", "images", "extracted"])
def test_the_folders_of_the_hub(inner: str, tmp_path: Path) -> None:
    from support.formats import agentnet, png, write_lines

    for name in ("ubuntu", "win_mac"):
        agentnet(tmp_path / name)
        record = json.loads((tmp_path / name / "a.jsonl").read_text())
        for number, entry in enumerate(record["traj"]):
            entry["image"] = f"{name}{number}.png"
            folder = tmp_path / "hub" / f"{name}_images" / inner
            folder.mkdir(parents=True, exist_ok=True)
            (folder / entry["image"]).write_bytes(png(number))
        write_lines(tmp_path / "hub" / f"agentnet_{name}.jsonl", [{**record, "task_id": name}])
    items = list(get_reader("agentnet").read(tmp_path / "hub"))
    assert [item.id for item in items] == ["ubuntu", "win_mac"]
    places = [Path(s.image).relative_to(tmp_path / "hub").parts[0] for t in items for s in t]
    assert places == ["ubuntu_images"] * 2 + ["win_mac_images"] * 2


def test_zip_files_of_the_hub_are_named(tmp_path: Path) -> None:
    from support.formats import agentnet

    agentnet(tmp_path)
    (tmp_path / "images").rename(tmp_path / "elsewhere")
    (tmp_path / "ubuntu_images").mkdir()
    (tmp_path / "ubuntu_images" / "images.z01").write_bytes(b"PK")
    items = list(get_reader("agentnet").read(tmp_path))
    assert {"unpack" in item.reason for item in items} == {True}


def test_a_picture_in_two_folders_is_not_guessed(tmp_path: Path) -> None:
    from support.formats import agentnet, png

    agentnet(tmp_path)
    (tmp_path / "win_mac_images").mkdir()
    (tmp_path / "win_mac_images" / "0.png").write_bytes(png(5))
    rejected, trajectory = list(get_reader("agentnet").read(tmp_path))
    assert "in images and in win_mac_images" in rejected.reason
    assert len(trajectory.steps) == 1
