"""Tries an installed wheel that has the core dependencies alone.

Run it in an empty folder, with `python -I`.
"""

import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path

BIN = Path(sys.executable).parent
HIJACK = [str(BIN / "hijack")]
MODULE = [sys.executable, "-m", "hijack_data"]


def ran(command: list[str], *words: str, code: int = 0) -> str:
    """What a command prints; ends with an error if its exit code is another one."""
    done = subprocess.run([*command, *words], capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    if done.returncode != code:
        sys.exit(f"{words} ended with {done.returncode}, not {code}:\n{said}")
    return said


def must(condition: bool, what: str) -> None:
    """End with an error if something is not so."""
    if not condition:
        sys.exit(f"not so: {what}")


def main() -> None:
    """Try what the core can do, and that the rest says what it needs."""
    version = importlib.metadata.version("agenthijack")
    must(f"hijack {version}" in ran(HIJACK, "--version"), "--version says the version")
    listed = json.loads(ran(MODULE, "list", "--json"))
    must(len(listed) == 9 + 5, "the nine and the set everyday are listed")
    nine = listed[:9]
    ran(HIJACK, "demo", "--no-desktop", "--out", "demo")
    for name in ("before_after.png", "gallery.html", "pop_ups.png"):
        must((Path("demo") / name).stat().st_size > 10_000, f"hijack demo writes {name}")
    for corruption in nine:
        words = ("apply", "demo/pop_ups.png", corruption["name"], "-o", "out.png")
        if corruption["name"] == "accidental_touch":
            said = ran(HIJACK, *words, code=2)
            must("agenthijack[vision]" in said, "what clicks an element says how to find some")
        else:
            ran(HIJACK, *words)
    said = ran(HIJACK, "build", "demo", "--out", "dataset", code=2)
    must("agenthijack[hf]" in said, "a command without its extra names the extra")
    folder = Path(importlib.metadata.distribution("agenthijack").locate_file(""))
    for package in ("hijack_data", "pipelines", "online_env"):
        must((folder / package / "py.typed").is_file(), f"{package} is marked as typed")
    print(f"Python {sys.version.split()[0]}: agenthijack {version} works with the core alone")


if __name__ == "__main__":
    main()
