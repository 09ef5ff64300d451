"""A small run log as `hijack bench` writes it: contract of `run.json`, `records.jsonl` and
`episodes/`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from hijack_data.runs.run_log import VERSION, sha256_hex

SIZE = (320, 200)


def lines_of(path: Path, rows: list[dict[str, Any]]) -> None:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def make_run(folder: Path) -> Path:
    """Two episodes of three observations: one clean, one corrupted that fails; the agent saw the
    clean screen first."""
    folder.mkdir()
    run = {
        "format": "agenthijack-run",
        "version": VERSION,
        "config": {},
        "versions": {},
        "created": "2026-01-01",
    }
    (folder / "run.json").write_text(json.dumps(run))
    before = (folder / "run.json").read_bytes()
    records = []
    for corruption, score in (("clean", 1.0), ("app_minimization", 0.0)):
        record = episode(folder, corruption, score) | {"previous": sha256_hex(before)}
        before = json.dumps(record).encode()
        records.append(record)
    lines_of(folder / "records.jsonl", records)
    return folder


def episode(folder: Path, corruption: str, score: float) -> dict[str, Any]:
    """Write one episode and return its record."""
    slug = f"write_note__{corruption}__s0__oracle"
    home = folder / "episodes" / slug
    (home / "frames").mkdir(parents=True)
    steps = [step(home, k, corruption) for k in range(3)]
    lines_of(home / "steps.jsonl", steps)
    record = {
        "version": VERSION,
        "id": slug,
        "agent": "oracle",
        "task": "write_note",
        "task_seed": 0,
        "instruction": "Write a note",
        "corruption": corruption,
        "seed": 0,
        "attempt": 0,
        "status": "ok",
        "score": score,
        "reason": "the note is there" if score else "there is no note",
        "steps": 2,
    }
    (home / "episode.json").write_text(json.dumps(record))
    return record


def step(home: Path, k: int, corruption: str) -> dict[str, Any]:
    """Write the frames of one observation and return its line."""
    calls = f"frames/{k:04d}.seen.png" if corruption != "clean" and k else None
    Image.fromarray(np.full((*SIZE[::-1], 3), 200, np.uint8)).save(home / f"frames/{k:04d}.png")
    if calls:
        Image.fromarray(np.full((*SIZE[::-1], 3), 40 * k, np.uint8)).save(home / calls)
    event = {"step": k, "effect": "minimise", "record": {"windows": 2}}
    return {
        "step": k,
        "image": f"frames/{k:04d}.png",
        "seen": calls,
        "plan": {"corruption": corruption} if calls else None,
        "raw": f"pyautogui.click({100 + k}, 50)" if k < 2 else None,
        "code": f"pyautogui.click({100 + k}, 50)" if k < 2 else None,
        "error": None,
        "events": [event] if calls and k == 1 else [],
    }


def records_of(folder: Path) -> list[dict[str, Any]]:
    """What `episode.json` holds in each episode of a run."""
    return [json.loads(path.read_text()) for path in sorted(folder.glob("episodes/*/episode.json"))]
