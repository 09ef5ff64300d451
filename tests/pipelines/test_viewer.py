"""`hijack view` without a browser: the index, the two adapters, the server and the command."""

import http.client
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from hijack_data.errors import HijackError, UnknownNameError
from pipelines import build, open_dataset
from pipelines.errors import DatasetError
from pipelines.viewer import ViewServer, answers, open_source
from pipelines.viewer.index import Index
from pipelines.viewer.pictures import Pictures

from support.runlog import lines_of, make_run

LABELS = ["clean", "pop_ups", "resolution", "marks", "subtitle"]
Get = Callable[..., tuple[int, bytes, dict[str, str]]]


@pytest.fixture(params=["materialised", "lazy"])
def dataset(request: Any, recording: Any, small: Any, tmp_path: Path) -> Path:
    """Two trajectories of three steps under four corruptions and clean: 30 rows in two files."""
    build(recording(), tmp_path / "out", corruptions=small, output=request.param, rows_per_shard=15)
    return tmp_path / "out"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return make_run(tmp_path / "run")


@pytest.fixture
def serving() -> Iterator[Callable[[Path], Get]]:
    """Serve a folder and return a function that gets from it: `get(path, **headers)`."""
    servers: list[ViewServer] = []

    def start(folder: Path) -> Get:
        server = ViewServer(open_source(folder))
        servers.append(server)
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()

        def get(path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
            link = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=30)
            try:
                link.request("GET", path, headers=headers)
                answer = link.getresponse()
                return answer.status, answer.read(), dict(answer.getheaders())
            finally:
                link.close()

        return get

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def edit(file: Path, **columns: Callable[[list[Any]], list[Any]]) -> None:
    """Write a file of rows anew with some columns changed (or added)."""
    table = pq.read_table(file)
    for name, change in columns.items():
        old = table.column(name).to_pylist() if name in table.column_names else [None] * len(table)
        table = table.drop_columns([name]) if name in table.column_names else table
        table = table.append_column(name, pa.array(change(old)))
    pq.write_table(table, file, row_group_size=4)


# ---- the index ----

WORDS = st.sampled_from(["", "marks", "clean", "Open the Door", "b/0001"])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(WORDS, WORDS, st.integers(0, 3)), max_size=30), WORDS, WORDS, st.integers(1, 7))
def test_the_index_filters_counts_and_searches_as_a_list_does(
    rows: list[tuple[str, str, int]], corruption: str, text: str, part: int
) -> None:
    index = Index(["fidelity"])
    for first in range(0, len(rows), part):
        some = rows[first : first + part]
        columns = {
            "corruption": [c for c, _, _ in some],
            "instruction": [i for _, i, _ in some],
            "group": ["g"] * len(some),
        }
        numbers = range(2 * first, 2 * first + 2 * len(some), 2)
        index.extend(numbers, [f"B/{n:04d}" for n in numbers], [s for _, _, s in some], columns)
    index.finish()

    def found(n: int) -> bool:
        return text.strip().casefold() in f"b/{2 * n:04d}" or text.strip().casefold() in rows[n][1].casefold()

    matches = [n for n, row in enumerate(rows) if found(n)]
    both = [n for n in matches if rows[n][0] == corruption]
    assert index.select({"corruption": corruption}, text).tolist() == both
    counts = index.counts({"corruption": corruption}, text, ["corruption", "fidelity"])
    assert {k: v for k, v in counts["corruption"].items() if v} == {
        c: n for c in {row[0] for row in rows} if (n := sum(rows[m][0] == c for m in matches))
    }
    assert sum(counts["fidelity"].values()) == len(both)
    for n, row in enumerate(rows):
        assert index.at(2 * n) == n
        assert index.at(2 * n + 1) is None
        assert sorted(index.same_step(n).tolist()) == [k for k, other in enumerate(rows) if other[2] == row[2]]
        steps = [k for k, other in enumerate(rows) if other[0] == row[0]]
        assert index.trajectory(n).tolist() == sorted(steps, key=lambda k: rows[k][2])


def test_a_filter_that_does_not_exist_is_refused(dataset: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'corruption'"):
        answers.rows(open_source(dataset), {"coruption": "marks"})


# ---- a dataset ----


def test_filters_have_counts_and_pages(dataset: Path) -> None:
    source = open_source(dataset)
    everything = answers.rows(source, {})
    assert (everything["found"], everything["page"], everything["pages"]) == (30, 1, 1)
    assert everything["filters"]["corruption"]["values"] == [[label, 6] for label in LABELS]
    assert everything["filters"]["trajectory"]["values"] == [["t0", 15], ["t1", 15]]
    marks = answers.rows(source, {"corruption": "marks", "trajectory": "t1", "page": "1"})
    assert [row["id"] for row in marks["rows"]] == [f"t1/{step:04d}/marks" for step in range(3)]
    assert marks["filters"]["corruption"]["values"] == [
        [label, 3] for label in LABELS
    ]  # what another choice would give
    assert answers.rows(source, {"q": "DO T1"})["found"] == 15
    assert answers.rows(source, {"q": "0002/sub"})["found"] == 2
    assert answers.rows(source, {"corruption": "nothing"})["found"] == 0


def test_pages_are_bounded(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "PAGE_ROWS", 8)
    monkeypatch.setattr(answers, "CHOICES", 2)
    source = open_source(dataset)
    for page, shown in (("4", 4), ("1", 1), ("99", 4), ("0", 1), ("-3", 1), ("x", 1), ("9" * 40, 1)):
        assert answers.rows(source, {"page": page})["page"] == shown
    assert [row["row"] for row in answers.rows(source, {"page": "4"})["rows"]] == list(range(24, 30))
    choices = answers.rows(source, {"corruption": "subtitle"})["filters"]["corruption"]
    assert ([value for value, _ in choices["values"]], choices["more"]) == (["clean", "pop_ups", "subtitle"], 2)
    last = answers.row(source, {"row": "29"})
    assert (last["position"], last["page"], last["next"]) == (29, 4, None)


def test_a_row_knows_its_neighbours(dataset: Path) -> None:
    source = open_source(dataset)
    by_id = {row["id"]: number for number, row in enumerate(open_dataset(dataset))}
    row = answers.row(source, {"row": "t0/0001/marks"})
    assert row == answers.row(source, {"row": str(by_id["t0/0001/marks"])})
    assert (row["step_back"], row["step_next"]) == (by_id["t0/0000/marks"], by_id["t0/0002/marks"])
    assert (row["back"], row["next"]) == (row["row"] - 1, row["row"] + 1)
    assert row["same_step"] == [[by_id[f"t0/0001/{label}"], label] for label in LABELS]
    assert row["steps"] == [[by_id[f"t0/{step:04d}/marks"], str(step)] for step in range(3)]
    within = answers.row(source, {"row": str(row["row"]), "corruption": "marks"})
    assert (within["position"], within["back"], within["next"]) == (1, row["step_back"], row["step_next"])
    outside = answers.row(source, {"row": str(row["row"]), "corruption": "subtitle"})
    assert outside["position"] is None
    assert (outside["back"], outside["next"]) == (by_id["t0/0000/subtitle"], by_id["t0/0001/subtitle"])
    for name in ("30", "-1", "t9/0000/marks", ""):
        with pytest.raises(HijackError, match="there is no row"):
            answers.row(source, {"row": name})


def test_a_row_is_shown_whole(dataset: Path) -> None:
    source = open_source(dataset)
    for number, row in enumerate(open_dataset(dataset)):
        detail = answers.row(source, {"row": str(number)})["detail"]
        shown = dict(detail["fields"]["Columns"])
        assert {*shown} | {"plan", "screenshot"} == {*row} | {name for name in shown if name.endswith("screenshot")}
        assert shown["plan_digest"] == row["plan_digest"]
        assert detail["size"] == row["screenshot"].size
        assert json.loads(detail["plan"]) == json.loads(row["plan"])
        assert detail["points"] == [(row["action"]["x"], row["action"]["y"])]
        assert list(detail["box"]) == row["target_box"]
        assert bool(detail["no_before"]) == (row["corruption"] == "clean")


def test_pictures_are_those_of_the_rows(dataset: Path) -> None:
    source = open_source(dataset)
    rows = list(open_dataset(dataset))
    clean = {(row["trajectory_id"], row["step"]): row for row in rows if row["corruption"] == "clean"}
    pictures = Pictures(source)
    for number, row in enumerate(rows):
        assert np.array_equal(read(pictures.get("picture", number)), np.array(row["screenshot"]))
        before = clean[row["trajectory_id"], row["step"]]["screenshot"]
        if row["corruption"] != "clean":
            assert np.array_equal(read(pictures.get("before", number)), np.array(before))
        thumb = Image.open(io.BytesIO(pictures.get("thumb", number)))
        assert (thumb.format, thumb.size) == ("JPEG", row["screenshot"].size)


def read(data: bytes) -> np.ndarray:
    return np.array(Image.open(io.BytesIO(data)))


def test_kept_pictures_are_bounded(dataset: Path) -> None:
    pictures = Pictures(open_source(dataset), budget=60_000)
    first = pictures.get("picture", 0)
    assert pictures.get("picture", 0) is first
    for number in range(30):
        pictures.get("picture", number)
        assert pictures.held == sum(map(len, pictures._kept.values())) <= 60_000
    assert pictures.get("picture", 0) is not first


def test_large_pictures_have_small_thumbnails(tmp_path: Path, recording: Any) -> None:
    source = recording(trajectories=1, steps=1)
    Image.new("RGB", (1600, 900), "navy").save(source / "images" / "t0-0.png")
    build(source, tmp_path / "out", corruptions={}, seed=1)
    thumb = Image.open(io.BytesIO(Pictures(open_source(tmp_path / "out")).get("thumb", 0)))
    assert thumb.size == (480, 270)


def test_without_clean_rows_only_a_lazy_dataset_has_a_picture_before(
    recording: Any, small: Any, tmp_path: Path
) -> None:
    marks = {"marks": small["marks"]}
    for output in ("materialised", "lazy"):
        build(recording(output), tmp_path / f"{output}-out", corruptions=marks, output=output, clean=False)
        source = open_source(tmp_path / f"{output}-out")
        missing = answers.row(source, {"row": "0"})["detail"]["no_before"]
        if output == "lazy":
            assert missing == ""
            assert source.picture(0, True).shape == (200, 320, 3)
        else:
            assert "--no-clean" in missing
            with pytest.raises(DatasetError, match="--no-clean"):
                source.picture(0, True)


def test_columns_of_events_are_shown_when_they_are_there(dataset: Path) -> None:
    first, second = sorted((dataset / "data").iterdir())
    edit(
        first,
        inserted=lambda old: [k == 3 for k in range(len(old))],
        event=lambda old: ["the window was minimised" if k == 3 else None for k in range(len(old))],
        reminder=lambda old: ["restore it" if k == 3 else None for k in range(len(old))],
    )
    table = pq.read_table(second)
    pq.write_table(
        table.drop_columns([n for n in ("inserted", "event", "reminder") if n in table.column_names]), second
    )
    source = open_source(dataset)
    assert source.problems == []
    assert answers.rows(source, {"inserted": "yes"})["rows"][0]["chips"]["inserted"] == "yes"
    assert answers.rows(source, {})["filters"]["inserted"]["values"] == [["no", 14], ["yes", 1]]
    row = answers.row(source, {"row": "3"})
    notes = dict(row["detail"]["notes"])
    assert (notes["Event"], notes["Reminder"]) == ("the window was minimised", "restore it")
    assert "Inserted" in notes
    assert "+marks" in [name for _, name in row["same_step"]]


def test_a_damaged_file_is_named_and_the_others_are_shown(dataset: Path) -> None:
    first = min((dataset / "data").iterdir())
    first.write_bytes(b"rubbish" * 100)
    source = open_source(dataset)
    assert [p.partition(":")[0] for p in source.problems] == ["data/train-00000.parquet"]
    assert "15 rows are left out" in source.problems[0]
    assert [row["row"] for row in answers.rows(source, {})["rows"]] == list(range(15, 30))
    assert answers.row(source, {"row": "15"})["id"] == open_dataset(dataset).reader[15]["id"]
    with pytest.raises(HijackError, match="there is no row '3'"):
        answers.row(source, {"row": "3"})


@pytest.mark.parametrize("harm", ["missing", "column", "short", "outside"])
def test_other_harm_to_a_file_is_named(dataset: Path, tmp_path: Path, harm: str) -> None:
    file = min((dataset / "data").iterdir())
    if harm == "missing":
        file.unlink()
    elif harm == "outside":
        file.rename(tmp_path / "elsewhere.parquet")
        file.symlink_to(tmp_path / "elsewhere.parquet")
    else:
        table = pq.read_table(file)
        pq.write_table(table.drop_columns(["trajectory_id"]) if harm == "column" else table.slice(0, 9), file)
    source = open_source(dataset)
    words = {"missing": "is not in", "column": "no column trajectory_id", "short": "holds 9 rows", "outside": "leaves"}
    assert len(source.problems) == 1
    assert words[harm] in source.problems[0]
    assert len(source.index) == (24 if harm == "short" else 15)


def test_a_row_that_cannot_be_drawn_says_why_and_the_others_are_there(
    recording: Any, small: Any, tmp_path: Path
) -> None:
    build(recording(), tmp_path / "out", corruptions={"marks": small["marks"]}, output="lazy")
    file = next((tmp_path / "out" / "data").iterdir())
    edit(file, plan_digest=lambda old: [("0" * 64 if k == 1 else digest) for k, digest in enumerate(old)])
    source = open_source(tmp_path / "out")
    with pytest.raises(DatasetError, match="gives another plan"):
        Pictures(source).get("thumb", 1)
    detail = answers.row(source, {"row": "1"})["detail"]
    assert "gives another plan" in detail["problem"]
    assert dict(detail["fields"]["Columns"])["corruption"] == "marks"
    assert Pictures(source).get("thumb", 3)


def test_a_damaged_picture_is_a_message(dataset: Path) -> None:
    file = min((dataset / "data").iterdir())
    column = next(name for name in pq.read_schema(file).names if name.endswith("screenshot"))
    edit(file, **{column: lambda old: [{"bytes": b"\x89PNG no", "path": None}, *old[1:]]})
    source = open_source(dataset)
    with pytest.raises(DatasetError, match="row t0/0000/clean: its picture is damaged"):
        source.picture(0, False)
    assert answers.row(source, {"row": "0"})["detail"]["fields"]["Columns"]


def test_rows_of_other_columns_are_messages(dataset: Path) -> None:
    first, second = sorted((dataset / "data").iterdir())
    picture = next(name for name in pq.read_schema(first).names if name.endswith("screenshot"))
    edit(first, width=lambda old: [None, *old[1:]], action=lambda old: ["click"] * len(old))
    table = pq.read_table(second)
    pq.write_table(table.drop_columns([picture]), second)
    source = open_source(dataset)
    for row in (0, 1):
        assert "another kind of value" in answers.row(source, {"row": str(row)})["detail"]["problem"]
    with pytest.raises(DatasetError, match="row 15: a column is missing"):
        source.picture(15, False)
    edit(first, step=lambda old: [None, *old[1:]])
    assert open_source(dataset).problems[0].startswith("data/train-00000.parquet: its 15 rows are left out")


def test_what_is_no_dataset_is_refused(tmp_path: Path, dataset: Path) -> None:
    with pytest.raises(DatasetError, match="not a folder"):
        open_source(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="not a usable path"):
        open_source("a\0b")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match="not a dataset of ours"):
        open_source(tmp_path / "empty")
    manifest = json.loads((dataset / "manifest.json").read_text())
    for shards in ([{"rows": 3}], [{"file": "x", "rows": "many"}], ["x"]):
        (dataset / "manifest.json").write_text(json.dumps({**manifest, "shards": shards}))
        with pytest.raises(DatasetError, match="damaged"):
            open_source(dataset)


# ---- a run ----


def test_episodes_are_trajectories(run: Path) -> None:
    source = open_source(run)
    assert source.problems == []
    page = answers.rows(source, {})
    assert page["found"] == 6
    assert page["filters"]["score"]["values"] == [["0", 3], ["1", 3]]
    assert answers.rows(source, {"score": "0", "agent": "oracle", "task": "write_note"})["found"] == 3
    row = answers.row(source, {"row": "1"})
    assert (row["step_back"], row["step_next"]) == (0, 2)
    assert row["same_step"] == [[1, "app_minimization"], [4, "clean"]]
    detail = row["detail"]
    assert (detail["action"], detail["points"], detail["size"]) == ("click at (101, 50)", [(101, 50)], (320, 200))
    assert ("Event", 'minimise: {"windows": 2}') in detail["notes"]
    assert ("Episode", "ok, score 0: there is no note") in detail["notes"]
    assert json.loads(detail["plan"]) == {"corruption": "app_minimization"}
    assert dict(detail["fields"]["Episode"])["status"] == "ok"
    assert (source.picture(1, True)[0, 0, 0], source.picture(1, False)[0, 0, 0]) == (200, 40)


def test_where_the_agent_saw_the_clean_screen_there_is_no_picture_before(run: Path) -> None:
    detail = answers.row(open_source(run), {"row": "0"})["detail"]
    assert detail["no_before"] == "the agent saw the clean picture"
    last = answers.row(open_source(run), {"row": "5"})["detail"]
    assert (last["action"], last["code"]) == ("the last observation", "")


def test_broken_parts_of_a_run_are_named(run: Path) -> None:
    homes = {home.name.split("__")[1]: home for home in (run / "episodes").iterdir()}
    steps = homes["app_minimization"] / "steps.jsonl"
    lines = steps.read_text().splitlines()
    steps.write_text("\n".join([lines[0], "{rubbish", lines[2].replace("frames/0002.seen.png", "../../../run.json")]))
    for name, record in (("bytes", b"\xff\xfe"), ("list", b"[1]"), ("nosteps", b"{}")):
        (run / "episodes" / name).mkdir()
        (run / "episodes" / name / "episode.json").write_bytes(record)
    (run / "episodes" / "unfinished").mkdir()
    source = open_source(run)
    named = [problem.partition(":")[0] for problem in source.problems]
    assert named[1:] == ["episodes/bytes", "episodes/list", "episodes/nosteps"]
    assert named[0] == "1 episode(s) without a record (not finished), such as unfinished"
    assert len(source.index) == 6
    for number, words in ((1, "not JSON"), (2, "leaves the source folder")):
        assert words in answers.row(source, {"row": str(number)})["detail"]["problem"]
        with pytest.raises(HijackError, match=words):
            source.picture(number, False)


def test_what_an_agent_wrote_need_not_be_an_action(run: Path) -> None:
    file = next((run / "episodes").glob("*clean*")) / "steps.jsonl"
    lines_of(file, [{"step": 0, "image": "frames/0000.png", "raw": "import ((("}, {"step": 1, "image": 5, "events": 3}])
    source = open_source(run)
    first = next(n for n in range(len(source.index)) if "clean" in source.index.ids[n])
    detail = answers.row(source, {"row": str(first)})["detail"]
    assert (detail["action"], detail["code"], detail["points"]) == ("not a pyautogui action", "import (((", [])
    assert answers.row(source, {"row": str(first + 1)})["detail"]["problem"]


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"format": "x"}', '{"format": "agenthijack-run", "version": 2}', "[" * 100_000]
)
def test_a_log_that_is_none_is_refused(run: Path, text: str) -> None:
    (run / "run.json").write_text(text)
    with pytest.raises(DatasetError, match=r"run\.json"):
        open_source(run)


def test_a_run_without_an_episode_is_an_empty_page(run: Path) -> None:
    shutil.rmtree(run / "episodes")
    source = open_source(run)
    assert (source.problems, answers.rows(source, {})["found"]) == ([], 0)


def test_a_log_needs_no_bench_around_it(run: Path) -> None:
    whole = answers.rows(open_source(run), {})
    for name in ("run.json", "records.jsonl"):
        (run / name).unlink()
    assert answers.rows(open_source(run), {}) == whole


# ---- the server ----


def test_answers_over_http(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    status, page, headers = get("/")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "Access-Control-Allow-Origin" not in headers
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    for path in re.findall(rb'(?:src|href)="([a-z.]+)"', page):
        assert get(f"/{path.decode()}")[0] == 200
    assert json.loads(get("/api/about")[1])["rows"] == 30
    assert json.loads(get("/api/rows?corruption=marks&q=")[1])["found"] == 6
    assert json.loads(get("/api/row?row=t0%2F0001%2Fmarks")[1])["id"] == "t0/0001/marks"
    status, picture, headers = get("/picture/4")
    assert (status, headers["Content-Type"]) == (200, "image/png")
    assert np.array_equal(read(picture), np.array(open_dataset(dataset)[4]["screenshot"]))
    assert get("/thumb/4")[2]["Content-Type"] == "image/jpeg"
    assert np.array_equal(read(get("/before/4")[1]), np.array(open_dataset(dataset)[0]["screenshot"]))


def test_there_is_nothing_else(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    pictures = ("/thumb/30", "/thumb/-1", "/thumb/1x", "/thumb/", "/picture/9999999999", "/picture/../manifest.json")
    files = ("/manifest.json", "/../manifest.json", "/%2e%2e/manifest.json", "//etc/passwd", "/view.html", "/api", "*")
    for path in (*pictures, *files):
        status, body, _ = get(path)
        assert (status, body) == (404, b"there is nothing here"), path


def test_mistakes_are_answers(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    for path, words in (
        ("/api/row", b"no row"),
        ("/api/rows?x=1", b"no filter 'x'"),
        ("/api/row?row=%ff%00", b"no row"),
    ):
        status, body, headers = get(path)
        assert (status, headers["Content-Type"]) == (422, "text/plain; charset=utf-8")
        assert words in body


def test_only_our_own_names_are_answered(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    for host in ("127.0.0.1:1234", "localhost:99", "LOCALHOST"):
        assert get("/api/about", Host=host)[0] == 200, host
    for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "[::1]:80", "0.0.0.0:80"):
        for path in ("/", "/api/about", "/picture/0", "/nothing"):
            assert get(path, Host=host)[0] == 403, host


def test_a_port_that_is_taken_is_an_error(dataset: Path) -> None:
    source = open_source(dataset)
    with ViewServer(source) as first, pytest.raises(HijackError, match="give another --port"):
        ViewServer(source, int(first.server_address[1]))
    with pytest.raises(HijackError, match="port 99999"):
        ViewServer(source, 99999)


def test_many_at_once_get_the_same(dataset: Path, serving: Any) -> None:
    get = serving(dataset)
    alone = [get(f"/picture/{number}")[1] for number in range(8)]
    again = serving(dataset)
    found: dict[int, bytes] = {}
    threads = [threading.Thread(target=lambda n=n: found.update({n: again(f"/picture/{n}")[1]})) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert [found[number] for number in range(8)] == alone


# ---- the command ----


def command(*words: object) -> subprocess.Popen[str]:
    line = [sys.executable, "-m", "hijack_data.cli", "view", *map(str, words)]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("harmed", [False, True])
def test_the_command_serves_until_ctrl_c(recording: Any, small: Any, tmp_path: Path, harmed: bool) -> None:
    build(recording(), tmp_path / "out", corruptions={"marks": small["marks"]}, rows_per_shard=6)
    if harmed:
        os.truncate(min((tmp_path / "out" / "data").iterdir()), 100)
    process = command(tmp_path / "out")
    assert process.stdout is not None
    line = process.stdout.readline()
    found = re.search(r"(\d+) rows \(.*\) at http://127\.0\.0\.1:(\d+)/", line)
    assert found is not None
    assert int(found[1]) == (6 if harmed else 12)
    link = http.client.HTTPConnection("127.0.0.1", int(found[2]), timeout=30)
    link.request("GET", "/api/about")
    assert json.loads(link.getresponse().read())["rows"] == int(found[1])
    link.close()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (out, process.returncode) == ("the page has ended\n", int(harmed))
    assert ("data/train-00000.parquet" in err) == harmed
    assert "Traceback" not in err


def test_the_command_refuses_what_it_cannot_show(tmp_path: Path) -> None:
    process = command(tmp_path)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err.startswith(f"hijack: error: {tmp_path}: not a dataset of ours")


def test_the_library_stays_light() -> None:
    code = "import sys, pipelines.viewer.cli; sys.exit('pyarrow' in sys.modules or 'torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
