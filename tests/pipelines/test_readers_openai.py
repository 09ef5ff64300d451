import json
import tracemalloc
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action
from pipelines.readers.recorded_pictures import read_picture

from support.formats import openai, png, url, write_json, write_lines
from support.recordings import read_source

read = partial(read_source, name="openai")


def items(folder: Path) -> list[Any]:
    return [json.loads(line) for line in (openai(folder) / "run.jsonl").read_text().splitlines()]


def call(name: str, action: Any, **more: Any) -> dict[str, Any]:
    return {"type": "computer_call", "call_id": name, "action": action, **more}


def shot(name: str, number: int) -> dict[str, Any]:
    return {
        "type": "computer_call_output",
        "call_id": name,
        "output": {"type": "computer_screenshot", "image_url": url(number)},
    }


@pytest.mark.parametrize("shape", ["lines", "list", "items", "bodies", "body lines"])
def test_the_shapes_of_a_log(shape: str, tmp_path: Path) -> None:
    options = items(tmp_path)
    (tmp_path / "run.jsonl").unlink()
    if shape == "lines":
        write_lines(tmp_path / "a.jsonl", options)
    elif shape == "list":
        write_json(tmp_path / "a.json", options)
    elif shape == "items":
        write_json(tmp_path / "a.json", {"items": options})
    elif shape == "bodies":
        write_json(
            tmp_path / "a.json",
            {"model": "computer-use-preview", "input": options[:4], "output": options[4:]},
        )
    else:  # the second request holds the first again
        write_lines(
            tmp_path / "a.jsonl",
            [{"input": options[:3]}, {"output": options[3:5]}, {"input": options}],
        )
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert (trajectory.id, trajectory.instruction) == ("a", "do it")
    assert [s.action for s in trajectory] == [Action("click", 100, 50), Action("wait")]
    assert [read_picture(s.image, "") for s in trajectory] == [png(0), png(1)]


def test_a_second_task_in_a_file_is_refused_unless_it_continues(tmp_path: Path) -> None:
    options = items(tmp_path)
    (tmp_path / "run.jsonl").unlink()
    for text in ("do that", [{"role": "user", "content": "do that"}]):
        write_lines(tmp_path / "a.jsonl", [{"model": "m"}, {"input": options}, {"input": text}])
        trajectories, (rejected,) = read(tmp_path)
        assert not trajectories
        assert (rejected.field, "another conversation" in rejected.reason) == (
            "line 3, input",
            True,
        )
        continued = {"previous_response_id": "r1", "input": text}
        write_lines(tmp_path / "a.jsonl", [{"input": options}, continued])
        (trajectory,), rejected = read(tmp_path)
        assert (trajectory.instruction, len(trajectory.steps), rejected) == ("do it", 2, [])


def test_an_input_that_is_text_and_a_picture_in_the_first_message(tmp_path: Path) -> None:
    write_json(
        tmp_path / "a.json", [{"input": "press it"}, shot("x", 3), call("1", {"type": "wait"})]
    )
    picture = {"type": "input_image", "image_url": url(4)}
    first = {"role": "user", "content": [{"type": "input_text", "text": "go"}, picture]}
    write_json(tmp_path / "b.json", [first, call("1", {"type": "wait"})])
    (a, b), rejected = read(tmp_path)
    assert not rejected
    assert (a.instruction, b.instruction) == ("press it", "go")
    assert [read_picture(t.steps[0].image, "") for t in (a, b)] == [png(3), png(4)]


def test_a_batch_of_actions_is_one_step(tmp_path: Path) -> None:
    listed = [
        {"type": "screenshot"},
        {"type": "click", "x": 7, "y": 8},
        {"type": "type", "text": "a"},
    ]
    batch = {"type": "computer_call", "call_id": "1", "actions": listed}
    write_json(tmp_path / "a.json", [{"role": "user", "content": "go"}, shot("0", 0), batch])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action == Action("click", 7, 8)
    assert json.loads(trajectory.steps[0].action_code) == listed


def test_pictures_may_be_files_of_the_folder(tmp_path: Path) -> None:
    result = {**shot("0", 0), "output": {"image_url": "shots/0.png"}}
    (tmp_path / "shots").mkdir()
    (tmp_path / "shots" / "0.png").write_bytes(png(5))
    write_json(
        tmp_path / "a.json",
        [{"role": "user", "content": "go"}, result, call("1", {"type": "wait"})],
    )
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert Path(trajectory.steps[0].image) == tmp_path / "shots" / "0.png"


def with_output(output: Any) -> Any:
    return {"type": "computer_call_output", "call_id": "c1", "output": output}


@pytest.mark.parametrize(
    ("number", "item", "fields", "reason"),
    [
        (4, call("c1", {"type": "click", "x": 400, "y": 0}), ["action"], "outside the 400x200"),
        (4, call("c1", {"type": "click", "x": "a", "y": 0}), ["action"], "number"),
        (4, call("c1", {"type": "dance"}), ["action"], "dance"),
        (4, call("c1", None), ["action"], "object"),
        (4, {"type": "computer_call", "action": {"type": "wait"}}, ["call_id"], "missing"),
        (4, call("c1", None, actions=4), ["actions"], "list"),
        (4, call("c1", {"type": "type", "text": "\ud800"}), ["action"], "surrogate"),
        (
            5,
            with_output({"image_url": "data:image/png;base64,@@@@"}),
            ["image", "screenshot"],
            "not base64",
        ),
        (
            5,
            with_output({"image_url": "data:image/png;base64,aGVsbG8="}),
            ["image", "screenshot"],
            "not a readable",
        ),
        (
            5,
            with_output({"image_url": "https://x.org/a.png"}),
            ["image", "screenshot"],
            "on the web",
        ),
        (5, with_output({"image_url": "../../a.png"}), ["image", "screenshot"], "leaves"),
        (5, with_output({"file_id": "file-1"}), ["image", "screenshot"], "data: URL"),
        (5, with_output(None), ["output", "screenshot"], "object"),
        (5, 17, ["", "screenshot"], "object"),
    ],
)
def test_what_is_broken_is_counted(
    number: int, item: Any, fields: list[str], reason: str, tmp_path: Path
) -> None:
    options = items(tmp_path)
    options[number] = item
    write_lines(tmp_path / "run.jsonl", options)
    (trajectory,), rejected = read(tmp_path)
    assert [(r.file, r.field) for r in rejected] == [("run.jsonl", field) for field in fields]
    assert rejected[0].where == f"line {number + 1}"
    assert reason in rejected[0].reason
    assert len(trajectory.steps) == 1


def test_an_action_without_a_screenshot_of_its_own(tmp_path: Path) -> None:
    options = [{"role": "user", "content": "go"}, call("0", {"type": "wait"}), shot("0", 0)]
    write_json(
        tmp_path / "a.json", [*options, call("1", {"type": "wait"}), call("2", {"type": "wait"})]
    )
    (trajectory,), rejected = read(tmp_path)
    assert [s.index for s in trajectory] == [2]
    assert [(r.where, r.field) for r in rejected] == [
        ("entry 1", "screenshot"),
        ("entry 4", "screenshot"),
    ]
    assert "before this action" in rejected[0].reason
    assert "between this action and the one before" in rejected[1].reason


def test_logs_without_what_is_needed(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", [])
    write_json(tmp_path / "b.json", [shot("0", 0), call("1", {"type": "wait"})])
    openai(tmp_path)
    write_json(tmp_path / "run.json", items(tmp_path))
    trajectories, rejected = read(tmp_path)
    assert [t.id for t in trajectories] == ["run"]
    assert [(r.file, r.field) for r in rejected] == [
        ("a.json", ""),
        ("b.json", "instruction"),
        ("run.jsonl", "id"),
    ]


def test_a_line_of_300_megabytes_is_not_taken_into_memory(tmp_path: Path) -> None:
    openai(tmp_path)
    with (tmp_path / "big.jsonl").open("wb") as file:
        file.write((tmp_path / "run.jsonl").read_bytes())
        file.write(b'{"type": "')
        file.truncate(300 * 2**20)  # a sparse file: zeros
    tracemalloc.start()
    trajectories, rejected = read(tmp_path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [t.id for t in trajectories] == ["big", "run"]
    assert [(r.file, r.where) for r in rejected] == [("big.jsonl", "line 8")]
    assert "longer than 50 MiB" in rejected[0].reason
    assert peak < 120 * 2**20


def test_a_log_that_changes_after_it_was_read(tmp_path: Path) -> None:
    from hijack_data.errors import ImageError

    openai(tmp_path)
    (trajectory,), _ = read(tmp_path)
    (tmp_path / "run.jsonl").write_text("{}\n")
    with pytest.raises(ImageError, match=r"run\.jsonl"):
        read_picture(trajectory.steps[0].image, "run.jsonl")
    (tmp_path / "run.jsonl").unlink()
    with pytest.raises(ImageError, match="cannot be read"):
        read_picture(trajectory.steps[0].image, "run.jsonl")
