"""OSWorld's tasks on a machine that is reached by HTTP alone: all nine, and a trainer's rollouts."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import hijack_data as hj
from pipelines.train.adapters.driven_episode import DrivenEpisode
from pipelines.train.adapters.served_env import ServedEnv
from pipelines.train.rollouts import RolloutRequest
from pipelines.train.sampler import Draw
from pipelines.train.split import members

from support import needs

ROOT = Path(__file__).parents[2]
HIJACK = [sys.executable, "-m", "hijack_data.cli"]
EFFECTS = {"multi_apps", "accidental_touch", "app_minimization", "network_error", "verification"}
AGENT = """
class WaitsThenFails:
    def reset(self):
        self.steps = 0

    def predict(self, instruction, obs):
        self.steps += 1
        return "", ["FAIL" if self.steps > 4 else "WAIT"]
"""
TASK = {
    "instruction": "Do what cannot be done.",
    "related_apps": ["os"],
    "config": [{"type": "launch", "parameters": {"command": ["mousepad"]}}],
    "evaluator": {"func": "infeasible"},
}


@pytest.fixture
def machine(embedded_machine: None):
    """The address of a machine in another process, and the command that resets it."""
    needs.root("OSWorld's mode")
    process = subprocess.Popen(
        [sys.executable, "-m", "support.osworld_machine", "1280x720"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[1],
    )
    assert process.stdout is not None
    yield process.stdout.readline().strip(), process.stdout.readline().strip()
    process.communicate()


def write_task(folder: Path, name: str) -> None:
    path = folder / "examples" / "os" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({**TASK, "id": name}))


def test_one_task_under_all_nine(machine: tuple[str, str], tmp_path: Path) -> None:
    needs.osworld_at_default()
    address, reset = machine
    write_task(tmp_path / "tasks", "t-editor")
    agent = tmp_path / "agent.py"
    agent.write_text(AGENT)
    config = tmp_path / "bench.yaml"
    config.write_text("desktop: {provider: osworld, size: [1280, 720]}\nmax_steps: 15\n")
    run = tmp_path / "run"
    words = [config, "--vm", address, "--reset-command", reset, "--tasks", tmp_path / "tasks"]
    process = subprocess.run(
        [*HIJACK, "bench", *words, "--agent", f"{agent}:WaitsThenFails", "--out", run],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert process.returncode == 0, f"{process.stdout[-3000:]}\n{process.stderr[-2000:]}"
    records = [json.loads(line) for line in (run / "records.jsonl").read_text().splitlines()]
    ended = {record["corruption"]: record for record in records}  # the last attempt counts
    assert len(ended) == 10
    assert {(r["status"], r["score"]) for r in ended.values()} == {("ok", 1.0)}
    assert {label for label, record in ended.items() if record["effects"]} == EFFECTS
    for label in EFFECTS:
        probes = ended[label]["effects"][0]["record"]["probes"]
        assert probes
        assert all(probe["ok"] for probe in probes), label
    assert {r["desktop"]["machine"] for r in ended.values()} == {address}
    verified = subprocess.run(
        [*HIJACK, "verify", run], capture_output=True, text=True, timeout=300, check=False
    )
    assert verified.returncode == 0, verified.stdout[-3000:]


def test_a_trainer_plays_its_rollouts_there(machine: tuple[str, str], tmp_path: Path) -> None:
    """`hijack serve` on the machine, and the environment of configs/train/verl_served.yaml."""
    pytest.importorskip("openenv", reason=needs.SERVE)
    pytest.importorskip("prometheus_client", reason=needs.SERVE)
    needs.osworld_at_default()
    address, reset = machine
    training, held_out = (members(f"osworld/{side}")[0] for side in ("training", "held_out"))
    for name in (training, held_out):
        write_task(tmp_path / "tasks", name)
    (loop,) = yaml.safe_load((ROOT / "configs" / "train" / "verl_served.yaml").read_text())
    config = tmp_path / "bench.yaml"
    config.write_text("desktop: {provider: osworld, size: [1280, 720]}\n")
    words = [config, "--vm", address, "--reset-command", reset, "--tasks", tmp_path / "tasks"]
    corruptions = ",".join([*loop["corruptions"], "clean"])
    server = subprocess.Popen(
        [*HIJACK, "serve", *words, "--corruptions", corruptions, "--port", "0"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    try:
        line = server.stdout.readline()
        url = re.search(r"http://\S+?(?=,)", line)
        assert url is not None, line
        settings = {**loop["environment_args"], "addresses": url[0], "size": (720, 1280)}
        episode = DrivenEpisode(lambda: ServedEnv(**settings))
        for slot, planner in enumerate((hj.MultiApps(), hj.Marks())):
            draw = Draw(label=planner.label, planner=planner, key="")
            request = RolloutRequest(step=0, group=training, slot=slot, seed=7, draw=draw)
            observation = episode.reset(request)
            assert observation is not None, episode.finish().problem
            assert observation["screenshot"].shape == (720, 1280, 3)
            assert episode.step("WAIT") is not None
            assert episode.step("FAIL") is None
            rollout = episode.finish()
            assert (rollout.status, rollout.success, rollout.reward()) == ("ok", 1.0, 1.0)
        draw = Draw(label="clean", planner=None, key="")
        request = RolloutRequest(step=0, group=held_out, slot=0, seed=7, draw=draw)
        assert episode.reset(request) is None
        assert "held out" in episode.finish().problem
        episode.close()
        server.send_signal(signal.SIGTERM)
        assert server.wait(60) == 0
    finally:
        server.kill()
        server.communicate()
