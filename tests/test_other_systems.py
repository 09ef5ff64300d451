"""What works where the machine is no Linux, as far as that can be simulated on one: what Python
lacks there is taken away, and the system's name is another. What does not work says so.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pipelines import build

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = ROOT / "examples" / "recordings"
SCREEN = RECORDINGS / "images" / "notes-04.png"
# What Python has on Linux alone, and what it has on Linux and macOS.
LINUX = ["sched_getaffinity"]
POSIX = ["geteuid", "getuid", "getegid", "getgid", "fork", "pread", "pwrite", *LINUX]
POSIX += ["O_NOFOLLOW", "O_DIRECTORY", "O_CLOEXEC", "sysconf"]
MODULES = ["fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog"]
# The frameworks load libraries by the name of the system, and this is another one.
FRAMEWORKS = ["torch", "torchvision", "jax"]
PICTURES = {
    "--help": "",
    "list": "",
    f"apply {SCREEN} marks -o {{out}}/m.png": "",
    f"gallery {SCREEN} -o {{out}}/g.html --corruptions marks": "",
    "stats {data}": "",
    "verify {data}": "",
    "doctor": "needs Linux; use a desktop of your own",
}
ROWS = {
    f"build {RECORDINGS} --out {{out}}/d --corruptions marks --limit 1": "",
    "score {data} --agent fail --out {out}/run": "",
    "report {out}/run": "",
    "desktop list": "",
    "desktop doctor": "use a desktop of your own over HTTP (docs/bring_your_own_vm.md)",
    "desktop up --name never": "an embedded desktop needs Linux, and this is Darwin",
    "bench embedded_small --dry-run": "",
}
REFUSED = {
    f"build {RECORDINGS} --out {{out}}/d --corruptions marks --limit 1": "use Linux, macOS or WSL",
    "score {data} --agent fail --out {out}/run": "use Linux, macOS or WSL",
    "desktop up --name never": "use Linux, or WSL on Windows",
    "bench embedded_small --dry-run": "use Linux, or WSL on Windows",
}
SYSTEMS = {"Darwin": (LINUX, [], PICTURES | ROWS), "Windows": (POSIX, MODULES, PICTURES | REFUSED)}


@pytest.mark.parametrize("system", SYSTEMS)
def test_what_works_on_another_system_and_what_says_that_it_does_not(system: str, tmp_path: Path):
    pytest.importorskip("gymnasium", reason="needs the extra [online]; make env")
    functions, modules, commands = SYSTEMS[system]
    places = {"out": tmp_path / "out", "data": tmp_path / "data"}
    places["out"].mkdir()
    build(RECORDINGS, places["data"], corruptions="marks", limit=1)
    order: dict[str, Any] = {
        "system": system,
        "functions": functions,
        "modules": modules + FRAMEWORKS,
        "commands": {words: words.format_map(places).split() for words in commands},
        "code": {},
    }
    process = subprocess.run(
        [sys.executable, ROOT / "tests" / "support" / "lacking.py", json.dumps(order)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    for words, result in json.loads(process.stdout.splitlines()[-1]).items():
        assert result["error"] == "", f"{words}: {result['printed']}"
        assert commands[words] in result["printed"], words
        works = not commands[words] or words == "doctor"
        assert (result["code"] in (None, 0)) == works, f"{words}: {result['printed']}"
