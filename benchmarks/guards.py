"""What a guard gains and costs: the same episodes without and with it, on live desktops.

    python benchmarks/guards.py WITHOUT GUARDED ...   # pairs of runs that are there
    python benchmarks/guards.py --play OUT [--agent A,B] [--guard rules] [--tasks A,B] ...

The second form plays both runs into OUT, or continues them: OUT/without and OUT/GUARD. The agent
`endpoint` asks a model server that this script starts on the loopback: it answers with the actions
that the oracle took in the clean episodes of --solutions RUNS, step by step, whatever it is shown.
As a guard's model it finds nothing. It counts a token for every four characters and for every 28x28
pixels of a picture.

Prints a row for each agent and corruption: solved without and with the guard, the difference with
its 95 % interval, mean steps, tokens, and what the guard did. In clean episodes each of its
interventions is a false alarm.
"""

import argparse
import base64
import json
import re
import struct
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from statistics import fmean
from typing import Any

import yaml
from common import machine, table

from hijack_data.plan import CLEAN
from hijack_data.runs.run_log import EPISODES, STEPS
from online_env.report import formatting
from online_env.report.comparison import ComparedCell, compare_runs
from online_env.results import reading
from online_env.results.reading import Run

ENDPOINT = "endpoint"
HEADER = ("agent", "corruption", "episodes", "without", "guarded", "difference, 95 %", "steps")
FURTHER = ("tokens", "acted in", "reminded in", "what it found")
CHECK = "You look at the first screenshot"
SUMMARY = "A GUI agent works on a task"
PORT = 18480  # the same in every call, because a run names the digest of its agent file
CHARS_PER_TOKEN = 4
PIXELS_PER_TOKEN = 28 * 28
_TASK = re.compile(r"Task: (.*)", re.DOTALL)
_PAST_STEP = re.compile(r"Step \d+: ")
_PNG = "data:image/png;base64,"


class ModelServer:
    """A server of chat completions that answers with the recorded actions of the oracle.

    Args:
        solutions: the oracle's actions, by instruction.
    """

    def __init__(self, solutions: Mapping[str, Sequence[str]]) -> None:
        self._solutions = solutions

    def reply(self, messages: Sequence[Mapping[str, Any]]) -> str:
        """Return the answer to a request of the agent, or of a guard.

        Raises:
            KeyError: no recorded episode has the instruction.
        """
        texts = [(message["role"], text) for message in messages for text in _texts(message)]
        opening = next(text for role, text in texts if role == "user")
        if opening.startswith(CHECK):
            return "Thought: nothing is wrong.\nReminder: None"
        if opening.startswith(SUMMARY):
            return "The action was carried out."
        task = _TASK.match(opening)
        instruction = "" if task is None else task[1].partition("\n\n")[0].strip()
        past = sum(role == "assistant" or bool(_PAST_STEP.match(text)) for role, text in texts)
        actions = self._solutions[instruction]
        action = actions[past] if past < len(actions) else "DONE"
        return f"The next action of the solution.\n```python\n{action}\n```"


def _texts(message: Mapping[str, Any]) -> Iterator[str]:
    content = message["content"]
    if isinstance(content, str):
        yield content
        return
    for part in content:
        if part["type"] == "text":
            yield part["text"]


def count_tokens(messages: Iterable[Mapping[str, Any]]) -> int:
    """Return the tokens of a request by the rule above."""
    tokens = 0
    for message in messages:
        tokens += sum(len(text) for text in _texts(message)) // CHARS_PER_TOKEN
        for part in message["content"] if isinstance(message["content"], list) else ():
            if part["type"] == "image_url":
                head = base64.b64decode(part["image_url"]["url"].removeprefix(_PNG)[:32])
                width, height = struct.unpack(">II", head[16:24])  # of the chunk IHDR
                tokens += height * width // PIXELS_PER_TOKEN
    return tokens


@contextmanager
def serving(model: ModelServer) -> Iterator[str]:
    """Serve a model on the loopback; yield the address."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["content-length"])))
            text = model.reply(body["messages"])
            prompt_tokens, answered = count_tokens(body["messages"]), len(text) // CHARS_PER_TOKEN
            usage = {"prompt_tokens": prompt_tokens, "completion_tokens": answered}
            message = {"role": "assistant", "content": text}
            choice = {"index": 0, "finish_reason": "stop", "message": message}
            head = {"id": "1", "object": "chat.completion", "created": 0, "model": "solutions"}
            usage["total_tokens"] = prompt_tokens + answered
            answer = json.dumps({**head, "choices": [choice], "usage": usage}).encode()
            self.send_response(200)
            self.send_header("content-type", "application/json")
            self.send_header("content-length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

    server = ThreadingHTTPServer(("127.0.0.1", PORT), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{PORT}/v1"
    finally:
        server.shutdown()
        server.server_close()


def read_solutions(folder: Path) -> dict[str, tuple[str, ...]]:
    """Return the actions of the oracle's clean episodes that were solved, by instruction."""
    solutions: dict[str, tuple[str, ...]] = {}
    for record in reading.read(folder).records:
        if (record["agent"], record["corruption"], record["score"]) != ("oracle", CLEAN, 1.0):
            continue
        lines = (folder / EPISODES / record["id"] / STEPS).read_text().splitlines()
        actions = [json.loads(line)["raw"] for line in lines]
        solutions[record["instruction"].strip()] = tuple(a for a in actions if a is not None)
    return solutions


def play(folder: Path, config: Path, guard: str, desktops: int) -> None:
    """Play a benchmark, or what is missing of it."""
    words = [str(config), "--out", str(folder), "--desktops", str(desktops)]
    words += ["--guard", guard] if guard else []
    words += ["--resume"] if folder.exists() else []
    # The command ends with 1 if an episode could not be played; the table says so, too.
    subprocess.run([sys.executable, "-m", "hijack_data", "bench", *words], check=False)


def play_both(options: argparse.Namespace) -> tuple[Path, Path]:
    """Play the episodes without and with the guard; return the folders of the runs."""
    out: Path = options.play
    out.mkdir(parents=True, exist_ok=True)
    config = out / "bench.yaml"
    agents = [str(out / "endpoint.yaml") if a == ENDPOINT else a for a in options.agent.split(",")]
    settings = {
        "desktop": {"provider": "embedded", "size": [1920, 1080]},
        "agents": agents,
        "tasks": options.tasks.split(","),
        "corruptions": options.corruptions.split(","),
        "seeds": [0],
        "max_steps": options.max_steps,
    }
    config.write_text(yaml.safe_dump(settings, sort_keys=False))
    runs = out / "without", out / options.guard

    def play_pair() -> None:
        for folder, guard in zip(runs, ("", options.guard), strict=True):
            play(folder, config, guard, options.desktops)

    if ENDPOINT not in options.agent.split(","):
        play_pair()
        return runs
    with serving(ModelServer(read_solutions(options.solutions))) as address:
        (out / "endpoint.yaml").write_text(
            f"model: solutions\nbase_url: {address}\nprompt: pyautogui\nparser: pyautogui\n"
            "history: 15\n"
        )
        play_pair()
    return runs


def rows(without: Run, guarded: Run) -> Iterator[list[str]]:
    """Yield the row of each agent and corruption."""
    for cell in compare_runs(without, guarded).cells:
        pairs = list(_paired(without, guarded, cell))
        if pairs:
            yield [*_score_columns(cell), *_cost_columns(pairs), *_guard_columns(pairs)]


def _paired(
    without: Run, guarded: Run, cell: ComparedCell
) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Yield the records of a case in both runs, if both ended with a score."""

    def cases(run: Run, agent: str) -> dict[tuple[str, int], Mapping[str, Any]]:
        return {
            (record["task"], record["seed"]): record
            for record in run.last_attempts
            if (record["agent"], record["corruption"]) == (agent, cell.corruption)
            and record["score"] is not None
        }

    before, after = cases(without, cell.before), cases(guarded, cell.after)
    for case in before.keys() & after.keys():
        yield before[case], after[case]


def _score_columns(cell: ComparedCell) -> list[str]:
    change = formatting.percent(cell.difference, "+")
    return [
        Path(cell.before).stem,
        cell.corruption,
        str(cell.n),
        formatting.percent(cell.success_before),
        formatting.percent(cell.success_after),
        f"{change} {formatting.interval(cell.low, cell.high, '+')}",
    ]


def _cost_columns(pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> list[str]:
    steps = [f"{fmean(pair[side]['steps'] for pair in pairs):.1f}" for side in (0, 1)]
    tokens = [fmean(_tokens(pair[side]) for pair in pairs) for side in (0, 1)]
    token_text = f"{tokens[0]:.0f} → {tokens[1]:.0f}" if any(tokens) else ""
    return [" → ".join(steps), token_text]


def _tokens(record: Mapping[str, Any]) -> int:
    usage = record.get("usage") or {}
    return usage.get("input_tokens", 0) + usage.get("output_tokens", 0)


def _guard_columns(pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> list[str]:
    kinds: Counter[str] = Counter()
    acted = reminded = 0
    for _, record in pairs:
        interventions = record["guard"]["interventions"]
        acted += any(intervention["actions"] for intervention in interventions)
        reminded += any(not intervention["actions"] for intervention in interventions)
        kinds.update({intervention["kind"] for intervention in interventions})
    listed = ", ".join(f"{kind}: {count}" for kind, count in kinds.most_common())
    return [str(acted), str(reminded), listed]


def main() -> None:
    """Play if asked to, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="*", type=Path)
    parser.add_argument("--play", type=Path, metavar="OUT")
    parser.add_argument("--agent", default="pixel")
    parser.add_argument("--guard", default="rules")
    parser.add_argument("--tasks", default="register_course,rename_file,set_snapshots,write_note")
    parser.add_argument("--corruptions", default="clean,app_minimization,verification,app_freeze")
    parser.add_argument("--solutions", type=Path, metavar="RUNS")
    parser.add_argument("--max-steps", type=int, default=60)
    parser.add_argument("--desktops", type=int, default=1)
    options = parser.parse_args()
    runs = [*options.runs]
    if options.play:
        runs += play_both(options)
    lines: list[list[str]] = []
    for without, guarded in zip(runs[::2], runs[1::2], strict=True):
        lines += rows(reading.read(without), reading.read(guarded))
    print(f"{machine()}\n\n{table([*HEADER, *FURTHER], lines)}")


if __name__ == "__main__":
    main()
