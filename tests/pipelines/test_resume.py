"""A build that is killed at any point and resumed is, byte for byte, the build that was left
alone."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import hijack_data as hj
from pipelines import build, open_dataset, verify
from pipelines.building import output_folder, shards
from pipelines.errors import BuildError, DatasetError

from support.dataset_files import file_contents
from support.killing import Killer, killer

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """
import sys, time
from pathlib import Path
import hijack_data as hj
from pipelines import build

def slowly(done, total, text):
    print(done, flush=True)
    time.sleep(0.02)

if __name__ == "__main__":
    source, out, workers, resume = sys.argv[1:]
    planners = {"marks": hj.Marks(number=4, mark_size=8), "half": hj.Resolution()}
    build(source, out, corruptions=planners, rows_per_shard=9, workers=int(workers), resume=resume == "resume",
          progress=slowly)
"""


@pytest.fixture
def planners() -> dict[str, Any]:
    return {"marks": hj.Marks(number=4, mark_size=8), "half": hj.Resolution()}


# The card names its own folder.
contents = partial(file_contents, without="README.md")


def start(source: Path, out: Path, workers: int, resume: str) -> "subprocess.Popen[str]":
    script = source.parent / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(source), str(out), str(workers), resume]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


def kill_after(process: "subprocess.Popen[str]", steps: int) -> list[int]:
    """Kill a build once it has done `steps` steps, and return the ids of its own children."""
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) >= steps:
            break
    children = [
        int(p) for p in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    ]
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    return children


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_kill_and_resume_and_kill_and_resume(recording: Any, planners: Any, tmp_path: Path) -> None:
    source = recording(trajectories=6, steps=3)
    build(source, tmp_path / "whole", corruptions=planners, rows_per_shard=9)
    out = tmp_path / "out"
    kill_after(start(source, out, 1, "fresh"), 5)
    assert len(list((out / "data").glob("train-*.parquet"))) == 1
    with pytest.raises(DatasetError, match=r"unfinished build.*resume=True"):
        open_dataset(out)
    with pytest.raises(DatasetError, match="unfinished"):
        verify(out)
    with pytest.raises(BuildError, match=r"unfinished build.*--resume"):
        build(source, out, corruptions=planners, rows_per_shard=9)
    kill_after(start(source, out, 1, "resume"), 11)
    assert len(list((out / "data").glob("train-*.parquet"))) == 3
    (out / "data" / ".train-00003.parquet.abc.tmp").write_text("half a file")
    report = build(source, out, corruptions=planners, rows_per_shard=9, resume=True)
    assert (report.kept, report.shards, report.total) == (3, 6, 54)
    assert contents(out) == contents(tmp_path / "whole")
    assert verify(out).ok


def test_workers_end_with_a_build_that_is_killed(
    recording: Any, planners: Any, tmp_path: Path
) -> None:
    source = recording(trajectories=8, steps=3)
    out = tmp_path / "out"
    children = kill_after(start(source, out, 2, "fresh"), 6)
    assert len(children) >= 2
    deadline = time.monotonic() + 20
    while any(map(is_running, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in children if is_running(pid)]
    report = build(source, out, corruptions=planners, rows_per_shard=9, resume=True)
    build(source, tmp_path / "whole", corruptions=planners, rows_per_shard=9)
    assert report.kept >= 1
    assert contents(out) == contents(tmp_path / "whole")


@dataclass
class Case:
    """A source, the options of a build, and the files of an undisturbed one."""

    source: Path
    options: dict[str, Any]
    whole: dict[str, bytes]
    kill: Killer

    def build(self, out: Path, **more: Any) -> None:
        planners = {
            label: hj.make_corruption(name, **parameters)
            for label, (name, parameters) in self.options["corruptions"].items()
        }
        build(self.source, out, **{**self.options, "corruptions": planners, **more})


@pytest.fixture(scope="module")
def killing() -> Iterator[Killer]:
    with killer() as result:
        yield result


@pytest.fixture
def six(recording: Any, add_line: Any, tmp_path: Path, killing: Killer) -> Case:
    """Six shards, and inputs that are rejected."""
    source = recording(trajectories=6, steps=2)
    image = source / "images" / "t2-1.png"
    image.write_bytes(image.read_bytes()[:-1000])
    add_line(source, b"rubbish")
    corruptions = {"few": ["marks", {"number": 4, "mark_size": 8}], "half": ["resolution", {}]}
    case = Case(source, {"corruptions": corruptions, "rows_per_shard": 6}, {}, killing)
    case.build(tmp_path / "whole")
    case.whole = contents(tmp_path / "whole")
    assert len([name for name in case.whole if name.startswith("data/train-")]) == 6
    assert case.whole["quarantine.jsonl"].count(b"\n") == 2
    return case


def test_killed_before_and_after_every_file_is_put_in_place(six: Case, tmp_path: Path) -> None:
    """Every shard, every note that a shard is done, and what comes at the end; the resumed build is
    killed, too."""
    resumed = {**six.options, "resume": True}
    names = six.kill.renames(six.source, tmp_path / "counted", six.options)
    shards = [name for name in names if name.startswith("train-")]
    assert (len(shards), names[-1]) == (6, "manifest.json")
    draw = random.Random(1)
    for number, name in enumerate(names):
        for before in (True, False):
            out = tmp_path / f"{number}-{before}"
            case = f"killed {'before' if before else 'after'} {name}"
            assert six.kill.at_rename(six.source, out, six.options, number, before), case
            items = list((out / "data").glob("train-*.parquet"))
            assert len(items) == len([n for n in names[: number + (not before)] if n in shards]), (
                case
            )
            assert (out / "manifest.json").exists() == (name == "manifest.json" and not before), (
                case
            )
            again = draw.randrange(len(names))
            six.kill.at_rename(six.source, out, resumed, again, bool(draw.randrange(2)))
            six.build(out, resume=True, workers=2 if before and name in shards[::2] else 1)
            assert contents(out) == six.whole, f"{case}, and again at {again}"


def test_killed_after_every_shard_of_two_workers(six: Case, tmp_path: Path) -> None:
    # the first file is that of the parameters; workers put shards in place themselves
    for number in range(1, 7):
        out = tmp_path / str(number)
        assert six.kill.at_rename(
            six.source, out, {**six.options, "workers": 2}, number, number % 2 == 0
        )
        six.build(out, resume=True, workers=3 if number == 3 else 1)
        assert contents(out) == six.whole


def test_killed_while_a_finished_dataset_is_resumed(six: Case, tmp_path: Path) -> None:
    out = tmp_path / "out"
    six.build(out)
    for number in range(12):
        (out / "data" / f"train-0000{number % 6}.parquet").unlink(missing_ok=True)
        six.kill.at_rename(
            six.source, out, {**six.options, "resume": True}, number, number % 2 == 0
        )
    six.build(out, resume=True)
    assert contents(out) == six.whole


def test_killed_at_random_instants(six: Case, tmp_path: Path) -> None:
    draw, killed = random.Random(5), 0
    for number in range(12):
        out = tmp_path / str(number)
        options = {**six.options, "workers": 2 if number % 6 == 5 else 1}
        killed += six.kill.at_step(
            six.source, out, options, draw.randrange(10), draw.random() * 0.01
        )
        six.kill.at_step(
            six.source,
            out,
            {**six.options, "resume": True},
            draw.randrange(10),
            draw.random() * 0.01,
        )
        six.build(out, resume=True)
        assert contents(out) == six.whole, number
    assert killed >= 6


def test_resuming_what_is_finished_changes_nothing(
    recording: Any, planners: Any, add_line: Any, tmp_path: Path
) -> None:
    source, out = recording(trajectories=3), tmp_path / "out"
    add_line(source, b"rubbish")
    image = source / "images" / "t2-1.png"
    image.write_bytes(image.read_bytes()[:-1000])
    build(source, out, corruptions=planners, rows_per_shard=9)
    before = contents(out)
    report = build(source, out, corruptions=planners, rows_per_shard=9, resume=True)
    assert (report.kept, report.total, report.rejected) == (3, 24, 2)
    assert contents(out) == before
    assert before["quarantine.jsonl"].count(b"\n") == 2
    with pytest.raises(BuildError, match="holds a dataset"):
        build(source, out, corruptions=planners, rows_per_shard=9)


def test_resume_repairs_what_was_damaged(recording: Any, planners: Any, tmp_path: Path) -> None:
    source, out = recording(trajectories=4), tmp_path / "out"
    build(source, out, corruptions=planners, rows_per_shard=9)
    before = contents(out)
    (out / "data" / "train-00001.parquet").unlink()
    damaged = bytearray((out / "data" / "train-00002.parquet").read_bytes())
    damaged[100] ^= 1
    (out / "data" / "train-00002.parquet").write_bytes(damaged)
    (out / "data" / "train-00009.parquet").write_bytes(b"stray")
    report = build(source, out, corruptions=planners, rows_per_shard=9, resume=True)
    assert (report.kept, report.shards) == (2, 4)
    assert contents(out) == before


def test_a_source_that_changed_is_built_anew_where_it_did(
    recording: Any, planners: Any, add_line: Any, good_line: Any, tmp_path: Path
) -> None:
    source, out = recording(trajectories=3), tmp_path / "out"
    build(source, out, corruptions=planners, rows_per_shard=9)
    add_line(source, good_line("t1", 7, image="images/t0-0.png"))
    report = build(source, out, corruptions=planners, rows_per_shard=9, resume=True)
    assert (report.kept, report.total) == (2, 30)
    build(source, tmp_path / "whole", corruptions=planners, rows_per_shard=9)
    assert contents(out) == contents(tmp_path / "whole")


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"seed": 1}, "seed was 0, is 1"),
        (
            {"corruptions": {"marks": hj.Marks(number=5, mark_size=8), "half": hj.Resolution()}},
            "corruptions",
        ),
        ({"rows_per_shard": 10}, "rows_per_shard"),
        ({"clean": False}, "clean"),
        ({"label_policy": "drop"}, "label_policy"),
    ],
)
def test_other_parameters_cannot_resume(
    changes: Any, key: str, recording: Any, planners: Any, tmp_path: Path
) -> None:
    source, out = recording(trajectories=1, steps=1), tmp_path / "out"
    build(source, out, corruptions=planners, rows_per_shard=9)
    before = contents(out)
    with pytest.raises(BuildError, match=key):
        build(source, out, **{"corruptions": planners, "rows_per_shard": 9, **changes}, resume=True)
    assert contents(out) == before


def test_other_libraries_cannot_resume(
    recording: Any, planners: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, out = recording(trajectories=1, steps=1), tmp_path / "out"
    build(source, out, corruptions=planners)
    monkeypatch.setattr("pipelines.dataset.manifest.version", lambda name: "0.0.1")
    with pytest.raises(BuildError, match=r"libraries.*0\.0\.1"):
        build(source, out, corruptions=planners, resume=True)


def test_folders_that_are_not_ours_are_left_alone(
    recording: Any, planners: Any, tmp_path: Path
) -> None:
    source, out = recording(trajectories=1, steps=1), tmp_path / "out"
    out.mkdir()
    (out / "thesis.tex").write_text("x")
    for resume in (False, True):
        with pytest.raises(BuildError, match=r"not empty|neither a dataset"):
            build(source, out, corruptions=planners, resume=resume)
    assert os.listdir(out) == ["thesis.tex"]


def test_resume_of_nothing_is_a_fresh_build(recording: Any, planners: Any, tmp_path: Path) -> None:
    report = build(recording(), tmp_path / "out", corruptions=planners, resume=True)
    assert (report.kept, report.total) == (0, 18)


def test_a_damaged_state_is_named(recording: Any, planners: Any, tmp_path: Path) -> None:
    source, out = recording(trajectories=1, steps=1), tmp_path / "out"
    (out / ".build").mkdir(parents=True)
    (out / ".build" / "00000.json").write_text(json.dumps({"index": 0}))
    (out / ".build" / "parameters.json").write_text("{}")
    with pytest.raises(DatasetError, match=r"damaged.*build again"):
        build(source, out, corruptions=planners, resume=True)


def test_two_builds_of_one_folder(recording: Any, planners: Any, tmp_path: Path) -> None:
    source, out = recording(), tmp_path / "out"
    calls: list[str] = []

    def second(*_: Any) -> None:
        with pytest.raises(BuildError, match="another build is writing"):
            build(source, out, corruptions=planners, resume=True)
        calls.append("refused")

    build(source, out, corruptions=planners, progress=second)
    assert calls


DOTS = """
import hijack_data as hj

class Dots(hj.Planner):
    def __init__(self, number, more=None):
        self.number, self.more = number, more

    def plan(self, scene, **key):
        return hj.Marks(number=self.number + 0, mark_size=8).plan(scene, **key)
"""


@pytest.mark.parametrize(
    ("first", "second", "module", "reason"),
    [
        (
            "hj.Schedule(lambda _: hj.Marks(number=2))",
            "hj.Schedule(lambda _: hj.Marks())",
            DOTS,
            "other",
        ),
        ("Dots(2)", "Dots(3)", DOTS, "other"),
        ("hj.OneOf([Dots(2)])", "hj.OneOf([Dots(2)])", DOTS.replace("+ 0", "+ 1"), "other"),
        ("Dots(2, abs)", "Dots(2, abs)", DOTS, "nothing shows"),
        ("hj.OneOf([Dots(2, hj.Marks())])", "hj.OneOf([Dots(2, hj.Marks())])", DOTS, ""),
    ],
)
def test_planners_that_no_configuration_holds_resume_with_the_same_alone(
    first: str,
    second: str,
    module: str,
    reason: str,
    recording: Any,
    tmp_path: Path,
    monkeypatch: Any,
) -> None:
    def planner(text: str, code: str, name: str) -> Any:
        file = tmp_path / f"{name}.py"
        file.write_text(code)
        spec = spec_from_file_location("dots", file)
        assert spec is not None
        assert spec.loader is not None
        loaded = module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "dots", loaded)
        spec.loader.exec_module(loaded)
        return eval(text, {"hj": hj, **vars(loaded)})

    source, out = recording(trajectories=1, steps=1), tmp_path / "out"
    build(source, out, corruptions={"it": planner(first, DOTS, "before")})
    again = {"it": planner(second, module, "after")}
    if not reason:
        assert build(source, out, corruptions=again, resume=True).kept == 1
        return
    with pytest.raises(BuildError, match=f"{reason}.*it"):
        build(source, out, corruptions=again, resume=True)


@pytest.mark.parametrize("first", ["a fresh one", "one that overwrites"])
def test_a_build_that_overwrites_leaves_another_build_alone(
    recording: Any, planners: Any, tmp_path: Path, first: str
) -> None:
    source, out = recording(), tmp_path / "out"
    if first == "one that overwrites":
        build(source, out, corruptions={})
    calls: list[str] = []

    def second(*_: Any) -> None:
        with pytest.raises(BuildError, match="another build is writing"):
            build(source, out, corruptions={}, overwrite=True)
        calls.append("refused")

    report = build(source, out, corruptions=planners, overwrite=True, progress=second)
    assert calls
    assert len(open_dataset(out)) == report.total
    assert not list(tmp_path.glob(".out.*"))


def turned_round(image: Path) -> None:
    """Put another picture in the place of one, of the same size in bytes."""
    before = image.stat().st_size
    with Image.open(image) as picture:
        picture.transpose(Image.Transpose.ROTATE_180).save(image, "BMP")
    assert image.stat().st_size == before


@pytest.fixture
def bitmaps(recording: Any) -> Path:
    """A recording whose pictures are of one size in bytes, whatever they show."""
    source = recording(trajectories=4, steps=2)
    for image in (source / "images").iterdir():
        with Image.open(image) as picture:
            picture.copy().save(image, "BMP")
    return source


@pytest.mark.parametrize("output", ["materialised", "lazy"])
def test_a_picture_that_changed_and_kept_its_size(
    output: str, bitmaps: Path, planners: Any, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    options: dict[str, Any] = {"corruptions": planners, "rows_per_shard": 6, "output": output}
    build(bitmaps, out, **options)
    assert build(bitmaps, out, **options, resume=True).kept == 4
    turned_round(bitmaps / "images" / "t2-1.png")
    assert build(bitmaps, out, **options, resume=True).kept == 3
    build(bitmaps, tmp_path / "fresh", **options)
    assert contents(out) == contents(tmp_path / "fresh")
    assert verify(out, source=bitmaps).ok


def test_a_killed_build_mixes_nothing_with_pictures_that_changed(
    bitmaps: Path, planners: Any, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    kill_after(start(bitmaps, out, 1, "fresh"), 5)
    count = len(list((out / "data").glob("train-*.parquet")))
    assert 1 <= count < 4
    turned_round(bitmaps / "images" / "t0-1.png")
    report = build(bitmaps, out, corruptions=planners, rows_per_shard=9, resume=True)
    assert report.kept == count - 1
    build(bitmaps, tmp_path / "fresh", corruptions=planners, rows_per_shard=9)
    assert contents(out) == contents(tmp_path / "fresh")


def test_pictures_are_read_again_only_if_their_files_were_written_to(
    recording: Any, planners: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shards, "RECENT_NS", 0)
    source = recording(trajectories=3, steps=2)
    picture = sorted(source.rglob("*.png"))[0]
    with Image.open(picture) as image:
        size = image.size
    Image.new("RGB", size, "red").save(picture, compress_level=0)
    before = picture.stat()

    def stop(done: int, total: int, text: str) -> None:
        if done == 5:
            raise KeyboardInterrupt

    def interrupted(out: Path) -> Path:
        with pytest.raises(KeyboardInterrupt):
            build(source, out, corruptions=planners, rows_per_shard=6, progress=stop)
        return out

    first, second = interrupted(tmp_path / "first"), interrupted(tmp_path / "second")
    hashed: list[int] = []

    def spy(task: Any) -> str:
        hashed.append(task.index)
        return shards.inputs_hash(task)

    monkeypatch.setattr(output_folder, "inputs_hash", spy)
    options = {"corruptions": planners, "rows_per_shard": 6, "resume": True}
    assert build(source, first, **options).kept == 2
    assert hashed == []
    Image.new("RGB", size, "blue").save(picture, compress_level=0)
    os.utime(picture, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert picture.stat().st_size == before.st_size
    assert build(source, second, **options).kept == 1
    assert hashed == [0]
