"""The code blocks of the documentation: what each one is, and the folder in which they run as
pasted.

A fence says what its block is by the words after its language:

    ```sh                      it is run
    ```sh desktop              it is run where there is a desktop
    ```sh tested-in FILE       that test, or that script, runs it
    ```sh no-run WHY           it is not run; its options, its files and its programs are looked up

Blocks of other languages (`text`, `yaml`, `json`, `toml`) are no commands.
"""

import json
import os
import re
import shutil
import stat
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SHELL, PYTHON, OTHER = ("sh", "console"), ("python", "py"), ("text", "yaml", "json", "toml")
RUN, DESKTOP, TESTED_IN, NO_RUN = "", "desktop", "tested-in", "no-run"
KINDS = (RUN, DESKTOP, TESTED_IN, NO_RUN)
ACTIVATE = ". .venv/bin/activate"
# What a clone holds; the packages are imported from where they are installed.
PARTS = ("benchmarks", "configs", "docs", "tests", "Makefile", "README.md")
RECORDED, STEPS = "trajectories.jsonl", 4
# Where a paste finds programs before the environment is active.
SYSTEM = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
_FENCE = re.compile(r"^( *)```([^\n]*)\n(.*?)^\1```", re.S | re.M)


@dataclass(frozen=True)
class Block:
    """One block: its page, its number there, its language, one of `KINDS` and the words after that,
    its text."""

    page: Path
    number: int
    language: str
    kind: str
    words: str
    text: str

    @property
    def name(self) -> str:
        """How a test calls it."""
        return f"{self.page.name}-{self.number}"

    @property
    def lines(self) -> list[str]:
        """Its commands, without comments."""
        stripped = (re.sub(r"(^|\s)#.*", "", line).strip() for line in self.text.splitlines())
        return [line for line in stripped if line]


def blocks_of(page: Path) -> list[Block]:
    """All blocks of a page, in order."""
    items: list[Block] = []
    for match in _FENCE.finditer(page.read_text(encoding="utf-8")):
        language, _, more = match[2].strip().partition(" ")
        kind, _, words = more.partition(" ")
        text = "".join(line.removeprefix(match[1]) for line in match[3].splitlines(keepends=True))
        items.append(Block(page, len(items), language, kind, words, text))
    return items


def python_blocks(kind: str) -> Iterator[Any]:
    """The Python blocks of a kind, as parameters of a test."""
    for page in PAGES:
        for block in blocks_of(page):
            if block.language in PYTHON and kind_of(block) == kind:
                yield pytest.param(block, id=block.name)


def kind_of(block: Block) -> str:
    """Its kind; Python that starts a desktop says so by itself."""
    if block.language in PYTHON and block.kind == RUN and "EmbeddedDesktop" in block.text:
        return DESKTOP
    return block.kind


def pages_with(*kinds: str) -> list[Path]:
    """The pages that have shell blocks of one of these kinds."""
    return [
        page
        for page in PAGES
        if any(b.language in SHELL and b.kind in kinds for b in blocks_of(page))
    ]


def clone(folder: Path) -> Path:
    """A folder that is, to a command, the root of a clone after `make env`."""
    for name in PARTS:
        (folder / name).symlink_to(ROOT / name)
    _examples(folder / "examples")
    programs = folder / ".venv" / "bin"
    programs.mkdir(parents=True)
    _program(programs / "hijack", '-c "from hijack_data.cli import main; main()"')
    _program(programs / "python", "")
    (programs / "activate").write_text(f'PATH="{programs}:$PATH"\n')
    return folder


def _examples(folder: Path) -> None:
    """The examples, of each recording the first steps alone: commands do with 12 pictures what they
    do with 23."""
    folder.mkdir()
    for path in (ROOT / "examples").iterdir():
        if path.name != "recordings":
            (folder / path.name).symlink_to(path)
    # copied: a source may not lead elsewhere
    file = shutil.copytree(ROOT / "examples" / "recordings", folder / "recordings") / RECORDED
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    kept_lines = [line for line in lines if json.loads(line)["step"] < STEPS]
    file.write_text("".join(kept_lines), encoding="utf-8")


def _program(path: Path, arguments: str) -> None:
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n')
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def surroundings(active: bool, folder: Path) -> dict[str, str]:
    """The environment of a paste; programs of ours are found only where the environment is
    active."""
    path = f"{folder / '.venv' / 'bin'}:{SYSTEM}" if active else SYSTEM
    ours = os.pathsep.join(
        dict.fromkeys([str(ROOT), *filter(None, os.environ.get("PYTHONPATH", "").split(":"))])
    )
    kept_values = {
        name: value for name, value in os.environ.items() if name not in ("VIRTUAL_ENV", "PATH")
    }
    return {**kept_values, "PATH": path, "PYTHONPATH": ours}


def run_python(code: str, folder: Path) -> str:
    """Run a block with warnings as errors; returns what it printed."""
    process = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=prepared(clone(folder)),
        env=surroundings(True, folder),
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout


def prepared(folder: Path) -> Path:
    """Add what docs/write_a_corruption.md asks its reader to write."""
    (folder / "my_corruption.py").write_text(_own_corruption())
    return folder


def _own_corruption() -> str:
    """The corruption of docs/write_a_corruption.md, which other pages check and load."""
    page = (ROOT / "docs" / "write_a_corruption.md").read_text()
    block = re.search(r"```python\n(.*?)```", page, re.S)
    assert block, "docs/write_a_corruption.md has no Python block"
    return block[1].partition("\nplan = ")[0]
