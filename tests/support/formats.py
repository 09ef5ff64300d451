"""One small recording in each format that can be read: a click at (100, 50) of a 400x200 picture, then the end.

`FORMATS` maps the name of a format to a function that makes the recording in an empty folder.
"""

import base64
import json
from collections.abc import Callable
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
    blocks = np.random.default_rng(number).integers(0, 256, (height // 10, width // 10, 3), dtype=np.uint8)
    buffer = BytesIO()
    Image.fromarray(blocks.repeat(10, axis=0).repeat(10, axis=1)).save(buffer, "PNG")
    return buffer.getvalue()


def text_of(number: int = 0) -> str:
    """The same as base64."""
    return base64.b64encode(png(number)).decode()


def url(number: int = 0) -> str:
    """The same as a data: URL."""
    return f"data:image/png;base64,{text_of(number)}"


def write_lines(file: Path, records: list[Any]) -> None:
    """Write JSON Lines."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(json.dumps(record) + "\n" for record in records))


def write_json(file: Path, data: Any) -> None:
    """Write JSON."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(data, ensure_ascii=False))


def osworld(folder: Path, actions: list[Any] | None = None, initial: bool = True) -> Path:
    """OSWorld: result folder, pictures after the actions, the task's JSON under `examples`."""
    actions = ["pyautogui.click(100, 50)", "DONE"] if actions is None else actions
    task = folder / "pyautogui" / "screenshot" / "a-model" / "gimp" / TASK
    names = [f"step_{i}_20250801@100000{i:06d}.png" for i in range(1, len(actions) + 1)]
    write_lines(
        task / "traj.jsonl",
        [
            {"step_num": i, "action_timestamp": name[7:-4], "action": action, "screenshot_file": name, "done": False}
            for i, (action, name) in enumerate(zip(actions, names, strict=True), 1)
        ],
    )
    for i, name in enumerate([*(["initial_state.png"] if initial else []), *names]):
        (task / name).write_bytes(png(i + (not initial)))
    (task / "result.txt").write_text("1.0\n")
    (task / "runtime.log").write_text("...\n")
    about = {"id": TASK, "instruction": "make it brighter", "related_apps": ["gimp"]}
    write_json(folder / "examples" / "gimp" / f"{TASK}.json", about)
    return folder


def jsonl(folder: Path) -> Path:
    """Our plain format."""
    about = {"trajectory_id": "t", "instruction": "do it"}
    click = {"type": "click", "x": 100, "y": 50}
    code = "pyautogui.click(100, 50)"
    write_lines(
        folder / "trajectories.jsonl",
        [
            {**about, "step": 0, "image": "images/0.png", "action": click, "action_code": code},
            {**about, "step": 1, "image": "images/1.png", "action": {"type": "done"}, "action_code": "DONE"},
        ],
    )
    return _pictures(folder / "images", ["0.png", "1.png"], folder)


def agentnet(folder: Path) -> Path:
    """AgentNet: fractions."""
    steps = ["pyautogui.click(x=0.25, y=0.25)", "computer.terminate(status='success')"]
    traj = [{"index": i, "image": f"{i}.png", "value": {"code": code}} for i, code in enumerate(steps)]
    write_lines(folder / "a.jsonl", [{"task_id": "a", "instruction": "do it", "traj": traj}])
    return _pictures(folder / "images", ["0.png", "1.png"], folder)


def screenagent(folder: Path) -> Path:
    """ScreenAgent: pixels, `width` is x."""
    click = {"mouse_action_type": "click", "mouse_button": "left", "mouse_position": {"width": 100, "height": 50}}
    actions = [{"action_type": "MouseAction", **click}], [{"action_type": "EvaluateSubTaskAction", "situation": "ok"}]
    for i, listed in enumerate(actions):
        record = {
            "session_id": "s1",
            "task_prompt": "打开浏览器",
            "saved_image_name": f"{i}.jpg",
            "video_width": WIDTH,
            "video_height": HEIGHT,
            "actions": listed,
        }
        write_json(folder / "s1" / f"2023-12-20_19-31-3{i}.json", record)
    return _pictures(folder / "s1" / "images", ["0.jpg", "1.jpg"], folder)


def webvoyager(folder: Path) -> Path:
    """WebVoyager: marks, no coordinates."""
    asked = [{"type": "text", "text": "Now given a task: Find it.  Please interact with https://x.org"}]
    messages = [
        {"role": "system", "content": "be a robot"},
        {"role": "user", "content": asked},
        {"role": "assistant", "content": "Thought: a\n\nAction: Type [2]; green tea"},
        {"role": "user", "content": "Observation"},
        {"role": "assistant", "content": "Thought: Action: no\nAction: ANSWER; done"},
    ]
    write_json(folder / "taskX--1" / "interact_messages.json", messages)
    return _pictures(folder / "taskX--1", ["screenshot1.png", "screenshot2.png"], folder)


def openai(folder: Path) -> Path:
    """OpenAI: items of the Responses API, a line each."""
    click = {"type": "click", "button": "left", "x": 100, "y": 50}
    items = [
        {"role": "user", "content": [{"type": "input_text", "text": "do it"}]},
        {"type": "computer_call", "call_id": "c0", "action": {"type": "screenshot"}},
        {
            "type": "computer_call_output",
            "call_id": "c0",
            "output": {"type": "computer_screenshot", "image_url": url(0)},
        },
        {"type": "reasoning", "summary": []},
        {"type": "computer_call", "call_id": "c1", "action": click},
        {"type": "computer_call_output", "call_id": "c1", "output": {"type": "input_image", "image_url": url(1)}},
        {"type": "computer_call", "call_id": "c2", "action": {"type": "wait"}},
    ]
    write_lines(folder / "run.jsonl", items)
    return folder


def anthropic(folder: Path) -> Path:
    """Anthropic: messages, in one JSON body."""

    def use(name: str, given: dict[str, Any]) -> dict[str, Any]:
        return {"role": "assistant", "content": [{"type": "tool_use", "id": name, "name": "computer", "input": given}]}

    def result(name: str, number: int) -> dict[str, Any]:
        source = {"type": "base64", "media_type": "image/png", "data": text_of(number)}
        content = [{"type": "text", "text": "ok"}, {"type": "image", "source": source}]
        return {"role": "user", "content": [{"type": "tool_result", "tool_use_id": name, "content": content}]}

    messages = [
        {"role": "user", "content": "do it"},
        use("a", {"action": "screenshot"}),
        result("a", 0),
        use("b", {"action": "left_click", "coordinate": [100, 50]}),
        result("b", 1),
        use("c", {"action": "key", "text": "ctrl+s"}),
    ]
    write_json(folder / "run.json", {"model": "claude", "messages": messages})
    return folder


def ui_tars(folder: Path, model: str = "UI-TARS-7B-DPO", box: str = "(250,250)") -> Path:
    """UI-TARS 1.0: 0..1000."""
    prompt = "You are a GUI agent.\n\n## User Instruction\ndo it\n"
    lines = [
        {"model": model},
        {"role": "user", "content": [{"type": "text", "text": prompt}]},
        {"role": "user", "content": [{"type": "image_url", "image_url": {"url": url(0)}}]},
        {"role": "assistant", "content": f"Thought: now\nAction: click(start_box='{box}')"},
        {"role": "user", "content": [{"type": "image_url", "image_url": {"url": "shots/1.png"}}]},
        {"role": "assistant", "content": "Thought: over\nAction: finished(content='it is')"},
    ]
    write_lines(folder / "run.jsonl", lines)
    return _pictures(folder / "shots", ["0.png", "1.png"], folder)


def ui_tars_15(folder: Path) -> Path:
    """UI-TARS 1.5: pixels of the smart-resized picture, here 392x196."""
    return ui_tars(folder, "UI-TARS-1.5-7B", "<|box_start|>(98,49)<|box_end|>")


def parquet(folder: Path) -> Path:
    """Parquet with the columns of markov-ai/computer-use."""
    row = {
        "task_id": "m1",
        "domain": "chrome",
        "instruction": "do it",
        "actions": ["pyautogui.click(100, 50)", "DONE"],
        "screenshots": [{"bytes": png(0), "path": "0.png"}, {"bytes": png(1), "path": None}],
    }
    write_table(folder / "data" / "train-00000-of-00001.parquet", [row])
    return folder


def runs(folder: Path) -> Path:
    """A run of the live benchmark with one episode."""
    home = folder / "episodes" / "find_it-0__clean__s0__me"
    record = {"id": home.name, "instruction": "do it", "apps": ["chrome"], "sample": "find_it-0", "status": "ok"}
    codes = ["pyautogui.click(100, 50)", "DONE", None]
    steps = [
        {"step": k, "image": f"frames/000{k}.png", "raw": code, "code": code, "boxes": [], "events": []}
        for k, code in enumerate(codes)
    ]
    _pictures(home / "frames", [f"000{k}.png" for k in range(3)], folder)
    write_json(home / "episode.json", record)
    write_lines(home / "steps.jsonl", steps)
    return folder


def write_table(file: Path, rows: list[dict[str, Any]], group: int = 2) -> None:
    """Write a Parquet file with row groups of `group` rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(rows), file, row_group_size=group)


def _pictures(where: Path, names: list[str], folder: Path) -> Path:
    where.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(names):
        (where / name).write_bytes(png(number))
    return folder


FORMATS: dict[str, Callable[[Path], Path]] = {
    "agentnet": agentnet,
    "anthropic": anthropic,
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
