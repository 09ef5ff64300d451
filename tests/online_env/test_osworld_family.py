"""Tasks of OSWorld in a benchmark: how they are named, and what is refused before a run."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

import online_env
from hijack_data.cli import hijack
from hijack_data.errors import ConfigError, ParameterError
from online_env import tasks
from online_env.bench.config import Bench, load_bench, override
from online_env.bench.estimates import EPISODE_SECONDS, History, estimate, expected
from online_env.bench.jobs import Job
from online_env.bench.workers import load_references, references
from online_env.errors import DesktopError, MissingPackageError
from online_env.osworld import venv
from online_env.osworld.cache_files import list_cache_files
from online_env.osworld.file_tasks import OsworldFileTask, find_unplayable, task_class
from online_env.osworld.stage import LATE_FILES_S, SETUP_WAIT_S
from online_env.osworld.tasks import OsworldTask
from online_env.results import records
from online_env.results.reading import RunError
from online_env.tasks.hand import GiveUpError
from online_env.tasks.machines import MachineSettings
from pipelines.proof.run_checks.field_checks import head_problems

from support import needs


def write_task(folder: Path, name: str, **more: Any) -> Path:
    """Write a task of OSWorld, which needs nothing."""
    config = {
        "id": name,
        "instruction": f"Do {name}.",
        "related_apps": ["os"],
        "config": [],
        "evaluator": {"func": "infeasible"},
        **more,
    }
    path = folder / "examples" / "os" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(config))
    return path


@pytest.fixture(autouse=True)
def own_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks.TASKS, "entries", dict(tasks.TASKS.entries))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_task(tmp_path, "t-one")
    write_task(tmp_path, "t-two", evaluator={"func": "exact_match", "result": {"type": "vm_file"}})
    return tmp_path


@pytest.fixture(scope="module")
def osworld_venv() -> Path:
    return needs.osworld()


def bench_of(*words: str) -> Bench:
    return override(load_bench("embedded_small"), task=",".join(words))


def task_files(names: tuple[str, ...]) -> list[OsworldTask]:
    return [tasks.TASKS.get(name).file for name in names]


def test_a_folder_names_all_its_tasks_and_a_file_one(folder: Path) -> None:
    assert bench_of(str(folder)).tasks == ("t-one", "t-two")
    assert bench_of(str(folder / "examples" / "os" / "t-two.json")).tasks == ("t-two",)


@pytest.mark.parametrize("name", ["small", "write_note", "all"])
def test_names_of_ours_come_before_folders(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = bench_of(name).tasks
    (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path)
    assert bench_of(name).tasks == expected
    (tmp_path / "mine.yaml").write_text(
        f"tasks: {name if name != 'write_note' else '[write_note]'}\n"
    )
    assert load_bench(tmp_path / "mine.yaml").tasks == expected


def test_every_seed_is_the_same_task(folder: Path) -> None:
    bench_of(str(folder))
    result, second = tasks.get("t-one"), tasks.get("t-one", 7)
    assert result.id == second.id == "t-one"
    assert result.instruction == second.instruction == "Do t-one."
    assert (result.apps, result.domain, bool(result.infeasible)) == (("os",), "os", True)
    assert not tasks.get("t-two").infeasible


def test_a_run_records_what_judged_it(folder: Path, tmp_path: Path, monkeypatch) -> None:
    """Another version of OSWorld, or a checkout, may score the same state otherwise."""
    monkeypatch.setattr(venv, "DEFAULT", tmp_path / "venv")
    bench = bench_of(str(folder))
    assert "desktop_env" not in bench.to_data()["code"]
    package = tmp_path / "venv/lib/python3.11/site-packages/desktop_env"
    metric = package / "evaluators" / "metrics" / "general.py"
    provider = package / "providers" / "aws.py"
    digests: list[str] = []
    for file, text in ((metric, "1"), (provider, "1"), (metric, "2")):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        digests.append(bench.to_data()["code"]["desktop_env"]["sha256"])
    assert (digests[0] == digests[1], digests[1] == digests[2]) == (True, False)
    assert not list(head_problems({"config": bench.to_data()}, (), SimpleNamespace()))


def test_a_run_records_the_file_of_each_task(folder: Path) -> None:
    code = bench_of(str(folder)).to_data()["code"]
    assert set(code) - {"desktop_env"} == {"t-one", "t-two"}
    assert code["t-one"]["path"] == str(folder / "examples" / "os" / "t-one.json")
    write_task(folder, "t-one", instruction="Something else.")
    changed_task = task_class(code["t-one"]["path"])
    assert changed_task.source["sha256"] != code["t-one"]["sha256"]


def test_another_process_reads_the_files_again(folder: Path) -> None:
    listed = references(bench_of(str(folder)))
    assert [(entry.kind, entry.name) for entry in listed] == [("task", "t-one"), ("task", "t-two")]
    for entry in listed:
        del tasks.TASKS.entries[entry.name]
    load_references(listed)
    assert issubclass(tasks.TASKS.get("t-two"), OsworldFileTask)


def test_a_yaml_file_lists_them_by_path(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    file = folder / "examples" / "os" / "t-one.json"
    path.write_text(f"tasks: ['{file}']\nosworld_files: {folder}\n")
    bench = load_bench(path)
    assert (bench.tasks, bench.osworld_files) == (("t-one",), str(folder))
    assert bench.to_data()["osworld_files"] == str(folder)
    path.write_text(f"tasks: {folder}\n")
    assert load_bench(path).tasks == ("t-one", "t-two")
    path.write_text("tasks: [write_note]\nosworld_files: [x]\n")
    with pytest.raises(ConfigError, match="2:16: osworld_files must be a text"):
        load_bench(path)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("{", "not JSON"),
        ("", "is empty"),
        ('{"id": "bad"}', "instruction: must be a text"),
        ("[1]", "must hold an object"),
    ],
)
def test_a_file_that_is_no_task_is_named(content: str, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.json"
    path.write_text(content)
    with pytest.raises(ConfigError, match=problem):
        bench_of(str(path))


def test_two_files_with_one_id_are_refused(folder: Path, tmp_path: Path) -> None:
    bench_of(str(folder))
    second = write_task(tmp_path / "other", "t-one", instruction="Another revision.")
    with pytest.raises(ParameterError, match="'t-one' is taken"):
        bench_of(str(second))


def test_a_folder_without_tasks_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no task files"):
        bench_of(str(tmp_path))


def test_tasks_of_two_worlds_are_two_runs(folder: Path) -> None:
    bench_of(str(folder))
    assert tasks.find_family(["write_note"]) is None
    family = tasks.find_family(["t-one", "t-two"])
    assert family is not None
    assert family.title == "OSWorld"
    for names in (["t-one", "write_note"], ["write_note", "t-one"]):
        with pytest.raises(ParameterError, match="environment, write_note are not; make"):
            tasks.find_family(names)


def test_only_osworlds_environment_sets_up_and_judges(folder: Path) -> None:
    bench_of(str(folder))
    task: Any = tasks.get("t-two")
    with pytest.raises(DesktopError, match="hijack bench --tasks"):
        task.setup(None)
    with pytest.raises(DesktopError, match="judged by OSWorld's evaluator"):
        list(task.problems(None))


def test_the_oracle_has_scripts_for_some(folder: Path) -> None:
    bench_of(str(folder))

    class Quitter:
        def give_up(self, why: str) -> None:
            raise GiveUpError(why)

    hand: Any = Quitter()
    with pytest.raises(GiveUpError):
        tasks.get("t-one").oracle(hand)
    with pytest.raises(DesktopError, match="no script solves OSWorld's task t-two"):
        tasks.get("t-two").oracle(hand)


def test_a_missing_environment_is_named_with_its_remedy(folder: Path, tmp_path: Path) -> None:
    listed = task_files(bench_of(str(folder)).tasks)
    with pytest.raises(MissingPackageError, match="hijack osworld setup"):
        find_unplayable(listed, None, folder=tmp_path / "none")


def test_missing_files_are_named_before_a_run(folder: Path, tmp_path: Path, osworld_venv) -> None:
    files = [{"url": "https://a.test/x.txt", "path": "/home/user/x.txt"}]
    path = write_task(
        folder, "t-three", config=[{"type": "download", "parameters": {"files": files}}]
    )
    listed = task_files(bench_of(str(path)).tasks)
    reasons = find_unplayable(listed, None, folder=osworld_venv)
    assert "1 files are not in a cache, such as t-three/" in reasons["t-three"]
    # OSWorld downloads them on machines that have the internet, unless the user has a cache.
    on_machines = MachineSettings(vm=("docker",))
    assert find_unplayable(listed, None, on_machines, osworld_venv) == {}
    cache = tmp_path / "cache"
    cache.mkdir()
    assert "t-three" in find_unplayable(listed, cache, on_machines, osworld_venv)
    ((cached_path,),) = [[file.path for file in list_cache_files(listed[0])]]
    (cache / cached_path).parent.mkdir(parents=True)
    (cache / cached_path).write_text("x")
    assert find_unplayable(listed, cache, folder=osworld_venv) == {}


def test_tasks_that_an_embedded_desktop_cannot_judge_are_no_zeros_and_no_ones(
    folder: Path, osworld_venv
) -> None:
    settings = {"type": "execute", "parameters": {"command": "gsettings reset-recursively org.x"}}
    write_task(folder, "t-gnome", config=[settings])
    one_untouched = "99146c54-4f37-4ab8-9327-5f3291665e1e"
    write_task(folder, one_untouched)
    listed = task_files(bench_of(str(folder)).tasks)
    reasons = find_unplayable(listed, None, folder=osworld_venv)
    assert reasons["t-gnome"].startswith("GNOME's settings or its file manager: not on an embedded")
    assert reasons[one_untouched].endswith("desktop: scores 1 untouched (play it with --vm)")
    assert find_unplayable(listed, None, MachineSettings(vm=("docker",)), osworld_venv) == {}


def test_a_run_goes_on_where_its_cache_of_files_is_elsewhere(tmp_path: Path) -> None:
    def config(cache: str, *unplayable: str) -> dict[str, Any]:
        reasons = {task: {"reason": f"1 files are not in {cache}"} for task in unplayable}
        return {"osworld_files": cache, "unplayable": reasons, "tasks": ["t-one"]}

    records.create(tmp_path / "run", config("/a", "t-two"), ["x"]).release()
    assert records.check_folder(tmp_path / "run", config("/b", "t-two"), ["x"], goes_on=True)
    with pytest.raises(RunError, match="is another run: unplayable"):
        records.check_folder(tmp_path / "run", config("/b", "t-3"), ["x"], goes_on=True)


def test_an_estimate_counts_the_waits_of_osworlds_runs_and_the_steps_of_machines(
    folder: Path,
) -> None:
    launch = {"type": "launch", "parameters": {"command": ["mousepad"]}}
    rule = {"func": "exact_match", "result": {"type": "rule"}}
    paths = [write_task(folder, "t-launch", config=[launch], evaluator=rule)]
    paths.append(write_task(folder, "t-bare"))
    bench = bench_of(",".join(map(str, paths)))
    listed = [Job("gpt-4o", name, "clean", 0) for name in bench.tasks]
    here = expected(bench, listed, History())
    assert here[0].seconds - here[1].seconds == SETUP_WAIT_S + LATE_FILES_S  # 1: infeasible
    on_machines = replace(bench, machines=MachineSettings(vm=("docker",)), max_steps=15)
    (first, _) = expected(on_machines, listed, History())
    assert first.seconds == EPISODE_SECONDS + SETUP_WAIT_S + LATE_FILES_S + 15 * 3.5
    assert estimate(on_machines, listed).endswith("; without that of the machines' reverts")


def test_missing_packages_are_named_before_a_run(folder: Path, osworld_venv) -> None:
    unknown = write_task(folder, "t-three", evaluator={"func": "no_such_metric"})
    listed = task_files(bench_of(str(unknown)).tasks)
    reasons = find_unplayable(listed, None, folder=osworld_venv)
    assert "no metric no_such_metric" in reasons["t-three"]
    assert "a checkout of OSWorld may have a function: --osworld DIR" in reasons["t-three"]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--engine", "ray"], "leave out --engine ray"),
        (["--tasks", "write_note,{file}"], "make a run of each"),
    ],
)
def test_the_command_refuses_what_it_cannot_play(
    words: list[str], problem: str, folder: Path, tmp_path: Path
) -> None:
    file = folder / "examples" / "os" / "t-one.json"
    needs.osworld_at_default()
    options = ["--tasks", str(file), *(word.format(file=file) for word in words)]
    result = CliRunner().invoke(
        hijack, ["bench", "embedded_small", *options, "--out", str(tmp_path / "run")]
    )
    assert problem in str(result.exception)
    assert not (tmp_path / "run").exists()


def test_a_run_of_a_task_of_ours_loads_nothing_of_osworld(tmp_path: Path) -> None:
    command = ["bench", "embedded_small", "--agent", "oracle", "--tasks", "write_note"]
    code = f"""
import sys
from hijack_data.cli import hijack
words = {[*command, "--dry-run", "--out", str(tmp_path / "run")]!r}
hijack(words, standalone_mode=False)
sys.exit(any(name.startswith("online_env.osworld") for name in sys.modules))
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (process.returncode, process.stderr) == (0, "")
    assert "episodes" in process.stdout


def test_only_the_table_of_families_names_the_package() -> None:
    """And the registry of providers, and the public names, of which one is a stage of OSWorld."""
    package = Path(online_env.__file__).parent
    pattern = re.compile(r"online_env[./]osworld\b|from \.\.+osworld\b|\"\.osworld\b")
    naming = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if "osworld" not in path.relative_to(package).parts[:1]
        and pattern.search(path.read_text(encoding="utf-8"))
    }
    assert naming == {"__init__.py", "bench/providers.py", "tasks/families.py"}
