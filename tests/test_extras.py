"""Without an extra: what can work does, and all else says in one line how to add the extra."""

import importlib.metadata
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from hijack_data import extras
from hijack_data.cli import COMMANDS, doctor_rows, main
from hijack_data.errors import MissingDependencyError
from pipelines import build

from support.runlog import make_run

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = ROOT / "examples" / "recordings"
SCREEN = RECORDINGS / "images" / "notes-04.png"
WORKS, LACKS = "works", "online"
Results: TypeAlias = dict[str, dict[str, Any]]
# What is expected of each command without the extra `online`; {run} is a finished run.
COMMANDS_WITHOUT_ONLINE = {
    "--help": WORKS,
    "--version": WORKS,
    "list": WORKS,
    "show marks": WORKS,
    f"apply {SCREEN} marks -o {{out}}/m.png": WORKS,
    f"gallery {SCREEN} -o {{out}}/g.html --corruptions marks --detect none": WORKS,
    "demo --help": WORKS,
    f"check {ROOT}/tests/ext_package/dead_pixels.py --no-desktop": WORKS,
    "new corruption dust -o {out}/dust.py": WORKS,
    "doctor": WORKS,
    f"build {RECORDINGS} --out {{out}}/d --corruptions marks --limit 1": WORKS,
    f"inspect {RECORDINGS} --corruptions marks": WORKS,
    "verify {out}/d": WORKS,
    "verify {data}": WORKS,
    "sign --help": WORKS,
    "stats {out}/d": WORKS,
    "export {out}/d --to chat --out {out}/chat": WORKS,
    "view {out}/d": WORKS,
    "view {run}": WORKS,
    "report {run}": WORKS,
    "report {run} --json": WORKS,
    "score --help": WORKS,
    "train --help": WORKS,
    "bench embedded_small --dry-run": LACKS,
    "bench embedded_small --out {out}/run": LACKS,
    "serve embedded_small --dry-run": "serve",
    "mcp --browser": "mcp",
    "browser --help": WORKS,
    "search --help": WORKS,
    "mine --help": WORKS,
    "compare {run} {run}": LACKS,
    "certify {run}": LACKS,
    "gate {run} --fail-under success=0": WORKS,
    "leaderboard {run} -o {out}/board.html": LACKS,
    "tasks": LACKS,
    "osworld tasks {tasks} --out {out}/tasks.jsonl": WORKS,
    "osworld prefetch {tasks} --out {out}/cache": LACKS,
    "osworld --help": WORKS,
    "osworld check {tasks} --out {out}/results.json": LACKS,
    "desktop --help": WORKS,
    "desktop list": WORKS,
    "desktop doctor": LACKS,
    "desktop up --name never": LACKS,
    "desktop record --task write_note -o {out}/rec": LACKS,
    "desktop record --assets {out}/pack --only lock_screen": LACKS,
}
CODE_WITHOUT_ONLINE = {
    "from online_env import CorruptedEnv": LACKS,
    "from online_env import register_envs": LACKS,
    "from online_env.environment import SmallTasks": LACKS,
    "from online_env import tasks": WORKS,
    "from online_env.osworld.prefetch import prefetch": LACKS,
    "from online_env.embedded import desktop; desktop.EmbeddedDesktop.up()": LACKS,
    "from online_env.effects import elements as e; e.live_elements('<a/>', (9, 9))": WORKS,
    "from online_env.desktops import http; http.HttpDesktop('http://127.0.0.1:9').close()": WORKS,
    "from pipelines import build, open_dataset, verify": WORKS,
    "import pathlib; from hijack_data.cli import demo_command;"
    " assert demo_command.corrupt_live_desktop(pathlib.Path('nine.png')) is False": WORKS,
}
SAYS_AND_GOES_ON = "hf, and goes on"
CORE_ALONE = {
    "--help": "",
    "list": "",
    f"apply {SCREEN} marks -o {{out}}/m.png": "",
    f"gallery {SCREEN} -o {{out}}/g.html --corruptions marks": "",
    f"check {ROOT}/tests/ext_package/dead_pixels.py --no-desktop": "",
    "doctor": "",
    "report {run}": "",
    f"build {RECORDINGS} --out {{out}}/d --corruptions marks --limit 1": "hf",
    "stats {data}": "hf",
    "view {data}": "hf",
    f"apply {SCREEN} accidental_touch -o {{out}}/m.png": "vision",
    f"gallery {SCREEN} -o {{out}}/g.html --detect ocr": "ocr",
    "demo --no-desktop --out {out}/demo": SAYS_AND_GOES_ON,
    "bench embedded_small --dry-run": "online",
}

CODE_WITH_CORE_ALONE = {"import hijack_data.transforms": "torch", "import hijack_data.grain": "jax"}


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What the commands read and where they write."""
    folder = tmp_path_factory.mktemp("lacking")
    (folder / "out").mkdir()
    task = folder / "tasks" / "examples" / "os" / "11111111-1111-4111-8111-111111111111.json"
    task.parent.mkdir(parents=True)
    infeasible = {"instruction": "x", "config": [], "evaluator": {"func": "infeasible"}}
    task.write_text(json.dumps({"id": task.stem, **infeasible}))
    build(RECORDINGS, folder / "data", corruptions="marks", limit=1)
    run = make_run(folder / "run")
    return {"out": folder / "out", "run": run, "tasks": folder / "tasks", "data": folder / "data"}


def without(modules: Any, places: dict[str, Path], commands: Any, code: Any = ()) -> Results:
    """What comes of commands and code in one Python that has none of `modules`."""
    order = {
        "modules": sorted(modules),
        "commands": {name: name.format_map(places).split() for name in commands},
        "code": {name: name for name in code},
    }
    command = [sys.executable, ROOT / "tests" / "support" / "lacking.py", json.dumps(order)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def no_online(places: dict[str, Path]) -> Results:
    brought = set(extras.extras()["online"]) - set(extras.extras()["hf"])  # README's line has `hf`
    return without(brought, places, COMMANDS_WITHOUT_ONLINE, CODE_WITHOUT_ONLINE)


@pytest.fixture(scope="module")
def core_alone(places: dict[str, Path]) -> Results:
    everything = {module for modules in extras.extras().values() for module in modules}
    return without(everything | {"triton", "torchvision"}, places, CORE_ALONE, CODE_WITH_CORE_ALONE)


def says(done: dict[str, Any], extra: str) -> bool:
    """Whether the remedy is there, as it is typed here."""
    return extras.remedy(extra) in done["printed"]


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        ("", "pip install 'agenthijack[hf,ray]'"),
        ("torn {", "pip install 'agenthijack[hf,ray]'"),
        ('{"dir_info": {"editable": true}, "url": "file:///a/b"}', "pip install -e '/a/b[hf,ray]'"),
        ('{"dir_info": {}, "url": "file:///a%20b"}', "pip install '/a b[hf,ray]'"),
        (
            '{"archive_info": {}, "url": "file:///x/agenthijack-0.1.0-py3-none-any.whl"}',
            "pip install 'agenthijack[hf,ray] @ file:///x/agenthijack-0.1.0-py3-none-any.whl'",
        ),
    ],
)
def test_the_remedy_adds_to_what_is_installed(origin: str, command: str) -> None:
    assert extras.install_command(["hf", "ray"], origin) == command


@pytest.mark.parametrize("words", COMMANDS_WITHOUT_ONLINE)
def test_a_command_without_online(words: str, no_online: Results) -> None:
    value = no_online[words]
    assert "Traceback" not in value["printed"], value["printed"]
    assert value["error"] == ""
    extra = COMMANDS_WITHOUT_ONLINE[words]
    if extra != WORKS:
        assert says(value, extra), value["printed"]
        assert value["code"] in (1, 2)
        errors = [
            line for line in value["printed"].splitlines() if line.startswith("hijack: error")
        ]
        assert len(errors) == (words != "desktop doctor"), value["printed"]
    else:
        assert value["code"] in (0, 1), value["printed"]
        assert words == "doctor" or not says(value, "online"), value["printed"]


@pytest.mark.parametrize("text", CODE_WITHOUT_ONLINE)
def test_code_without_online(text: str, no_online: Results) -> None:
    value = no_online[text]
    if CODE_WITHOUT_ONLINE[text] == LACKS:
        assert "'MissingDependencyError'" in value["error"]
        assert "'ImportError'" in value["error"]
        assert says(value, "online"), value["printed"]
    else:
        assert value["error"] == "", value["printed"]


@pytest.mark.parametrize("text", CODE_WITH_CORE_ALONE)
def test_code_with_the_core_alone(text: str, core_alone: Results) -> None:
    value = core_alone[text]
    assert "'MissingDependencyError'" in value["error"], value
    assert says(value, CODE_WITH_CORE_ALONE[text]), value["printed"]


@pytest.mark.parametrize("words", CORE_ALONE)
def test_a_command_with_the_core_alone(words: str, core_alone: Results) -> None:
    value, extra = core_alone[words], CORE_ALONE[words]
    assert value["error"] == "", value["printed"]
    if extra == SAYS_AND_GOES_ON:
        assert says(value, "hf"), value["printed"]
        assert value["code"] in (None, 0), value["printed"]
    elif extra:
        assert says(value, extra), value["printed"]
        assert value["code"] in (1, 2)
    else:
        assert value["code"] == 0, value["printed"]


def test_every_command_is_tried() -> None:
    commands = {words.split()[0] for words in COMMANDS_WITHOUT_ONLINE}
    assert set(COMMANDS) <= commands


def test_the_extras_are_those_of_the_project() -> None:
    """What is installed is what the file says; `make env` makes it so again."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(extras.extras()) == set(project["optional-dependencies"])
    entries = {name: set(modules) for name, modules in extras.extras().items()}
    assert {"Xlib", "multipart", "urllib3"} <= entries["online"]
    assert entries["vision"] == {"cv2"}
    assert {"torch", "transformers"} <= entries["train"]
    assert entries["online"] | entries["hf"] <= entries["all"]


def test_what_the_desktop_needs_is_in_its_extra() -> None:
    from online_env import extra

    assert set(extra.MODULES) <= set(extras.extras()[extra.EXTRA])


def test_a_module_leads_to_its_extra() -> None:
    assert extras.find_extra("starlette.routing") == "online"
    assert extras.find_extra("transformers") == "train"
    assert extras.find_extra("no_such_module") is None


def test_lacking_modules_are_named_and_what_is_there_is_loaded() -> None:
    assert extras.lacking(["json", "no_such_module", "numpy"]) == ["no_such_module"]
    with pytest.raises(MissingDependencyError, match=r"^x needs no_such: pip install .*\[hf\]'$"):
        extras.load("no_such.part", "x", "hf")
    assert extras.load("json.decoder", "x", "hf").__name__ == "json.decoder"
    with pytest.raises(MissingDependencyError, match="x needs no_such, nor_this: pip"):
        extras.require("x", "hf", ("no_such", "json", "nor_this"))


def test_without_an_installed_package_there_are_no_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "metadata", absent)
    extras.extras.cache_clear()
    try:
        assert extras.extras() == {}
        assert extras.find_extra("starlette") is None
        assert "not installed" in doctor_rows.extras_remedy()
    finally:
        extras.extras.cache_clear()


def test_doctor_has_a_row_for_every_extra_and_one_for_the_desktop() -> None:
    extra_names = set(extras.extras()) - {"all"}
    assert {row[1] for row in doctor_rows.extra_rows()} == extra_names == set(doctor_rows.PURPOSES)
    command = [sys.executable, "-m", "hijack_data.cli", "doctor", "--json"]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = {row["what"]: row for row in json.loads(process.stdout)["found"]}
    assert extra_names | {"core", "desktop"} <= set(rows)
    assert rows["core"]["ok"] is True
    assert rows["core"]["found"].startswith("Python 3.")


def test_doctor_prints_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["doctor"])
    lines = capsys.readouterr().out.splitlines()
    named = {line.split()[1] for line in lines if re.match(r"(ok|--)  ", line)}
    assert {"core", "desktop", "hf"} <= named


def test_the_remedy_is_composed_in_one_place() -> None:
    packages = ("hijack_data", "pipelines", "online_env")
    sources = [path for name in packages for path in (ROOT / name).rglob("*.py")]
    composing = [path for path in sources if "'agenthijack[" in path.read_text()]
    assert [str(path.relative_to(ROOT)) for path in composing] == ["hijack_data/extras.py"]
