"""What holds for every format: it is told apart, read in a fixed order, and built with its points
in place."""

import json
import os
import shutil
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hijack_data as hj
from pipelines import build, verify
from pipelines.errors import SourceError
from pipelines.readers import detect_format, get_reader, names
from pipelines.readers.recorded_pictures import read_picture

from support.formats import FORMATS, HEIGHT, PLACELESS, POINT, SETS, WIDTH, png
from support.recordings import read_source

EVERY = {**FORMATS, **SETS}


@pytest.fixture
def source(tmp_path: Path) -> Path:
    folder = tmp_path / "source"
    folder.mkdir()
    return folder


def test_every_reader_has_a_recording_here() -> None:
    # Pictures are no recording, published sets are read by name only, and a LeRobot set is more
    # than its files: they have own tests.
    remaining = ["images", "lerobot", "screenspot_v2", "screenspot_pro", "osworld_g"]
    assert sorted([*EVERY, *remaining]) == names()


@pytest.mark.parametrize("name", sorted(EVERY))
def test_only_its_own_reader_detects_a_format(name: str, source: Path) -> None:
    EVERY[name](source)
    assert [second for second in names() if get_reader(second).detect(source)] == [name]
    assert detect_format(source) == name


@pytest.mark.parametrize("name", sorted(EVERY))
def test_a_recording_is_told_by_its_file_alone(name: str, source: Path) -> None:
    EVERY[name](source)
    files = [file for file in source.rglob("*") if file.suffix in (".json", ".jsonl", ".parquet")]
    # parts of a recording
    files = [file for file in files if not file.parent.name.startswith("turn_")]
    beside = ("episode.json", "task.json")  # say what an episode is, not what was done
    values = {
        detect_format(file)
        for file in files
        if "examples" not in file.parts and file.name not in beside
    }
    assert values == {name}


@pytest.mark.parametrize(("one", "other"), list(combinations(sorted(EVERY), 2)))
def test_two_formats_in_one_folder_are_never_guessed(one: str, other: str, source: Path) -> None:
    for name in (one, other):
        # these look at the top folder only
        node = source if name in ("agentnet", "jsonl", "runs") else source / name
        node.mkdir(exist_ok=True)
        EVERY[name](node)
    with pytest.raises(SourceError, match="could be of format") as caught:
        detect_format(source)
    assert one in str(caught.value)
    assert other in str(caught.value)


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_reading_is_complete_repeatable_and_shows_the_right_pictures(
    name: str, source: Path
) -> None:
    FORMATS[name](source)
    (trajectory,), rejected = read_source(source, name)
    assert rejected == []
    assert read_source(source, name) == ([trajectory], [])
    assert trajectory.source == name
    assert trajectory.instruction
    assert len(trajectory.steps) == 2
    assert [read_picture(step.image, "x") for step in trajectory] == [png(0), png(1)]
    assert all(step.action_code for step in trajectory)
    if name not in PLACELESS:
        assert trajectory.steps[0].action == hj.types.Action("click", *POINT)


CODES = {
    "agentnet": ("pyautogui.click(x=100, y=50)", "pyautogui.click(x=50, y=25)"),
    "aitz": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "android_control": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "anthropic": (
        '{"action": "left_click", "coordinate": [100, 50]}',
        '{"action": "left_click", "coordinate": [50, 25]}',
    ),
    "atif": (
        '{"action": "left_click", "coordinate": [100, 50]}',
        '{"action": "left_click", "coordinate": [50, 25]}',
    ),
    "browser_use": ('[{"click": {"index": 7}}]',) * 2,
    "chat": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "cua": (
        '{"type": "click", "button": "left", "x": 100, "y": 50}',
        '{"type": "click", "button": "left", "x": 50, "y": 25}',
    ),
    "gui_odyssey": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "guiact": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "jsonl": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "openai": (
        '{"type": "click", "button": "left", "x": 100, "y": 50}',
        '{"type": "click", "button": "left", "x": 50, "y": 25}',
    ),
    "osworld": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "parquet": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "runs": ("pyautogui.click(100, 50)", "pyautogui.click(50, 25)"),
    "screenagent": tuple(
        '[{"action_type": "MouseAction", "mouse_action_type": "click", "mouse_button": "left", '
        f'"mouse_position": {{"width": {x}, "height": {y}}}}}]'
        for x, y in ((100, 50), (50, 25))
    ),
    "ui_tars": ("Thought: now\nAction: click(start_box='(250,250)')",) * 2,
    # 200x100 becomes 196x112 before the model sees it: x 98 * 196 / 392, y 49 * 112 / 196.
    "ui_tars_1.5": tuple(
        f"Thought: now\nAction: click(start_box='<|box_start|>({x},{y})<|box_end|>')"
        for x, y in ((98, 49), (49, 28))
    ),
    "webvoyager": ("Type [2]; green tea",) * 2,
}


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_build_puts_points_and_code_where_they_belong(
    name: str, source: Path, tmp_path: Path
) -> None:
    FORMATS[name](source)
    out = tmp_path / "out"
    report = build(source, out, corruptions={"half": hj.Resolution(scale=0.5)})
    assert report.rejected == 0
    assert dict(report.rows) == {"clean": 2, "half": 2}
    rows = {row["id"].split("/", -1)[-1]: row for row in reversed(rows_of(out))}
    clean, half = rows["clean"], rows["half"]
    assert (clean["width"], clean["height"]) == (WIDTH, HEIGHT)
    assert (half["width"], half["height"]) == (WIDTH // 2, HEIGHT // 2)
    if name not in PLACELESS:
        assert (clean["action"]["x"], clean["action"]["y"]) == POINT
        assert (half["action"]["x"], half["action"]["y"]) == (POINT[0] // 2, POINT[1] // 2)
        assert half["target_visible"] == 1
    assert (clean["action_code"], half["action_code"]) == CODES[name]
    assert verify(out).ok


def rows_of(out: Path) -> list[dict[str, Any]]:
    return [
        row
        for file in sorted((out / "data").glob("*.parquet"))
        for row in pq.read_table(file).to_pylist()
    ]


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_what_is_dangerous_is_refused_and_counted(name: str, source: Path) -> None:
    FORMATS[name](source)
    (source / "trajectory.pkl").write_bytes(b"cos\nsystem\n(S'touch pwned'\ntR.")
    (source / "loop").symlink_to(source)
    trajectories, rejected = read_source(source, name)
    assert len(trajectories) == 1
    assert {(r.file, r.reason.split()[1]) for r in rejected} == {
        ("trajectory.pkl", "pickle"),
        ("loop", "link"),
    }
    assert not (source / "pwned").exists()
    assert not Path("pwned").exists()


@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"jsonl", "agentnet"}))
@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe\x00", b"[" * 100_000, b'{"a": 1}', b"null", b"\x80\x04K\x01."]
)
def test_a_broken_file_is_counted_and_the_rest_is_read(
    name: str, content: bytes, source: Path
) -> None:
    FORMATS[name](source)
    records = next(
        f
        for f in sorted(source.rglob("*"))
        if f.suffix in (".json", ".jsonl", ".parquet")
        and "examples" not in f.parts
        and f.name not in ("episode.json", "task.json")
    )
    named = name in ("osworld", "webvoyager", "runs", "cua")
    broken = source / "zz" / (records.name if named else "broken" + records.suffix)
    broken.parent.mkdir()
    broken.write_bytes(content)
    trajectories, rejected = read_source(source, name)
    assert len(trajectories) == 1
    assert rejected
    assert {r.file for r in rejected} == {
        "zz/episode.json" if name == "runs" else f"zz/{broken.name}"
    }
    assert all(json.dumps(r.to_data()) for r in rejected)


ODD = (
    None,
    True,
    -1,
    0.5,
    10**400,
    float("nan"),
    "",
    "x" * 300,
    "\ud800",
    "../../x",
    "a\0b",
    [],
    {},
    [[]],
    [None],
    {"a": 1},
)
JSON_FORMATS = sorted(set(FORMATS) - {"parquet"})


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to all values inside a JSON value."""
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    return [path, *(item_path for key, item in inner for item_path in places(item, (*path, key)))]


def replaced(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(copy[path[0]], path[1:], new)
    return copy


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(name=st.sampled_from(JSON_FORMATS), odd=st.sampled_from(ODD), data=st.data())
def test_no_value_stops_a_reader(
    name: str, odd: Any, data: st.DataObject, tmp_path_factory: Any
) -> None:
    source = FORMATS[name](tmp_path_factory.mktemp("odd"))
    file = data.draw(
        st.sampled_from(sorted(f for f in source.rglob("*") if f.suffix in (".json", ".jsonl")))
    )
    lines = file.read_text().splitlines()
    line = data.draw(st.integers(0, len(lines) - 1))
    record = json.loads(lines[line])
    lines[line] = json.dumps(replaced(record, data.draw(st.sampled_from(places(record))), odd))
    file.write_text("\n".join(lines))
    trajectories, rejected = read_source(source, name)
    assert trajectories or rejected
    for trajectory in trajectories:
        json.dumps(asdict(trajectory), allow_nan=False).encode()
        json.dumps(asdict(trajectory), ensure_ascii=False).encode()
        for step in trajectory:
            assert read_picture(step.image, "")
            assert step.action.x is None or 0 <= step.action.x < WIDTH
            assert step.action.y is None or 0 <= step.action.y < HEIGHT
    shutil.rmtree(source)


def test_half_of_a_surrogate_pair_in_place_of_messages_is_rejected(tmp_path: Path) -> None:
    source = FORMATS["chat"](tmp_path)
    (file,) = source.glob("*.jsonl")
    record = json.loads(file.read_text().splitlines()[0])
    file.write_text(json.dumps({**record, "messages": "\ud800"}) + "\n")
    trajectories, rejected = read_source(source, "chat")
    assert not trajectories
    assert [(item.field, item.reason) for item in rejected] == [
        ("messages", "holds half of a surrogate pair, which is not text")
    ]


def test_a_pickle_alone_is_not_a_recording(source: Path) -> None:
    (source / "trajectory.pkl").write_bytes(b"\x80\x04K\x01.")
    for path in (source, source / "trajectory.pkl"):
        with pytest.raises(SourceError, match=r"trajectory\.pkl: a pickle .* is never opened"):
            detect_format(path)
    assert os.listdir(source) == ["trajectory.pkl"]
