"""OSWorld's tasks on machines of the user: every documented failure, failover, and refusals."""

import json
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from hijack_data.cli import hijack
from hijack_data.errors import ConfigError, ParameterError
from hijack_data.locking import lock
from online_env import HttpDesktop, tasks
from online_env.bench import machine_pool
from online_env.bench.config import Bench
from online_env.bench.jobs import Job
from online_env.bench.machine_pool import MachineFailureError, MachinePool
from online_env.bench.workers import WorkerSetup
from online_env.errors import DesktopError, GuestError, MissingPackageError
from online_env.osworld import machines
from online_env.osworld.bridge import worker
from online_env.osworld.env import TIMEOUTS_S
from online_env.osworld.file_tasks import MachineTasks
from online_env.tasks.machines import MachineSettings

from support import needs
from support.osworld_guests import SIZE, fake_guests, scripted_venv

HIJACK = [sys.executable, "-m", "hijack_data.cli"]
REVERT = "curl -sf -X POST -d '' \"$AGENTHIJACK_VM/revert\""
DOCKER = MachineSettings(vm=("docker",), options={"client_password": "of the guest"})
INFEASIBLE = {"func": "infeasible"}


@pytest.fixture(scope="module")
def osworld(tmp_path_factory) -> Path:
    data = tmp_path_factory.mktemp("data")
    (data / "agenthijack").mkdir()
    return scripted_venv(needs.osworld(), data / "agenthijack" / "osworld")


@pytest.fixture(autouse=True)
def own_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks.TASKS, "entries", dict(tasks.TASKS.entries))


def task_file(folder: Path, name: str, **more: Any) -> Path:
    content = {
        "id": name,
        "instruction": "x",
        "related_apps": ["os"],
        "config": [],
        "evaluator": INFEASIBLE,
        **more,
    }
    path = folder / "examples" / "os" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    def write(guest: str, fails: tuple[str, ...] = (), lacks: tuple[str, ...] = ()) -> Path:
        path = tmp_path / "script.json"
        path.write_text(json.dumps({"guest": guest, "fails": fails, "lacks": lacks}))
        monkeypatch.setenv("SCRIPTED_PROVIDER", str(path))
        return path

    return write


def docker(osworld: Path, monkeypatch, tmp_path: Path):
    monkeypatch.setattr(machines, "FOLDER", tmp_path / "machines")
    return machines.machine((SIZE[1], SIZE[0]), DOCKER, osworld)


def events(path: Path) -> list[str]:
    return Path(f"{path}.log").read_text().split()


def test_a_provider_reverts_between_episodes_and_ends_its_machine(
    osworld, script, tmp_path, monkeypatch
) -> None:
    task = tasks.TASKS.get(tasks.TASKS.find(str(task_file(tmp_path, "t-one"))))(0)
    with fake_guests(tmp_path, None) as (guest,):
        path = script(guest.address)
        with docker(osworld, monkeypatch, tmp_path) as desktop:
            stage = MachineTasks(desktop, None)
            assert stage.reset(task, 0).infeasible
            assert stage.reset(task, 0).infeasible
            assert stage.desktop.password == "of the guest"  # effects call sudo with it
            assert stage.evaluate(["FAIL"]).score == 1.0
            # Without a snapshot, OSWorld's provider says nothing.
            script(guest.address, lacks=("snapshot",))
            with pytest.raises(DesktopError, match="docker was not reverted"):
                stage.reset(task, 0)
            assert stage.was_not_reverted
            script(guest.address, fails=("revert",))
            with pytest.raises(DesktopError, match="RuntimeError: revert failed as in the script"):
                stage.reset(task, 0)
            broken = task_file(
                tmp_path, "t-broken", evaluator={"func": "exact_match", "result": {"type": "rule"}}
            )
            script(guest.address)
            stage._late_files = 0.0
            stage.reset(tasks.TASKS.get(tasks.TASKS.find(str(broken)))(0), 0)
            with pytest.raises(DesktopError, match="evaluate raised"):
                stage.evaluate(["DONE"])
            stage.reset(task, 0)
            urllib.request.urlopen(f"http://{guest.address}/revert", b"").close()  # another run's
            with pytest.raises(DesktopError, match="or used by another run, during the episode"):
                stage.evaluate(["FAIL"])
            assert not stage.hung_in_judging
            stage.reset(task, 0)
            monkeypatch.setitem(TIMEOUTS_S, "evaluate", 0.0)
            with pytest.raises(DesktopError, match="evaluate took over 0 s"):
                stage.evaluate(["FAIL"])
            assert stage.hung_in_judging
        assert events(path)[-1] == "stop"
        assert events(path).count("revert") == 6


def test_machines_of_one_image_start_one_after_the_other(
    osworld, script, tmp_path, monkeypatch
) -> None:
    """OSWorld downloads and unpacks the image without a lock."""
    with fake_guests(tmp_path, None) as (guest,):
        path = script(guest.address)
        context = docker(osworld, monkeypatch, tmp_path)
        machines.FOLDER.mkdir()
        with ThreadPoolExecutor(1) as pool:
            with lock(machines.FOLDER / machines.START_LOCK):
                start = pool.submit(context.__enter__)
                with pytest.raises(TimeoutError):
                    start.result(1.0)
                assert not Path(f"{path}.log").exists()
            assert start.result(60).machine_name == "docker"
        assert events(path)
        with lock(machines.FOLDER / machines.START_LOCK):  # only while it starts
            context.__exit__(None, None, None)


def test_a_machine_that_does_not_start_is_named(osworld, script, tmp_path, monkeypatch) -> None:
    script("127.0.0.1:9", fails=("start",))
    with (
        pytest.raises(DesktopError, match="RuntimeError: start failed as in the script"),
        docker(osworld, monkeypatch, tmp_path),
    ):
        pass
    path = script("127.0.0.1:9")  # starts, but nothing answers there
    with (
        pytest.raises(DesktopError, match="the guest gave no screenshot"),
        docker(osworld, monkeypatch, tmp_path),
    ):
        pass
    assert events(path)[-1] == "stop"


def test_code_whose_answer_is_lost_is_not_run_again(osworld, tmp_path) -> None:
    """OSWorld's own client would send it three times, and a text would be typed three times."""
    with fake_guests(tmp_path, None) as (guest,):
        settings = MachineSettings(vm=(f"http://{guest.address}",))
        with machines.machine((SIZE[1], SIZE[0]), settings, osworld) as desktop:
            guest.loses_answers = True
            with pytest.raises(GuestError, match="no answer"):
                desktop.run("open('/var/tmp/typed', 'a').write('x')")
            guest.loses_answers = False
            assert desktop.run("print(1)").output == "1\n"
    assert (tmp_path / "guest0" / "typed").read_text() == "x"


def test_less_than_is_typed_by_the_key_that_has_it(osworld, tmp_path) -> None:
    """OSWorld's own `step` mends two functions; an agent's code does not go through it."""
    with fake_guests(tmp_path, None) as (guest,):
        settings = MachineSettings(vm=(f"http://{guest.address}",))
        with machines.machine((SIZE[1], SIZE[0]), settings, osworld) as desktop:
            result = desktop.run("print(pyautogui.platformModule.keyboardMapping)")
        with HttpDesktop(f"http://{guest.address}") as plain:
            again = plain.run("print(pyautogui.platformModule.keyboardMapping)")
    assert {result.output, again.output} == {"{',': 59, '<': 59}\n"}


def test_a_file_that_the_guest_does_not_send_is_no_file_that_is_not_there(
    osworld, tmp_path
) -> None:
    evaluator = {
        "func": "exact_match",
        "result": {"type": "vm_file", "path": "/home/user/x", "dest": "x"},
        "expected": {"type": "rule", "rules": {"expected": "x"}},
    }
    task = json.loads(task_file(tmp_path, "t-file", evaluator=evaluator).read_text())
    with fake_guests(tmp_path, None) as (guest,):
        settings = MachineSettings(vm=(f"http://{guest.address}",))
        with machines.machine((SIZE[1], SIZE[0]), settings, osworld) as desktop:
            desktop.env.reset(task)
            assert desktop.evaluate() == 0  # the guest says that there is none
            guest.loses_answers = True
            with pytest.raises(DesktopError, match=r"POST /file.*a score of 0.0 may rest on that"):
                desktop.evaluate()


def test_another_screen_than_the_benchmarks_is_refused(
    osworld, script, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(machines, "FOLDER", tmp_path / "machines")
    with fake_guests(tmp_path, None) as (guest,):
        script(guest.address)
        with (
            pytest.raises(DesktopError, match="has 320x240 pixels, and the benchmark 1920x1080"),
            machines.machine((1080, 1920), MachineSettings(vm=("docker",)), osworld),
        ):
            pass


def bench(
    osworld: Path, folder: Path, vms: list[str], *words: str
) -> subprocess.CompletedProcess[str]:
    config = folder / "bench.yaml"
    config.write_text(f"desktop: {{provider: osworld, size: {list(SIZE)}}}\nmax_steps: 3\n")
    named = [word for vm in vms for word in ("--vm", vm)]
    return subprocess.run(
        [
            *(*HIJACK, "bench", str(config), *named, *words, "--tasks", str(folder)),
            *("--agent", "fail", "--corruptions", "clean,resolution"),
            *("--out", str(folder / "run")),
        ],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
        env={**__import__("os").environ, "XDG_DATA_HOME": str(osworld.parents[1])},
    )


def test_an_episode_goes_on_elsewhere_when_its_machine_dies(osworld, tmp_path) -> None:
    """One machine dies before its first episode, and one in the middle of it."""
    shelf = tmp_path / "tasks"
    for number in range(3):
        task_file(shelf, f"t-{number}")
    with fake_guests(tmp_path, 2, 5, None) as guests:
        vms = [f"http://{guest.address}" for guest in guests]
        result = bench(osworld, shelf, vms, "--reset-command", REVERT)
    assert f"{vms[0]} is taken out: it does not start: the guest gave no" in result.stderr
    assert "(2 machines left)" in result.stderr
    lines = (shelf / "run" / "records.jsonl").read_text().splitlines()
    records = [json.loads(line) for line in lines]
    (lost_record,) = [record for record in records if record["desktop"]["machine"] == vms[1]]
    assert (lost_record["status"], lost_record["score"], lost_record["attempt"]) == (
        "invalid",
        None,
        0,
    )
    ended = {(r["task"], r["corruption"]): r for r in records}  # the last attempt counts
    assert len(ended) == 6
    assert {r["score"] for r in ended.values()} == {1.0}
    assert {r["desktop"]["machine"] for r in ended.values()} == {vms[2]}
    assert ended[lost_record["task"], lost_record["corruption"]]["attempt"] == 1


def test_an_episode_is_played_again_on_another_machine_than_it_failed_on(monkeypatch) -> None:
    """Even if the one that fails is free first; one that stands by starts only then."""
    played: list[tuple[str, int]] = []

    class Worker:
        alive = True

        def __init__(self, setup: WorkerSetup, serve: object) -> None:
            self.name = setup.bench.machines.vm[0]

        def wait_until_ready(self) -> None:
            """It runs."""

        def close(self) -> None:
            """It ends."""

        def play(self, job: object, attempt: int) -> dict[str, Any]:
            played.append((self.name, attempt))
            if self.name == "a:1" and len(played) > 2:
                raise MachineFailureError({"status": "invalid", "problem": "was not reverted"})
            return {"status": "ok"}

    monkeypatch.setattr(machine_pool, "EpisodeWorker", Worker)
    bench = Bench(machines=MachineSettings(vm=("a:1", "b:1", "c:1")))
    pool = MachinePool(WorkerSetup(bench=bench, folder=Path()), desktops=1)
    job = Job("oracle", "write_note", "clean", 0)
    for attempt in (0, 0, 0, 1, 0):
        with pool.reserve():
            pool(job, attempt)
    assert played == [("a:1", 0), ("a:1", 0), ("a:1", 0), ("b:1", 1), ("b:1", 0)]


def test_a_run_without_a_machine_left_says_why(osworld, tmp_path) -> None:
    shelf = tmp_path / "tasks"
    task_file(shelf, "t-0")
    task_file(shelf, "t-1")
    with fake_guests(tmp_path, None) as (guest,):
        # The command succeeds, and reverts nothing.
        result = bench(osworld, shelf, [f"http://{guest.address}"], "--reset-command", "true")
    assert result.returncode == 2
    assert "no machine is left to play on" in result.stderr, result.stderr[-3000:]
    assert "was not reverted" in result.stderr
    records = [
        json.loads(line) for line in (shelf / "run" / "records.jsonl").read_text().splitlines()
    ]
    assert [record["score"] for record in records] == [1.0, None, None]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--vm", "http://127.0.0.1:9"], "leave traces on it. Give --reset-command"),
        (["--vm", "ftp://127.0.0.1:9"], "an address is like http://10.0.0.5:5000"),
        (["--vm", "http://127.0.0.1:9?web=1"], "an address is like http://10.0.0.5:5000"),
        (["--vm", "dokcer"], "no such provider; did you mean 'docker'"),
        (["--vm", "vmware", "--vm", "vmware"], "names a machine twice"),
        (
            ["--vm", "http://127.0.0.1:9", "--vm", "http://localhost:9/"],
            "both are reached by port 9 of",
        ),
        (
            ["--vm", "http://127.0.0.1:9", "--vm", "http://127.0.0.1:10?chromium=9223"],
            "both are reached by port 8080 of",
        ),
        (["--vm", "vmware", "--reset-command", "x"], "providers revert themselves"),
        (["--vm", "vmware", "--vm-option", "snapshot=x"], "did you mean 'snapshot_name'"),
        (
            ["--vm", "vmware", "--machines", "2", "--vm-option", "path_to_vm=/x"],
            "names one machine",
        ),
        (["--vm", "http://127.0.0.1:9", "--machines", "2"], "repeat --vm"),
        (["--vm", "http://127.0.0.1:9", "--vm-option", "region=x"], "is for providers, not for"),
        (
            ["--vm", "vmware", "--vm-option", "enable_proxy=true"],
            "PROXY_CONFIG_FILE names the JSON",
        ),
        (["--vm", "azure"], "name yours by --vm-option path_to_vm=RESOURCE_GROUP/MACHINE"),
        (["--reset-command", "x"], "osworld needs --vm"),
    ],
)
def test_a_dry_run_refuses_what_the_run_would(
    words: list[str], problem: str, tmp_path, osworld, monkeypatch
) -> None:
    from online_env.osworld import family

    task_file(tmp_path, "t-one")
    monkeypatch.setattr(
        family.OsworldFamily, "find_unplayable", lambda *_: {}
    )  # OSWorld's environment is not in its default folder
    arguments = ["bench", "osworld", "--tasks", str(tmp_path), *words]
    dry = CliRunner().invoke(hijack, [*arguments, "--dry-run"])
    assert isinstance(dry.exception, ParameterError | ConfigError | LookupError), dry.output
    assert problem in str(dry.exception)
    run = CliRunner().invoke(hijack, [*arguments, "--out", str(tmp_path / "run")])
    assert str(run.exception) == str(dry.exception)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("name", "problem", "remedy"),
    [
        (
            "docker",
            "No module named '(docker|tqdm)'|DockerException",
            "a Docker daemon that answers",
        ),
        ("vmware", "vmrun is not on the PATH", "VMware Workstation, with vmrun"),
        ("virtualbox", "VBoxManage is not on the PATH", "VirtualBox, with VBoxManage"),
        ("aws", "No module named 'boto3'|AWS_REGION must be set", "AWS_SUBNET_ID"),
        ("azure", "No module named 'azure'|AZURE_SUBSCRIPTION_ID", "AZURE_SUBSCRIPTION_ID"),
        ("daytona", "this desktop_env has no provider 'daytona'", "--osworld DIR"),
    ],
)
def test_what_a_provider_lacks_is_said_before_the_run(
    name: str, problem: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nothing-here")
    monkeypatch.setenv("DOCKER_HOST", "unix:///nothing-here.sock")
    for variable in ("AWS_REGION", "AZURE_SUBSCRIPTION_ID"):
        monkeypatch.delenv(variable, raising=False)
    options = {"path_to_vm": "group/machine"} if name == "azure" else {}
    with pytest.raises(MissingPackageError, match=problem) as refused:
        machines.check(MachineSettings(vm=(name,), options=options), 10, needs.osworld())
    assert remedy in str(refused.value)
    assert f"hijack osworld setup --provider {name}" in str(refused.value)


def test_amazons_image_is_the_snapshot_of_a_revert(monkeypatch: pytest.MonkeyPatch) -> None:
    """`DesktopEnv` would ask Amazon for an image called init_state, at the second episode."""
    images = {"us-east-1": {(1920, 1080): "ami-1"}}
    manager = SimpleNamespace(IMAGE_ID_MAP=images)
    monkeypatch.setitem(sys.modules, "desktop_env.providers.aws.manager", manager)
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    screen = {"screen_size": (1920, 1080)}
    arguments = dict(screen)
    worker._set_image(arguments)
    assert arguments == {**screen, "region": "us-east-1", "snapshot_name": "ami-1"}
    named = {**arguments, "snapshot_name": "ami-2"}
    worker._set_image(named)
    assert named["snapshot_name"] == "ami-2"
    elsewhere = {**screen, "region": "eu-north-1"}
    worker._set_image(elsewhere)
    assert "snapshot_name" not in elsewhere


def test_a_task_behind_a_proxy_is_set_up_with_one(osworld, tmp_path, monkeypatch) -> None:
    """OSWorld's set-up takes the proxy of the file and configures it in the guest."""
    proxies = tmp_path / "proxies.json"
    proxies.write_text('[{"host": "proxy.test", "port": 3128, "username": "u", "password": "p"}]')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PROXY_CONFIG_FILE", proxies.name)
    with fake_guests(tmp_path, None) as (guest,):
        vm = (f"http://{guest.address}",)
        settings = MachineSettings(vm=vm, options={"enable_proxy": True}, reset_command=REVERT)
        machines.check(settings, 2, osworld)
        with machines.machine((SIZE[1], SIZE[0]), settings, osworld) as desktop:
            task = task_file(tmp_path, "t-proxy", proxy=True)
            desktop.env.reset(json.loads(task.read_text()))
            log = Path(desktop.env._log).read_text()
    assert "Loaded 1 proxies" in log
    assert "Setting up proxy: proxy.test:3128" in log


def test_tasks_that_cannot_be_played_are_listed_and_counted(osworld, tmp_path) -> None:
    task_file(tmp_path / "tasks", "t-good")
    task_file(tmp_path / "tasks", "t-proxy", proxy=True)
    account = {"type": "googledrive", "parameters": {}}
    task_file(tmp_path / "tasks", "t-drive", config=[account])
    shelf = tmp_path / "tasks"
    with fake_guests(tmp_path, None) as (guest,):
        vms = [f"http://{guest.address}"]
        words = ("--reset-command", REVERT)
        refused = bench(osworld, shelf, vms, *words, "--dry-run")
        assert refused.returncode == 2
        assert "it needs an account" in refused.stderr  # in some tiers, a package as well
        assert "t-proxy: its sites need OSWorld's proxy" in refused.stderr
        assert "2 of 3 tasks can't be played" in refused.stderr
        result = bench(osworld, shelf, vms, *words, "--unplayable", "zero")
    assert result.returncode == 0, result.stderr[-3000:]
    assert "2 of 3 tasks could not be played and count 0 in every condition" in result.stdout
    report = subprocess.run(
        [*HIJACK, "report", str(shelf / "run"), "--format", "json"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    cells = json.loads(report.stdout)["cells"]
    assert [(cell["n"], round(cell["success"], 3)) for cell in cells] == [(3, 0.333)] * 2


def test_a_server_counts_no_task_as_zero() -> None:
    result = CliRunner().invoke(hijack, ["serve", "osworld", "--unplayable", "zero", "--dry-run"])
    assert result.exit_code == 2
    assert "counts nothing; leave" in " ".join(result.output.split())
