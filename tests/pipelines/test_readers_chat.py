"""Training sets in JSON: which picture each reply goes with, and what its numbers are."""

import base64
import json
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.actions.dialects.qwen import tool_call_text
from hijack_data.coords import smart_resize
from hijack_data.types import Action, Trajectory
from pipelines import build, open_dataset
from pipelines.exports import export
from pipelines.readers import Rejected, detect_format, get_reader
from pipelines.readers.reader_options import ReaderOptions, with_choices
from pipelines.readers.recorded_pictures import read_picture

from support.formats import png, ui_tars, write_json, write_lines, write_table

BIG = (1920, 1080)


def read(path: Path, name: str = "chat", **choices: str) -> tuple[list[Trajectory], list[Rejected]]:
    items = list(with_choices(get_reader(name), ReaderOptions(**choices)).read(path))
    return [i for i in items if isinstance(i, Trajectory)], [
        i for i in items if isinstance(i, Rejected)
    ]


def files(folder: Path, count: int = 1, size: tuple[int, int] = (400, 200)) -> list[str]:
    (folder / "images").mkdir(parents=True, exist_ok=True)
    for number in range(count):
        (folder / "images" / f"{number}.png").write_bytes(png(number, *size))
    return [f"images/{number}.png" for number in range(count)]


def openai_row(replies: list[str], names: list[str], ask: str = "open it") -> dict[str, Any]:
    messages = [
        {"role": role, "content": text}
        for index, reply in enumerate(replies)
        for role, text in (("user", f"<image>{ask if not index else ''}"), ("assistant", reply))
    ]
    return {"messages": messages, "images": names}


def sharegpt_row(replies: list[str], names: list[str], ask: str = "open it") -> dict[str, Any]:
    row = openai_row(replies, names, ask)
    roles = {"user": "human", "assistant": "gpt"}
    turns = [{"from": roles[m["role"]], "value": m["content"]} for m in row["messages"]]
    return {"conversations": turns, "image": names if len(names) > 1 else names[0]}


CODES = ["pyautogui.click(100, 50)", "```python\npyautogui.press('enter')\n```", "DONE"]


@pytest.mark.parametrize("make", [openai_row, sharegpt_row])
@pytest.mark.parametrize("suffix", ["json", "jsonl"])
def test_layouts_and_pairing(make: Any, suffix: str, tmp_path: Path) -> None:
    rows = [make(CODES, files(tmp_path, 3)), make(CODES[:1], files(tmp_path, 1), "close it")]
    (write_json if suffix == "json" else write_lines)(tmp_path / f"train.{suffix}", rows)
    assert detect_format(tmp_path) == detect_format(tmp_path / f"train.{suffix}") == "chat"
    (first, second), rejected = read(tmp_path)
    assert not rejected
    assert [s.action for s in first] == [
        Action("click", 100, 50),
        Action("hotkey", keys=("enter",)),
        Action("done"),
    ]
    assert [read_picture(s.image, "") for s in first] == [png(0), png(1), png(2)]
    assert (first.instruction, second.instruction) == ("open it", "close it")
    assert first.id == "train/000000"


def test_the_last_of_several_pictures_is_the_screen(tmp_path: Path) -> None:
    row = openai_row(CODES[:1], files(tmp_path, 3))
    row["messages"][0]["content"] = "<image><image>before<image>open it"
    write_lines(tmp_path / "a.jsonl", [row])
    (trajectory,), _ = read(tmp_path)
    assert [read_picture(s.image, "") for s in trajectory] == [png(2)]


def test_one_picture_needs_no_placeholder_and_several_do(tmp_path: Path) -> None:
    rows = [openai_row(CODES[:1], files(tmp_path, n)) for n in (1, 2)]
    for row in rows:
        row["messages"][0]["content"] = "open it"
    write_lines(tmp_path / "a.jsonl", rows)
    (trajectory,), (rejected,) = read(tmp_path)
    assert trajectory.id == "a/000000"
    assert "which of the 2 pictures" in rejected.reason


# The same point of a picture of any size.
THOUSANDTHS = {"messages": openai_row(["Action: click(start_box='(100,50)')"], [])["messages"]}


def test_a_row_that_states_another_size_than_its_picture_is_refused(tmp_path: Path) -> None:
    row = openai_row(CODES[:1], files(tmp_path))
    sizes = [{"width": 400, "height": 200}, {"width": 800, "height": 400}]
    write_lines(tmp_path / "a.jsonl", [{**row, **size} for size in sizes])
    (trajectory,), rejected = read(tmp_path)
    assert trajectory.id == "a/000000"
    assert {(r.where, "picture is 400x200" in r.reason) for r in rejected[:1]} == {("line 2", True)}
    write_lines(tmp_path / "a.jsonl", [{**row, **sizes[1], **THOUSANDTHS}])
    (trajectory,), rejected = read(tmp_path, coordinates="thousand")
    assert (trajectory.steps[0].action, rejected) == (Action("click", 40, 10), [])
    picture = {"bytes": png(0), "path": None}
    write_table(tmp_path / "a.parquet", [{**row, **size, "images": [picture]} for size in sizes])
    (trajectory,), rejected = read(tmp_path, "parquet")
    assert [r.where for r in rejected][:1] == ["row 1"]


def test_pictures_that_no_placeholder_shows_leave_the_screen_unknown(tmp_path: Path) -> None:
    row = openai_row(CODES[:1], files(tmp_path, 2))
    write_lines(tmp_path / "a.jsonl", [row])
    trajectories, (rejected,) = read(tmp_path)
    assert not trajectories
    assert (rejected.where, rejected.field) == ("line 1", "messages")
    assert "show 1 of the row's 2 pictures" in rejected.reason


@pytest.mark.parametrize(
    "part",
    [
        {"type": "image", "image": "images/1.png"},
        {"type": "image_url", "image_url": {"url": "images/1.png"}},
        {"type": "input_image", "image_url": "images/1.png"},
    ],
)
def test_a_part_that_names_a_picture_names_that_of_the_row(
    part: dict[str, Any], tmp_path: Path
) -> None:
    content = [part, {"type": "text", "text": "open it"}]
    messages = [{"role": "user", "content": content}, {"role": "assistant", "content": CODES[0]}]
    other, same = files(tmp_path, 2)
    write_lines(tmp_path / "a.jsonl", [{"messages": messages, "images": [same]}])
    (trajectory,), rejected = read(tmp_path)
    assert (Path(trajectory.steps[0].image).name, rejected) == ("1.png", [])
    write_lines(tmp_path / "a.jsonl", [{"messages": messages, "images": [other]}])
    trajectories, rejected = read(tmp_path)
    assert not trajectories
    assert rejected[0].field.startswith("messages[0].content.image")
    assert "names 'images/1.png', but picture 0 of the row is 'images/0.png'" in rejected[0].reason


def test_pictures_as_data_urls_and_from_the_source(tmp_path: Path) -> None:
    link = "data:image/png;base64," + base64.b64encode(png(7)).decode()
    names = files(tmp_path)
    write_lines(
        tmp_path / "deep" / "a.jsonl", [openai_row(CODES[:1], [link]), openai_row(CODES[:1], names)]
    )
    value, rejected = read(tmp_path)
    assert not rejected
    assert [read_picture(t.steps[0].image, "") for t in value] == [png(7), png(0)]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("no.png", "not in the source"),
        ("../../x.png", "leaves"),
        ("/etc/passwd", "absolute"),
        ("https://x.org/a.png", "on the web"),
        ("", "must be a path"),
        (None, "must be a path"),
    ],
)
def test_pictures_that_are_not_there(name: Any, reason: str, tmp_path: Path) -> None:
    names = files(tmp_path)
    write_lines(tmp_path / "a.jsonl", [openai_row(CODES[:1], [name]), openai_row(CODES[:1], names)])
    (trajectory,), (rejected,) = read(tmp_path)
    assert trajectory.id == "a/000001"
    assert reason in rejected.reason


@pytest.mark.parametrize(
    "line",
    [
        "{",
        "[]",
        '{"messages": 3, "images": ["a"]}',
        '{"images": ["images/0.png"]}',
        '{"messages": [], "images": ["images/0.png"]}',
        '{"messages": [{"role": "user", "content": "x"}]}',
    ],
)
def test_a_bad_line_never_loses_the_rest(line: str, tmp_path: Path) -> None:
    good = json.dumps(openai_row(CODES[:1], files(tmp_path)))
    (tmp_path / "a.jsonl").write_text(f"{good}\n{line}\n{good}\n")
    value, rejected = read(tmp_path)
    assert [t.id for t in value] == ["a/000000", "a/000002"]
    assert {r.where for r in rejected} == {"line 2"}


def test_a_reply_that_is_no_action_is_no_step(tmp_path: Path) -> None:
    row = openai_row(
        ["It is a button: you could use pyautogui.click to press it."], files(tmp_path)
    )
    write_lines(tmp_path / "a.jsonl", [row])
    value, (rejected,) = read(tmp_path)
    assert not value
    assert "hold no action" in rejected.reason


@pytest.mark.parametrize(
    ("reply", "kind"),
    [
        ("Done.\n```python\ncomputer.terminate(status='success')\n```", "done"),
        ("Three times.\ncomputer.tripleClick(x=100, y=50)", "triple_click"),
        ("```python\ncomputer.wait(3)\n```", "wait"),
    ],
)
def test_code_of_agentnets_computer_alone_is_an_action(
    reply: str, kind: str, tmp_path: Path
) -> None:
    row = openai_row([CODES[0], reply, "The computer.waits"], files(tmp_path, 3))
    write_lines(tmp_path / "a.jsonl", [row])
    (trajectory,), _ = read(tmp_path)
    assert [step.action.type for step in trajectory.steps] == ["click", kind]


@pytest.mark.parametrize("make", [openai_row, sharegpt_row])
def test_a_reply_between_two_pictures_that_is_no_action_is_reported(
    make: Any, tmp_path: Path
) -> None:
    """The screen changed after it, so an action was lost; prose after the last picture is none."""
    replies = [CODES[0], "press(enter)", CODES[1], "It is open now."]
    write_lines(tmp_path / "a.jsonl", [make(replies, files(tmp_path, 4))])
    (trajectory,), (rejected,) = read(tmp_path)
    assert [Path(step.image).name for step in trajectory.steps] == ["0.png", "2.png"]
    assert rejected.field.endswith("[3]")
    assert "no action that is known" in rejected.reason


def test_aguvis_has_thoughts_and_actions_in_one_turn_each(tmp_path: Path) -> None:
    names = files(tmp_path)
    turns = [
        {"from": "system", "value": "You are a GUI agent."},
        {
            "from": "human",
            "value": "<image>\nMove on.\n\nInstruction: buy it\n\nPrevious actions:\nNone",
        },
        {"from": "gpt", "value": "Action: click on Buy", "recipient": "all"},
        {
            "from": "gpt",
            "value": "pyautogui.click(x=0.25, y=0.25)",
            "recipient": "os",
            "end_turn": True,
        },
    ]
    write_json(tmp_path / "stage2.json", [{"image": names[0], "conversations": turns}])
    value, (rejected,) = read(tmp_path)
    assert not value
    assert "--coordinates" in rejected.reason
    (value,), rejected = read(tmp_path, coordinates="fractions")
    assert not rejected
    assert value.instruction == "buy it"
    assert [s.action for s in value] == [Action("click", 100, 50)]
    assert value.steps[0].action_code == "pyautogui.click(x=100, y=50)"


@pytest.mark.parametrize(
    ("calls", "expected", "code"),
    [
        ("click(x=0.25, y=0.25)", Action("click", 100, 50), "pyautogui.click(x=100, y=50)"),
        (
            "doubleClick(x=0.25, y=0.25)",
            Action("double_click", 100, 50),
            "pyautogui.doubleClick(x=100, y=50)",
        ),
        ("write(message='hi')", Action("type", text="hi"), "pyautogui.write(message='hi')"),
        ("wait(3)", Action("wait", amount=3), "computer.wait(3)"),
        ("terminate(status='success')", Action("done"), "computer.terminate(status='success')"),
        ("open_app(app_name='Cantook')", Action("other"), "open_app(app_name='Cantook')"),
        ("response(answer='42')", Action("done", text="42"), "response(answer='42')"),
        (
            "swipe(from_coord=[0.5, 0.75], to_coord=[0.5, 0.25])",
            Action("drag", 200, 150, 200, 50),
            "pyautogui.moveTo([200, 150])\npyautogui.dragTo([200, 50])",
        ),
        ("long_press(x=0.25, y=0.25)", Action("other", 100, 50), ""),
    ],
)
def test_scale_cua(calls: str, expected: Action, code: str, tmp_path: Path) -> None:
    reply = f"<think>\nhm\n</think>\n<operation>\ndo\n</operation>\n<action>\n{calls}\n</action>"
    ask = "Please generate the next move.\n\nTask: read it\n\nPrevious operations:\nNone"
    row = {**sharegpt_row([reply], files(tmp_path), ask), "width": 400, "height": 200}
    write_lines(tmp_path / "a.jsonl", [row])
    (trajectory,), rejected = read(tmp_path, coordinates="fractions")
    assert not rejected
    assert (
        trajectory.instruction,
        trajectory.steps[0].action,
        trajectory.steps[0].action_code,
    ) == ("read it", expected, code)


@pytest.mark.parametrize(
    ("reply", "expected"),
    [
        ("thoughts:\nhm\nactions:\nCLICK <point>[[250, 250]]</point>", Action("click", 100, 50)),
        ("actions:\nTYPE [hello]", Action("type", text="hello")),
        ("SCROLL [DOWN]", Action("scroll", amount=-5)),
        ("actions:\nCOMPLETE", Action("done")),
        ("actions:\nPRESS_BACK", Action("other")),
        ("<ref>OK</ref><box>[[250,200,350,300]]</box>", Action("click", 120, 50)),
    ],
)
def test_os_atlas(reply: str, expected: Action, tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", [sharegpt_row([reply], files(tmp_path))])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert (trajectory.steps[0].action, trajectory.steps[0].action_code) == (expected, reply)
    assert trajectory.steps[0].target_box == ((100, 40, 140, 60) if "<box>" in reply else None)


# The picture has 400 x 200 pixels.
DEFINED = [
    '<think>x</think>\n<answer>do(action="Tap", element=[250,250])</answer>',
    "{'action': 'CLICK', 'value': None, 'position': [0.25, 0.25]}",
    "Action: x\nGrounded Operation: CLICK(box=[[240,240,260,260]], element_info='OK')",
    "x\n<|begin_of_box|>left_click(start_box='[250,250]')<|end_of_box|>",
    "<seed:tool_call><function=click><parameter=point><point>250 250</point></parameter>"
    "</function></seed:tool_call>",
]


@pytest.mark.parametrize("reply", DEFINED)
def test_forms_of_one_model_have_the_space_of_their_definition(reply: str, tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", [sharegpt_row([reply], files(tmp_path))])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert (trajectory.steps[0].action, trajectory.steps[0].action_code) == (
        Action("click", 100, 50),
        reply,
    )


@pytest.mark.parametrize(
    "reply",
    [
        "Thought: a\nAction: click(point='<point>250 250</point>')",
        "Action: click(point='(250,250)')",
        "<tool_call><function=computer_use><parameter=action>left_click</parameter>"
        "<parameter=coordinate>[250, 250]</parameter></function></tool_call>",
    ],
)
def test_newer_forms_of_families_need_their_space_all_the_same(reply: str, tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", [sharegpt_row([reply], files(tmp_path))])
    assert "coordinates" in read(tmp_path)[1][0].reason
    (trajectory,), rejected = read(tmp_path, coordinates="thousand")
    assert not rejected
    assert trajectory.steps[0].action == Action("click", 100, 50)


def test_several_boxes_are_no_click(tmp_path: Path) -> None:
    two = "<box>[[1,2,3,4]]</box><box>[[5,6,7,8]]</box>"
    write_json(tmp_path / "a.json", [sharegpt_row([two], files(tmp_path))])
    assert "2 boxes" in read(tmp_path)[1][0].reason


def computer_use(x: int, y: int) -> str:
    return tool_call_text("computer_use", {"action": "left_click", "coordinate": [x, y]})


def uitars(x: int, y: int) -> str:
    return f"Thought: now\nAction: click(start_box='({x},{y})')"


@pytest.mark.parametrize("reply", [computer_use, uitars])
@pytest.mark.parametrize("size", [(400, 200), BIG])
@pytest.mark.parametrize("where", ["parquet", "json"])
def test_text_of_models_needs_its_space(reply: Any, size: Any, where: str, tmp_path: Path) -> None:
    width, height = size
    calls = smart_resize(height, width)
    points = {
        "resized": (calls[1] // 4, calls[0] // 4),
        "thousand": (250, 250),
        "pixels": (width // 4, height // 4),
    }
    for space, point in points.items():
        row = openai_row([reply(*point)], files(tmp_path, 1, size))
        if where == "parquet":
            row["images"] = [{"bytes": png(0, *size), "path": None}]
            write_table(tmp_path / "a.parquet", [row])
        else:
            write_lines(tmp_path / "a.jsonl", [row])
        name = "parquet" if where == "parquet" else "chat"
        value, (rejected,) = read(tmp_path, name)
        assert not value
        assert "nothing says what its coordinates count" in rejected.reason
        (value,), rejected = read(tmp_path, name, coordinates=space)
        assert not rejected
        assert value.steps[0].action == Action("click", width // 4, height // 4)
        assert ("pyautogui" in value.steps[0].action_code) == (space == "pixels")


@pytest.mark.parametrize(
    ("resolution", "point"),
    [("1000x1000", (250, 250)), ("1932x1092", (483, 273)), ("960x540", (240, 135))],
)
def test_a_prompt_that_states_the_resolution_says_the_space(
    resolution: str, point: Any, tmp_path: Path
) -> None:
    row = openai_row([computer_use(*point)], files(tmp_path, 1, BIG))
    prompt = f"* The screen's resolution is {resolution}.\n* ..."
    row["messages"].insert(0, {"role": "system", "content": prompt})
    write_lines(tmp_path / "a.jsonl", [row])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    x, y = trajectory.steps[0].action.x, trajectory.steps[0].action.y
    assert abs(x - 480) <= 1
    assert abs(y - 270) <= 1


def test_structured_calls_of_qwen_are_text(tmp_path: Path) -> None:
    entries = {"action": "left_click", "coordinate": [250, 250]}
    call = {
        "type": "function",
        "function": {"name": "computer_use", "arguments": json.dumps(entries)},
    }
    row = openai_row([""], files(tmp_path))
    row["messages"][1]["tool_calls"] = [call]
    write_lines(tmp_path / "a.jsonl", [row])
    (trajectory,), rejected = read(tmp_path, coordinates="thousand")
    assert not rejected
    assert trajectory.steps[0].action == Action("click", 100, 50)
    assert trajectory.steps[0].action_code == computer_use(250, 250)


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ('{"action": "type", "text": "\ud800"}', "holds half of a surrogate pair"),
        ("null", "must be an object, got None"),
        ("[1]", "must be an object, got [1]"),
    ],
)
def test_arguments_of_a_call_that_are_no_object_are_rejected(
    arguments: str, why: str, tmp_path: Path
) -> None:
    row = openai_row([""], files(tmp_path))
    row["messages"][1]["tool_calls"] = [
        {"type": "function", "function": {"name": "computer_use", "arguments": arguments}}
    ]
    write_lines(tmp_path / "a.jsonl", [row])
    trajectories, rejected = read(tmp_path, coordinates="thousand")
    assert not trajectories
    assert rejected[0].field == "messages[1].tool_calls.function.arguments"
    assert why in rejected[0].reason


@pytest.mark.parametrize("dialect", ["pyautogui", "ui_tars", "ui_tars_1.5"])
def test_our_own_export_comes_back(recording: Any, dialect: str, tmp_path: Path) -> None:
    build(
        recording(trajectories=2, steps=2),
        tmp_path / "set",
        corruptions={"half": hj.Resolution(scale=0.5)},
    )
    export(tmp_path / "set", tmp_path / "chat", to="chat", dialect=dialect)
    assert detect_format(tmp_path / "chat") == "chat"
    value, rejected = read(tmp_path / "chat")
    clean = [row for row in open_dataset(tmp_path / "set") if row["corruption"] == "clean"]
    assert len(value) == len(clean) == 4
    assert {r.field for r in rejected} == {"corruption"}
    for trajectory, row in zip(value, clean, strict=True):
        (step,) = trajectory.steps
        assert (trajectory.id, trajectory.instruction, trajectory.domain) == (
            row["id"],
            row["instruction"],
            row["domain"],
        )
        assert abs(step.action.x - row["action"]["x"]) <= (dialect != "pyautogui")
        assert abs(step.action.y - row["action"]["y"]) <= (dialect != "pyautogui")
        assert list(step.target_box) == row["target_box"]
        picture = row["screenshot"]["bytes"] if isinstance(row["screenshot"], dict) else None
        assert picture is None or read_picture(step.image, "") == picture
    build(tmp_path / "chat", tmp_path / "again")
    again = [row for row in open_dataset(tmp_path / "again") if row["corruption"] == "clean"]
    assert [row["image_sha256"] for row in again] == [row["image_sha256"] for row in clean]


def test_logs_of_ui_tars_are_not_taken(tmp_path: Path) -> None:
    ui_tars(tmp_path)
    assert not get_reader("chat").detect(tmp_path)
    assert detect_format(tmp_path) == "ui_tars"


def test_an_id_is_that_of_its_file(tmp_path: Path) -> None:
    """Files of one folder number their rows from 0 each; twice in one file is a mistake."""
    (tmp_path / "0.png").write_bytes(png())
    row = openai_row(CODES[:1], ["0.png"])
    for name in ("a", "sub/b"):
        write_lines(tmp_path / f"{name}.jsonl", [{**row, "id": 0}, {**row, "id": 1}])
    write_lines(tmp_path / "c.jsonl", [{**row, "id": "b/1"}, {**row, "id": 7}, {**row, "id": 7}])
    value, (rejected,) = read(tmp_path)
    assert [item.id for item in value] == ["0", "1", "b/1", "7", "sub/b/0", "sub/b/1"]
    assert (rejected.file, rejected.field) == ("c.jsonl", "id")
    assert "'7' is the id of an earlier row of this file; number them anew" in rejected.reason
