"""Small datasets whose instructions say what is right, and agents that read them."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from pipelines import build

WIDTH, HEIGHT = 320, 200
BOX = (90, 40, 130, 60)
# The agent `Knows` clicks where the instruction says, in pixels of a picture of 320x200.
AGENTS = '''
import hashlib, inspect, json, os, signal, subprocess, sys, time
from pathlib import Path

HERE = Path(__file__).parent


def key_of(picture, instruction):
    return hashlib.sha256(picture.tobytes()).hexdigest() + instruction


def click(instruction, obs):
    x, y = (int(n) for n in instruction.split()[-1].split(","))
    height, width = obs["screenshot"].shape[:2]
    return [f"pyautogui.click({x * width // 320}, {y * height // 200})", "DONE"]


class Knows:
    def predict(self, instruction, obs):
        return "I know.", click(instruction, obs)


class ByBrightness(Knows):
    """Right on the clean pictures, whose red is never 255; a test makes the others so."""

    def predict(self, instruction, obs):
        if obs["screenshot"].shape[1] != 320:
            return "It is smaller.", ["FAIL"]
        return super().predict(instruction, obs)


class Slow(Knows):
    def predict(self, instruction, obs):
        time.sleep(0.05)
        with (HERE / "pids").open("a") as file:
            file.write(f"{os.getpid()}\\n")
        return super().predict(instruction, obs)


class Hostile(Knows):
    def predict(self, instruction, obs):
        word = instruction.split()[0]
        if word == "raise":
            raise ValueError("no idea")
        if word == "leave":
            raise SystemExit(0)
        if word == "hang":
            time.sleep(1000)
        if word == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if word == "exit":
            os._exit(0)
        if word == "fork":
            child = subprocess.Popen(["sleep", "1000"])
            (HERE / "child").write_text(str(child.pid))
            if os.fork() == 0:
                time.sleep(1000)
        if word == "print":
            print("to standard output")
            os.write(1, b"and to its file\\n")
        if word == "nonsense":
            return ["no", "pair", "at all"]
        if word == "nothing":
            return "I do not know.", []
        if word == "prose":
            return "", ["click the button"]
        if word == "lazy":
            return "", Lazy()
        if word == "change":
            obs["screenshot"][:] = 0
            obs.clear()
            return "", [f"pyautogui.click({instruction.split()[-1]})"]
        return super().predict(instruction, obs)


class Lazy(list):
    def __iter__(self):
        raise RuntimeError("not now")


class Batched(Knows):
    sizes = []

    def predict_batch(self, instructions, observations):
        if any(text.startswith("raise") for text in instructions):
            raise ValueError("one of them is bad")
        return [
            (f"{len(instructions)}", click(*pair)) for pair in zip(instructions, observations)
        ]


class Remembers(Knows):
    """Without reset: right at its first row only, so each row has to have a new object."""

    def __init__(self):
        self.rows = 0

    def predict(self, instruction, obs):
        self.rows += 1
        return super().predict(instruction, obs) if self.rows == 1 else ("", ["FAIL"])


class Resets(Remembers):
    made = 0

    def __init__(self):
        super().__init__()
        Resets.made += 1

    def reset(self):
        self.rows = 0

    def predict(self, instruction, obs):
        said, actions = super().predict(instruction, obs)
        return f"made {Resets.made}", actions


class Broken:
    def __init__(self):
        raise OSError("no such weights")

    def predict(self, instruction, obs):
        return "", ["DONE"]


class Nosy:
    """Says who calls it."""

    def predict(self, instruction, obs):
        return " ".join(frame.filename for frame in inspect.stack()), ["DONE"]


class Always(Knows):
    """An onlooker that always warns."""

    def check(self, picture):
        return "Reminder: look out."

    def summarise(self, before, action, after):
        assert before.ndim == after.ndim == 3
        return f"The agent {action}"


class Never(Always):
    def check(self, picture):
        return "Reminder: None"


class Informed(Always):
    """Knows the pictures that need a reminder from a file beside this one."""

    def check(self, picture):
        known = json.loads((HERE / "needed.json").read_text())
        return "wait" if hashlib.sha256(picture.tobytes()).hexdigest() in known else None


class Echo:
    """Answers with what was recorded for picture and task, from a file beside this one."""

    def predict(self, instruction, obs):
        known = json.loads((HERE / "recorded.json").read_text())
        return "", [known[key_of(obs["screenshot"], instruction)]]


class WrongOnlooker(Knows):
    def check(self, picture):
        return 3
'''


def record_steps(folder: Path, steps: list[dict], size: tuple[int, int] = (WIDTH, HEIGHT)) -> Path:
    """Record steps in the plain format; what a step leaves out is a click on `BOX`."""
    width, height = size
    (folder / "images").mkdir(parents=True)
    lines = []
    for number, step in enumerate(steps):
        blocks = np.random.default_rng(number).integers(0, 250, (height // 10, width // 10, 3))
        picture = blocks.astype(np.uint8).repeat(10, axis=0).repeat(10, axis=1)
        Image.fromarray(picture).save(folder / f"images/{number}.png")
        line = {
            "trajectory_id": f"t{number}",
            "step": 0,
            "instruction": "click 100,50",
            "image": f"images/{number}.png",
            "action": {"type": "click", "x": 100, "y": 50},
            "target_box": BOX,
            "elements": [BOX],
        }
        lines.append(json.dumps({**line, **step}))
    (folder / "trajectories.jsonl").write_text("\n".join(lines) + "\n")
    return folder


def dataset(
    folder: Path, steps: list[dict], corruptions: str = "resolution:scale=0.5", **options: object
) -> Path:
    """Build a dataset of steps."""
    record_steps(folder / "source", steps)
    build(folder / "source", folder / "dataset", corruptions=corruptions, seed=7, **options)
    return folder / "dataset"


def write_agents(folder: Path) -> Path:
    """Write the agents into a file; one is named `FILE:Class`."""
    path = folder / "agents.py"
    path.write_text(AGENTS)
    return path
