"""One small recording in each format that can be read: a click at (100, 50) of a 400x200 picture,
then the end.

`FORMATS` maps the name of a format to a function that makes the recording in an empty folder,
`TABLES` does so for the other kinds of Parquet tables. All take `shots`, for other pictures and
more clicks.
"""

import base64
import json
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 400, 200
POINT = (100, 50)
TASK = "5ced85fc-fa1a-4217-95fd-0fb530545ce2"


def png(number: int = 0, width: int = WIDTH, height: int = HEIGHT) -> bytes:
    """A picture of coloured blocks, another for each number."""
    blocks = np.random.default_rng(number).integers(
        0, 256, (height // 10, width // 10, 3), dtype=np.uint8
    )
    buffer = BytesIO()
    Image.fromarray(blocks.repeat(10, axis=0).repeat(10, axis=1)).save(buffer, "PNG")
    return buffer.getvalue()


@dataclass(frozen=True)
class Shots:
    """What is recorded: a click on each picture but the last, and then the end.

    Args:
        picture: the bytes of a picture by its number.
        size: (width, height) of all of them.
        clicks: where, in fortieths of the width and the height: whole pixels and whole thousandths.
    """

    picture: Callable[[int], bytes] = png
    size: tuple[int, int] = (WIDTH, HEIGHT)
    clicks: tuple[tuple[int, int], ...] = ((10, 10),)

    def points(self, width: int, height: int) -> list[tuple[int, int]]:
        """The clicks in a space of another size."""
        return [(round(x * width / 40), round(y * height / 40)) for x, y in self.clicks]

    @property
    def pixels(self) -> list[tuple[int, int]]:
        """The clicks in pixels."""
        return self.points(*self.size)

    @property
    def codes(self) -> list[str]:
        """The actions as pyautogui code."""
        return [*(f"pyautogui.click({x}, {y})" for x, y in self.pixels), "DONE"]

    def text(self, number: int) -> str:
        """A picture as base64."""
        return base64.b64encode(self.picture(number)).decode()

    def url(self, number: int) -> str:
        """A picture as a data: URL."""
        return f"data:image/png;base64,{self.text(number)}"

    def files(self, folder: Path, names: list[str]) -> None:
        """Write the first pictures under these names."""
        folder.mkdir(parents=True, exist_ok=True)
        for number, name in enumerate(names):
            (folder / name).write_bytes(self.picture(number))


SMALL = Shots()


def text_of(number: int = 0) -> str:
    """A small picture as base64."""
    return SMALL.text(number)


def url(number: int = 0) -> str:
    """A small picture as a data: URL."""
    return SMALL.url(number)


def write_lines(file: Path, records: list[Any]) -> None:
    """Write JSON Lines."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(json.dumps(record) + "\n" for record in records))


def write_json(file: Path, data: Any) -> None:
    """Write JSON."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(data, ensure_ascii=False))


def osworld(
    folder: Path, actions: list[Any] | None = None, initial: bool = True, shots: Shots = SMALL
) -> Path:
    """OSWorld: result folder, pictures after the actions, the task's JSON under `examples`."""
    actions = shots.codes if actions is None else actions
    task = folder / "pyautogui" / "screenshot" / "a-model" / "gimp" / TASK
    names = [f"step_{i}_20250801@100000{i:06d}.png" for i in range(1, len(actions) + 1)]
    write_lines(
        task / "traj.jsonl",
        [
            {
                "step_num": i,
                "action_timestamp": name[7:-4],
                "action": action,
                "screenshot_file": name,
                "done": False,
            }
            for i, (action, name) in enumerate(zip(actions, names, strict=True), 1)
        ],
    )
    shots.files(task, ["initial_state.png", *names])
    if not initial:
        (task / "initial_state.png").unlink()
    (task / "result.txt").write_text("1.0\n")
    (task / "runtime.log").write_text("...\n")
    about = {"id": TASK, "instruction": "make it brighter", "related_apps": ["gimp"]}
    write_json(folder / "examples" / "gimp" / f"{TASK}.json", about)
    return folder


def jsonl(folder: Path, shots: Shots = SMALL) -> Path:
    """Our plain format."""
    actions = [*({"type": "click", "x": x, "y": y} for x, y in shots.pixels), {"type": "done"}]
    names = [f"{i}.png" for i in range(len(actions))]
    about = {"trajectory_id": "t", "instruction": "do it"}
    lines = [
        {**about, "step": i, "image": f"images/{name}", "action": action, "action_code": code}
        for i, (name, action, code) in enumerate(zip(names, actions, shots.codes, strict=True))
    ]
    write_lines(folder / "trajectories.jsonl", lines)
    shots.files(folder / "images", names)
    return folder


def agentnet(folder: Path, shots: Shots = SMALL) -> Path:
    """AgentNet: fractions."""
    clicks = [f"pyautogui.click(x={x / 40}, y={y / 40})" for x, y in shots.clicks]
    steps = [*clicks, "computer.terminate(status='success')"]
    traj = [
        {"index": i, "image": f"{i}.png", "value": {"code": code}} for i, code in enumerate(steps)
    ]
    write_lines(folder / "a.jsonl", [{"task_id": "a", "instruction": "do it", "traj": traj}])
    shots.files(folder / "images", [entry["image"] for entry in traj])
    return folder


def screenagent(folder: Path, shots: Shots = SMALL) -> Path:
    """ScreenAgent: pixels, `width` is x."""
    click = {"action_type": "MouseAction", "mouse_action_type": "click", "mouse_button": "left"}
    end = {"action_type": "EvaluateSubTaskAction", "situation": "ok"}
    places = [{"width": x, "height": y} for x, y in shots.pixels]
    actions = [*({**click, "mouse_position": fields} for fields in places), end]
    width, height = shots.size
    for i, action in enumerate(actions):
        record = {
            "session_id": "s1",
            "task_prompt": "打开浏览器",
            "saved_image_name": f"{i}.jpg",
            "video_width": width,
            "video_height": height,
            "actions": [action],
        }
        write_json(folder / "s1" / f"2023-12-20_19-31-3{i}.json", record)
    shots.files(folder / "s1" / "images", [f"{i}.jpg" for i in range(len(actions))])
    return folder


def webvoyager(folder: Path, shots: Shots = SMALL) -> Path:
    """WebVoyager: marks, no coordinates."""
    requests = [
        {"type": "text", "text": "Now given a task: Find it.  Please interact with https://x.org"}
    ]
    typed = {"role": "assistant", "content": "Thought: a\n\nAction: Type [2]; green tea"}
    messages = [
        {"role": "system", "content": "be a robot"},
        {"role": "user", "content": requests},
        *[
            message
            for _ in shots.clicks
            for message in (typed, {"role": "user", "content": "Observation"})
        ],
        {"role": "assistant", "content": "Thought: Action: no\nAction: ANSWER; done"},
    ]
    write_json(folder / "taskX--1" / "interact_messages.json", messages)
    shots.files(
        folder / "taskX--1", [f"screenshot{i}.png" for i in range(1, len(shots.clicks) + 2)]
    )
    return folder


def openai(folder: Path, shots: Shots = SMALL) -> Path:
    """OpenAI: items of the Responses API, a line each."""

    def call(number: int, action: dict[str, Any]) -> dict[str, Any]:
        return {"type": "computer_call", "call_id": f"c{number}", "action": action}

    def output(number: int, kind: str = "input_image") -> dict[str, Any]:
        entries = {"type": kind, "image_url": shots.url(number)}
        return {"type": "computer_call_output", "call_id": f"c{number}", "output": entries}

    clicks = [{"type": "click", "button": "left", "x": x, "y": y} for x, y in shots.pixels]
    items = [
        {"role": "user", "content": [{"type": "input_text", "text": "do it"}]},
        call(0, {"type": "screenshot"}),
        output(0, "computer_screenshot"),
        {"type": "reasoning", "summary": []},
        *[item for i, click in enumerate(clicks, 1) for item in (call(i, click), output(i))],
        call(len(clicks) + 1, {"type": "wait"}),
    ]
    write_lines(folder / "run.jsonl", items)
    return folder


def anthropic(folder: Path, shots: Shots = SMALL) -> Path:
    """Anthropic: messages, in one JSON body."""

    def use(name: str, options: dict[str, Any]) -> dict[str, Any]:
        return {
            "role": "assistant",
            "content": [{"type": "tool_use", "id": name, "name": "computer", "input": options}],
        }

    def result(name: str, number: int) -> dict[str, Any]:
        source = {"type": "base64", "media_type": "image/png", "data": shots.text(number)}
        content = [{"type": "text", "text": "ok"}, {"type": "image", "source": source}]
        return {
            "role": "user",
            "content": [{"type": "tool_result", "tool_use_id": name, "content": content}],
        }

    clicks = [{"action": "left_click", "coordinate": list(point)} for point in shots.pixels]
    messages = [
        {"role": "user", "content": "do it"},
        *[
            message
            for i, options in enumerate([{"action": "screenshot"}, *clicks])
            for message in (use(f"t{i}", options), result(f"t{i}", i))
        ],
        use("end", {"action": "key", "text": "ctrl+s"}),
    ]
    write_json(folder / "run.json", {"model": "claude", "messages": messages})
    return folder


def ui_tars(folder: Path, model: str = "UI-TARS-7B-DPO", shots: Shots = SMALL) -> Path:
    """UI-TARS 1.0: 0..1000."""
    return _ui_tars(folder, model, [f"({x},{y})" for x, y in shots.points(1000, 1000)], shots)


def ui_tars_15(folder: Path, shots: Shots = SMALL) -> Path:
    """UI-TARS 1.5: pixels of the smart-resized picture, here 392x196: whole patches of 28
    pixels."""
    width, height = (28 * round(side / 28) for side in shots.size)
    boxes = [f"<|box_start|>({x},{y})<|box_end|>" for x, y in shots.points(width, height)]
    return _ui_tars(folder, "UI-TARS-1.5-7B", boxes, shots)


def _ui_tars(folder: Path, model: str, boxes: list[str], shots: Shots) -> Path:
    prompt = "You are a GUI agent.\n\n## User Instruction\ndo it\n"

    def look(link: str) -> dict[str, Any]:
        return {"role": "user", "content": [{"type": "image_url", "image_url": {"url": link}}]}

    replies = [f"Thought: now\nAction: click(start_box='{box}')" for box in boxes]
    links = [shots.url(0), *(f"shots/{i}.png" for i in range(1, len(boxes) + 1))]
    lines = [
        {"model": model},
        {"role": "user", "content": [{"type": "text", "text": prompt}]},
        *[
            line
            for link, reply in zip(
                links, [*replies, "Thought: over\nAction: finished(content='it is')"], strict=True
            )
            for line in (look(link), {"role": "assistant", "content": reply})
        ],
    ]
    write_lines(folder / "run.jsonl", lines)
    shots.files(folder / "shots", [f"{i}.png" for i in range(len(links))])
    return folder


def parquet(folder: Path, shots: Shots = SMALL) -> Path:
    """Parquet with the columns of markov-ai/computer-use."""
    row = {
        "task_id": "m1",
        "domain": "chrome",
        "instruction": "do it",
        "actions": shots.codes,
        "screenshots": _column(shots),
    }
    write_table(folder / "data" / "train-00000-of-00001.parquet", [row])
    return folder


def chat_code(folder: Path, shots: Shots = SMALL) -> Path:
    """Parquet with chat rows whose replies are code."""
    replies = [
        {"role": role, "content": text}
        for code in shots.codes
        for role, text in (
            ("user", "<image>\ndo it"),
            ("assistant", f"Now:\n```python\n{code}\n```"),
        )
    ]
    write_table(folder / "chat.parquet", [{"messages": replies, "images": _column(shots)}])
    return folder


def chat_calls(folder: Path, shots: Shots = SMALL) -> Path:
    """Parquet with chat rows whose replies are tool calls in 0..1000, as cua-lite has them."""
    messages: list[dict[str, Any]] = [
        {"role": "user", "content": [{"type": "text", "text": "do it"}]}
    ]
    for index, point in enumerate(shots.points(1000, 1000)):
        entries = {"actions": [{"action": "click", "coordinate": list(point), "button": "left"}]}
        call = {"type": "function", "function": {"name": "computer", "arguments": entries}}
        messages.append({"role": "tool", "content": [{"type": "image", "index": index}]})
        messages.append({"role": "assistant", "content": [], "tool_calls": [call]})
    messages.append({"role": "tool", "content": [{"type": "image", "index": len(shots.clicks)}]})
    messages.append({"role": "assistant", "content": [{"type": "text", "text": "Done."}]})
    write_table(
        folder / "cua.parquet", [{"messages": json.dumps(messages), "images": _column(shots)}]
    )
    return folder


def boxes(folder: Path, shots: Shots = SMALL) -> Path:
    """Parquet with a box a row, as ScreenSpot has them: two fortieths wide and high, around the
    clicks."""
    rows = [
        {
            "file_name": f"{i}.png",
            "bbox": [(x - 1) / 40, (y - 1) / 40, (x + 1) / 40, (y + 1) / 40],
            "instruction": "the button",
            "image": picture,
        }
        for i, ((x, y), picture) in enumerate(zip(shots.clicks, _column(shots), strict=False))
    ]
    write_table(folder / "spots.parquet", rows)
    return folder


def chat(folder: Path, shots: Shots = SMALL) -> Path:
    """Chat rows of LLaMA-Factory: code in pixels, a picture before each reply."""
    messages = [
        {"role": role, "content": text}
        for code in shots.codes
        for role, text in (("user", "<image>\ndo it"), ("assistant", code))
    ]
    names = [f"images/{i}.png" for i in range(len(shots.codes))]
    write_lines(folder / "train.jsonl", [{"messages": messages, "images": names}])
    shots.files(folder / "images", [f"{i}.png" for i in range(len(shots.codes))])
    return folder


def grounding(folder: Path, shots: Shots = SMALL) -> Path:
    """ScreenSpot-Pro: corners in pixels, two fortieths wide and high, around the clicks; and around
    the middle."""
    width, height = shots.size
    places = [*shots.clicks, (38, 20)]
    names = [f"linux/{i}.png" for i in range(len(places))]
    rows = [
        {
            "id": f"linux_{i}",
            "img_filename": name,
            "img_size": [width, height],
            "bbox": [
                (x - 1) * width // 40,
                (y - 1) * height // 40,
                (x + 1) * width // 40,
                (y + 1) * height // 40,
            ],
            "instruction": "do it",
            "platform": "linux",
            "application": "gimp",
            "ui_type": "icon",
        }
        for i, (name, (x, y)) in enumerate(zip(names, places, strict=True))
    ]
    write_json(folder / "annotations" / "gimp_linux.json", rows)
    shots.files(folder / "images" / "linux", [f"{i}.png" for i in range(len(places))])
    return folder


def cua(folder: Path, shots: Shots = SMALL) -> Path:
    """cua: a look, a click for each picture but the last, a wait; each screenshot is saved after
    its action."""
    home = folder / "2025-08-01_a-model_101500_ab12"
    message = {"role": "user", "content": "do it"}
    write_json(
        home / "metadata.json", {"trajectory_id": home.name, "kwargs": {"messages": [message]}}
    )
    clicks = [{"type": "click", "button": "left", "x": x, "y": y} for x, y in shots.pixels]
    number = 0
    for turn, action in enumerate([{"type": "screenshot"}, *clicks, {"type": "wait"}]):
        path = home / f"turn_{turn:03d}"
        write_json(path / f"{number:04d}_agent_response.json", {"model": "m", "response": {}})
        smallest = min(turn, len(clicks))
        (path / f"{number + 1:04d}_screenshot_after.png").write_bytes(shots.picture(smallest))
        item = {"type": "computer_call", "call_id": f"c{turn}", "action": action}
        write_json(
            path / f"{number + 2:04d}_computer_call_result.json", {"item": item, "result": []}
        )
        (path / f"{number + 3:04d}_screenshot_action.png").write_bytes(shots.picture(99 + turn))
        number += 4
    return folder


def atif(folder: Path, shots: Shots = SMALL) -> Path:
    """ATIF: a screenshot with the task, and one as the result of each step."""
    home = folder / "trial-1" / "agent"
    names = [f"images/{i}.png" for i in range(len(shots.clicks) + 1)]
    (home / "images").mkdir(parents=True)
    shots.files(home, names)
    values = [
        {"type": "image", "source": {"media_type": "image/png", "path": name}} for name in names
    ]
    steps: list[Any] = [
        {"step_id": 1, "source": "user", "message": [{"type": "text", "text": "do it"}, values[0]]}
    ]
    calls = [{"action": "left_click", "coordinate": [x, y]} for x, y in shots.pixels]
    for number, arguments in enumerate([*calls, {"action": "wait", "duration": 1}]):
        call = {"tool_call_id": "c", "function_name": "computer", "arguments": arguments}
        step = {"step_id": number + 2, "source": "agent", "message": "", "tool_calls": [call]}
        if number < len(calls):
            result = {"source_call_id": "c", "content": [values[number + 1]]}
            step["observation"] = {"results": [result]}
        steps.append(step)
    agent = {"name": "a-model", "version": "1"}
    record = {"schema_version": "ATIF-v1.7", "session_id": "s", "agent": agent, "steps": steps}
    write_json(home / "trajectory.json", record)
    return folder


def browser_use(folder: Path, shots: Shots = SMALL) -> Path:
    """browser-use: the elements are named by their number."""
    names = [f"step_{i + 1}.png" for i in range(len(shots.clicks) + 1)]
    shots.files(folder / "screenshots", names)
    actions: list[Any] = [{"click": {"index": 7}} for _ in shots.clicks]
    history = [
        {
            "model_output": {"memory": "", "next_goal": "", "action": [action]},
            "result": [],
            # The path on the machine that recorded it.
            "state": {
                "url": "https://a.example",
                "screenshot_path": f"/tmp/agent-1/screenshots/{name}",
            },
        }
        for name, action in zip(
            names, [*actions, {"done": {"text": "ok", "success": True}}], strict=True
        )
    ]
    write_json(folder / "run.json", {"history": history})
    write_json(folder / "task.json", {"instruction": "do it"})
    return folder


def aitz(folder: Path, shots: Shots = SMALL) -> Path:
    """AITZ: fractions, y before x."""
    home = folder / "GENERAL-1"
    points = [[y / shots.size[1], x / shots.size[0]] for x, y in shots.pixels]
    steps = [
        {"result_action_type": 4, "result_touch_yx": json.dumps(p), "result_lift_yx": json.dumps(p)}
        for p in points
    ]
    end = {
        "result_action_type": 10,
        "result_touch_yx": "[-1.0, -1.0]",
        "result_lift_yx": "[-1.0, -1.0]",
    }
    records = [
        {
            "episode_id": "1",
            "step_id": number,
            "instruction": "do it",
            "image_path": f"general/GENERAL-1/GENERAL-1_{number}.png",
            "result_action_text": "",
            **step,
        }
        for number, step in enumerate([*steps, end])
    ]
    write_json(home / "GENERAL-1.json", records)
    shots.files(home, [f"GENERAL-1_{i}.png" for i in range(len(records))])
    return folder


def guiact(folder: Path, shots: Shots = SMALL) -> Path:
    """GUIAct, several steps on pages: fractions beside pixels."""
    width, height = shots.size
    labels: list[Any] = [
        [
            {
                "name": "click",
                "point": {
                    "related": f"<point>{x / width:.3f}, {y / height:.3f}</point>",
                    "absolute": f"<point>{x}, {y}</point>",
                },
            }
        ]
        for x, y in shots.pixels
    ]
    records = [
        {
            "uid": f"uid_record_00001_step_{number:02d}",
            "image_id": f"uid_record_00001_step_{number:02d}",
            "image_size": {"width": width, "height": height},
            "question": "do it",
            "actions_label": label,
        }
        for number, label in enumerate([*labels, [{"name": "answer", "text": "ok"}]])
    ]
    write_json(folder / "web-multi_test_data.json", records)
    shots.files(folder / "images", [f"{record['image_id']}.png" for record in records])
    return folder


def gui_odyssey(folder: Path, shots: Shots = SMALL) -> Path:
    """GUI-Odyssey: 0..1000."""
    clicks = [{"action": "CLICK", "info": [list(point)]} for point in shots.points(1000, 1000)]
    steps = [
        {"step": i, "screenshot": f"e1_{i}.png", "ps": "", **step}
        for i, step in enumerate([*clicks, {"action": "COMPLETE", "info": ""}])
    ]
    task = {"category": "Multi_Apps", "app": ["Chrome"], "task": "do", "instruction": "do it"}
    device = {"device_name": "Pixel 7 Pro", "w": shots.size[0], "h": shots.size[1]}
    record = {
        "episode_id": "e1",
        "device_info": device,
        "task_info": task,
        "step_length": len(steps),
        "steps": steps,
    }
    write_json(folder / "annotations" / "e1.json", record)
    shots.files(folder / "screenshots", [step["screenshot"] for step in steps])
    return folder


def android_control(folder: Path, shots: Shots = SMALL) -> Path:
    """AndroidControl, converted to a JSON an episode: pixels."""
    actions = [
        *({"action_type": "click", "x": x, "y": y} for x, y in shots.pixels),
        {"action_type": "navigate_home"},
    ]
    names = [f"{i}.png" for i in range(len(actions) + 1)]
    record = {"episode_id": 7, "goal": "do it", "screenshots": names, "actions": actions}
    write_json(folder / "7.json", record)
    shots.files(folder / "screenshots", names)
    return folder


def runs(folder: Path, shots: Shots = SMALL) -> Path:
    """A run of the live benchmark with one episode."""
    home = folder / "episodes" / "find_it-0__clean__s0__me"
    record = {
        "id": home.name,
        "instruction": "do it",
        "apps": ["chrome"],
        "sample": "find_it-0",
        "status": "ok",
    }
    steps = [
        {
            "step": k,
            "image": f"frames/000{k}.png",
            "raw": code,
            "code": code,
            "boxes": [],
            "events": [],
        }
        for k, code in enumerate([*shots.codes, None])
    ]
    shots.files(home / "frames", [f"000{k}.png" for k in range(len(steps))])
    write_json(home / "episode.json", record)
    write_lines(home / "steps.jsonl", steps)
    return folder


def write_table(file: Path, rows: list[dict[str, Any]], group: int = 2) -> None:
    """Write a Parquet file with row groups of `group` rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), file, row_group_size=group)


def _column(shots: Shots) -> list[dict[str, Any]]:
    return [{"bytes": shots.picture(i), "path": None} for i in range(len(shots.clicks) + 1)]


FORMATS: dict[str, Callable[..., Path]] = {
    "agentnet": agentnet,
    "aitz": aitz,
    "android_control": android_control,
    "anthropic": anthropic,
    "atif": atif,
    "browser_use": browser_use,
    "chat": chat,
    "cua": cua,
    "gui_odyssey": gui_odyssey,
    "guiact": guiact,
    "jsonl": jsonl,
    "openai": openai,
    "osworld": osworld,
    "parquet": parquet,
    "runs": runs,
    "screenagent": screenagent,
    "ui_tars": ui_tars,
    "ui_tars_1.5": ui_tars_15,
    "webvoyager": webvoyager,
}
TABLES: dict[str, Callable[..., Path]] = {
    "chat_code": chat_code,
    "chat_calls": chat_calls,
    "boxes": boxes,
}
# They name no place on the picture.
PLACELESS = ("browser_use", "webvoyager")
# Sets whose recordings are one step each.
SETS: dict[str, Callable[..., Path]] = {"grounding": grounding}
