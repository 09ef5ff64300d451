"""Recordings and planners for tests of what happens to the machine."""

import json
from pathlib import Path
from typing import Any

import hijack_data as hj

FIVE = ("multi_apps", "accidental_touch", "app_minimization", "network_error", "verification")
COMBINED: dict[str, Any] = {
    "locked": hj.Sequence(
        [hj.Subtitle(subtitle_text="hello", font_size=12, padding=5), hj.Verification()]
    ),
    "half": hj.Sequence([hj.Resolution(), hj.AppMinimization(step=1)]),
    "dots": hj.Sequence([hj.AccidentalTouch(step=(1, 2)), hj.Marks(number=4, mark_size=8)]),
    "mix": hj.OneOf([hj.Verification(step=hj.plugin.Every(1)), hj.Marks(number=3, mark_size=6)]),
    "both": hj.Sequence(
        [hj.AccidentalTouch(step=2), hj.AppMinimization(step=2), hj.Verification(step=2)]
    ),
    "late": hj.Schedule(lambda epoch: hj.MultiApps(step=2)),
    "clash": hj.Sequence([hj.Verification(), hj.NetworkError()]),
}


def with_apps(folder: Path, apps: list[str], **more: Any) -> Path:
    """Say in every line of a recording which applications it uses, and more, each from the line."""
    rows = [json.loads(line) for line in (folder / "trajectories.jsonl").read_text().splitlines()]
    lines = [
        json.dumps({**row, "apps": apps, **{k: v(row) for k, v in more.items()}}) + "\n"
        for row in rows
    ]
    (folder / "trajectories.jsonl").write_text("".join(lines))
    return folder
