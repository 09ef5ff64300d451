"""The folder of a run: one writer, nothing lost when it is killed, and a run that goes on."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import StorageError
from hijack_data.runs.run_log import VERSION
from online_env.bench import runner
from online_env.bench.jobs import attempts
from online_env.results import records, scores
from online_env.results.records import RunError
from pipelines.proof.rebuild import rebuild

from support.recorded import IDS, JOBS, Episodes, Silent, config, no_machine, record_run
from support.waiting import until

KEYS = ("n", "success", "errors", "invalid")
ROOT = Path(__file__).resolve().parents[2]


def hijack(*words):
    argv = [sys.executable, "-m", "hijack_data.cli", *map(str, words)]
    return subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture
def run(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "run"))


def go_on(folder, episodes=None):
    """What `hijack bench --resume` does; returns which episodes were played."""
    player = episodes or Episodes(folder)
    with no_machine(), records.resume(folder, config(), IDS):
        earlier = attempts(JOBS, records.read(folder).records)
        runner.run_jobs(JOBS, folder, 1, player, Silent(), earlier)
    return player.played


def broken_off_after(folder, lines):
    """Leave the records of the first episodes, as a run leaves them that was killed."""
    path = folder / "records.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:lines]))
    for name in IDS[lines:]:
        shutil.rmtree(folder / "episodes" / name)


# One writer

HOLDER = """
    import sys, time
    from pathlib import Path
    from online_env.results import records
    lock = records.create(Path(sys.argv[1]), {})
    print("held", flush=True)
    time.sleep(100)
"""


def test_a_second_writer_is_refused_until_the_first_process_is_dead(tmp_path):
    folder = tmp_path / "run"
    argv = [sys.executable, "-c", textwrap.dedent(HOLDER), str(folder)]
    process = subprocess.Popen(argv, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        assert process.stdout.readline() == "held\n"
        for begin in (records.hold, lambda path: records.resume(path, {}, [])):
            with pytest.raises(RunError, match=f"is being written by process {process.pid} on "):
                begin(folder)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
    records.resume(folder, {}, []).release()


def test_of_many_that_begin_at_once_one_begins(tmp_path):
    def begin(folder):
        try:
            return records.create(folder, {})
        except RunError:
            return None

    with ThreadPoolExecutor(4) as pool:
        for number in range(200):
            folder = tmp_path / str(number)
            locks = list(pool.map(begin, [folder] * 4))
            assert sum(lock is not None for lock in locks) == 1
            assert json.loads((folder / "run.json").read_text())["version"] == VERSION


def test_a_lock_is_let_go_with_what_holds_it(tmp_path):
    lock = records.hold(tmp_path)
    with pytest.raises(RunError, match=f"process {os.getpid()} on"):
        records.hold(tmp_path)
    lock.release()
    lock.release()
    with records.hold(tmp_path):
        pass
    records.hold(tmp_path)


def test_two_environments_cannot_write_one_episode(tmp_path):
    from hijack_data.errors import ParameterError

    from support.episodes import make

    value, _ = make(log=tmp_path)
    second, _ = make(log=tmp_path)
    value.reset(seed=0, options={"attempt": 0})
    with pytest.raises(ParameterError, match="being written by another environment"):
        second.reset(seed=0, options={"attempt": 0})
    second.reset(seed=0)
    for env in (value, second):
        env.step("DONE")
    assert (value.record["attempt"], second.record["attempt"]) == (0, 1)
    assert rebuild(tmp_path).problems == []


# Going on


@pytest.mark.parametrize("lines", [0, 1, 3, 4])
def test_a_run_that_was_killed_is_gone_on_with(run, lines):
    broken_off_after(run, lines)
    if lines < len(IDS):
        frames = run / "episodes" / IDS[lines] / "frames"
        frames.mkdir(parents=True)  # the episode that was under way
        (frames / "0000.png").write_bytes(b"half")
    assert go_on(run) == [(job.corruption, 0) for job in JOBS[lines:]]
    report = rebuild(run)
    assert (report.problems, report.episodes, report.unfinished) == ([], len(IDS), 0)
    assert go_on(run) == []


def test_what_a_kill_cut_off_is_mended(run):
    path = run / "records.jsonl"
    path.write_bytes(path.read_bytes()[:-40])  # the last line, of an episode that is whole
    assert go_on(run) == []
    assert rebuild(run).problems == []
    assert [record["id"] for record in records.read(run).records] == IDS


def test_a_run_that_never_began_is_begun(tmp_path):
    records.resume(tmp_path / "run", config(), IDS).release()
    assert len(go_on(tmp_path / "run")) == len(IDS)
    assert rebuild(tmp_path / "run").problems == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"max_steps": 10}, "max_steps was 9, and is 10 now"),
        ({"seeds": [7, 8]}, r"seeds was \[7\], and is \[7, 8\] now"),
        ({"agents": ["other"]}, r'agents\[0\] was "teller", and is "other" now'),
        ({"desktop": {"provider": "none", "size": [640, 361]}}, r"desktop.size\[1\] was 360"),
        ({"corruptions": ["clean", {"marks": {"number": 4}}]}, "corruptions was"),
    ],
)
def test_another_run_is_not_gone_on_with(run, change, words):
    with pytest.raises(RunError, match=words):
        records.resume(run, config(**change), IDS)
    records.resume(run, config(source="elsewhere.yaml"), IDS)
    with pytest.raises(RunError, match="other variants"):
        records.resume(run, config(), IDS[1:])


def test_a_damaged_run_or_one_of_another_version_is_not_gone_on_with(run):
    path = run / "records.jsonl"
    whole_bytes = path.read_bytes()
    path.write_bytes(b"{x\n" + whole_bytes)
    with pytest.raises(RunError, match=r"records.jsonl:1: not JSON.*cannot be resumed"):
        records.resume(run, config(), IDS)
    path.write_bytes(whole_bytes)
    head = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(head | {"version": VERSION - 1}))
    with pytest.raises(RunError, match="version"):
        records.resume(run, config(), IDS)
    (run / "run.json").write_text(json.dumps(head | {"versions": {"agenthijack": "0.0.1"}}))
    with pytest.raises(RunError, match=r"begun with agenthijack 0\.0\.1, this is"):
        records.resume(run, config(), IDS)


def test_a_desktop_that_dies_is_run_again_and_counts_where_it_dies_again(tmp_path):
    """Once is our failure; an agent must not get rid of a bad episode by killing its desktop."""
    folder = tmp_path / "run"
    requests = []
    endings = {
        "clean": ["machine", "machine"],
        "marks": ["machine", "ok"],
        "app_minimization": ["invalid", "invalid"],
        "resolution": ["agent"],
    }

    def episode(job, attempt):
        requests.append((job.corruption, attempt))
        ended = endings[job.corruption][attempt]
        record = {
            "id": f"{job.id}-{attempt}",
            "agent": job.agent,
            "task": "do-7",
            "task_seed": 7,
            "seed": 7,
            "corruption": job.corruption,
            "attempt": attempt,
            "score": 1.0 if ended == "ok" else None,
            "problem": "x",
        }
        if ended in ("machine", "agent"):
            return {**record, "status": "error", "cause": ended}
        return {**record, "status": ended}

    with records.create(folder, config(), IDS):
        statuses = runner.run_jobs(JOBS, folder, 1, episode, Silent())
    assert requests == [(name, k) for name, ended in endings.items() for k in range(len(ended))]
    assert dict(statuses) == {"error": 2, "ok": 1, "invalid": 1}
    rows = scores.rows(records.read(folder).records)
    counts = {row["corruption"]: [row[key] for key in KEYS] for row in rows}
    assert counts == {
        "clean": [1, 0.0, 1, 0],
        "marks": [1, 1.0, 0, 0],
        "app_minimization": [0, None, 0, 1],
        "resolution": [1, 0.0, 1, 0],
    }
    died = {**records.read(folder).records[0], "attempt": 0}
    (row,) = scores.rows([died])
    assert [row[key] for key in KEYS] == [0, None, 0, 1]


# The report


def test_a_report_says_what_is_missing(run):
    result = hijack("report", run)
    assert (result.returncode, "missing" in result.stdout) == (0, False)
    broken_off_after(run, 1)
    for words in (["report", run], ["report", run, "--json"]):
        result = hijack(*words)
        assert result.returncode == 1
        assert "1 of 4 planned episodes are there, 3 are missing" in result.stdout + result.stderr
    assert json.loads(result.stdout)[0]["n"] == 1
    head = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps({**head, "version": 1, "episodes": None}))
    result = hijack("report", run)
    assert (result.returncode, "1 of 4 planned episodes" in result.stdout) == (1, True)


def test_a_run_without_an_episode_is_verified_and_not_reported(tmp_path):
    records.create(tmp_path / "run", config(), IDS)
    result = hijack("verify", tmp_path / "run")
    assert result.returncode == 1
    assert "4 of 4 planned episodes are not there" in result.stdout
    result = hijack("report", tmp_path / "run")
    assert (result.returncode, "holds no episodes yet" in result.stderr) == (2, True)
    assert "--resume runs them" in result.stderr


def test_what_an_environment_logged_by_itself_is_reported_too(run):
    full_report = json.loads(hijack("report", run, "--json").stdout)
    for name in ("run.json", "records.jsonl"):
        (run / name).unlink()
    result = hijack("report", run, "--json")
    assert result.returncode == 0, result.stderr
    rows = {row["corruption"]: row for row in json.loads(result.stdout)}
    assert rows == {row["corruption"]: row for row in full_report}
    (run / "episodes" / IDS[1] / "episode.json").write_text("{")
    result = hijack("report", run)
    assert (result.returncode, f"{IDS[1]}/episode.json:1: skipped" in result.stderr) == (1, True)


# A full disk


@pytest.fixture
def full():
    """No file can grow beyond 9 bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (9, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_record_that_finds_a_full_disk_is_an_error_of_storage(run, full):
    with pytest.raises(StorageError, match=r"records\.jsonl: cannot be written"):
        records.append(run, {"id": "x"})


def test_a_full_disk_has_an_exit_code_of_its_own(tmp_path):
    """A disk that is full for the command: no file may grow beyond a few bytes."""
    limited = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (9, 9)); "
    code = limited + "from hijack_data.cli import main; main(sys.argv[1:])"
    picture = next((ROOT / "examples").rglob("*.png"))
    argv = [
        sys.executable,
        "-B",
        "-c",
        code,
        "apply",
        str(picture),
        "marks",
        "-o",
        str(tmp_path / "m.png"),
    ]
    process = subprocess.run(
        argv, capture_output=True, text=True, timeout=120, check=False, cwd=ROOT
    )
    assert (process.returncode, "cannot be written" in process.stderr) == (3, True), process.stderr
    assert "Traceback" not in process.stderr


def there_or_over(path, process):
    return path.exists() or process.poll() is not None


def test_a_process_that_dies_at_any_line_loses_nothing(tmp_path):
    """Killed while it plays, again and again: what it did is kept, and a last run ends it."""
    code = """
        import sys
        from pathlib import Path
        sys.path.insert(0, "tests")
        from support.recorded import IDS, JOBS, Episodes, Silent, config, no_machine
        from online_env.bench import runner
        from online_env.results import records, scores
        from online_env.bench.jobs import attempts
        folder = Path(sys.argv[1])
        with no_machine(), records.resume(folder, config(), IDS):
            earlier = attempts(JOBS, records.read(folder).records)
            runner.run_jobs(JOBS, folder, 1, Episodes(folder), Silent(), earlier)
    """
    folder = tmp_path / "run"
    argv = [sys.executable, "-c", textwrap.dedent(code), str(folder)]
    for number in (0, 2):
        process = subprocess.Popen(argv, cwd=ROOT)
        under_way = folder / "episodes" / IDS[number] / "frames/0001.png"
        try:
            until(partial(there_or_over, under_way, process), "an episode")
        finally:
            process.kill()
            process.wait()
    go_on(folder)
    assert rebuild(folder).problems == []
    assert [record["id"] for record in records.read(folder).records] == IDS
