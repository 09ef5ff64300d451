"""What a person sees of a run: a line for each episode, the rate and the time left."""

import io

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from rich.console import Console

from online_env.bench.config import Bench
from online_env.bench.jobs import Job, attempts, jobs
from online_env.bench.progress import ProgressDisplay
from online_env.bench.runner import needs_attempt
from online_env.report.formatting import MAX_LINE, shorten

BENCH = Bench(tasks=("write_note",), corruptions={"clean": None}, seeds=(0, 1), max_steps=10)
JOB = Job("mine", "write_note", "clean", 0)


def record(status, **more):
    return {"status": status, "steps": 3, "seconds": 1.25, "reason": "", "problem": "", **more}


def printed(*ended):
    """The lines of a run whose episodes ended so."""
    stream = io.StringIO()
    console = Console(file=stream, width=60)
    with ProgressDisplay([JOB] * len(ended), console) as display:
        for number, value in enumerate(ended, 1):
            display.begins(JOB, number, 0)
            display.ended(JOB, number, value)
    return stream.getvalue().splitlines()


def test_each_episode_is_a_line_with_its_result():
    lines = printed(
        record("ok", score=0.5, reason="half of it"),
        record("invalid", problem="no [bold]effect[/]"),
        record("error", problem="line one\nline two"),
    )
    assert lines == [
        "[1/3] mine  write_note  seed 0  clean  0.50  3 steps  1.2 s  half of it",
        "[2/3] mine  write_note  seed 0  clean  invalid  3 steps  1.2 s  no [bold]effect[/]",
        "[3/3] mine  write_note  seed 0  clean  error  3 steps  1.2 s  line one line two",
    ]


def test_long_problems_are_shortened():
    assert shorten("a\nb") == "a b"
    long = shorten("x" * 1000)
    assert len(long) == MAX_LINE
    assert long.endswith("x ...")


class Clock:
    """Seconds that pass when the test says so."""

    def __init__(self):
        self.now = 5.0

    def __call__(self):
        return self.now


def test_the_rate_and_the_time_left_count_what_was_played_now():
    clock, stream = Clock(), io.StringIO()
    console = Console(file=stream, width=60)
    with ProgressDisplay([JOB] * 12, console, finished=2, clock=clock) as display:
        assert display.pace == ""
        for number, status in ((3, "invalid"), (3, "ok"), (4, "ok")):
            display.begins(JOB, number, 0)
            if number == 3:
                assert display.pace == ""  # its first attempt did not count
            clock.now += 30
            display.ended(JOB, number, record(status, score=1.0))
        # Two in 90 s, and eight are left.
        assert display.pace == "80 an hour, 6 min left"
    lines = [line for line in stream.getvalue().splitlines() if not line.startswith("[")]
    assert lines == ["3 of 12 episodes, 60 an hour, 9 min left"]


def test_jobs_find_their_attempts_by_task_and_seed():
    first, second = jobs(BENCH)
    rows = [
        {"agent": "oracle", "task": task, "corruption": "clean", "seed": seed, "attempt": attempt}
        for task, seed, attempt in (
            ("write_note-0", 0, 0),
            ("write_note-1", 1, 0),
            ("write_note-1", 1, 1),
            ("other-0", 0, 0),
        )
    ]
    result = attempts([first, second], rows)
    assert [len(result[job]) for job in (first, second)] == [1, 2]
    assert first.id == "write_note-0__clean__s0__oracle"


@pytest.mark.parametrize(
    ("made", "retries", "again"),
    [
        ([], 0, True),
        ([record("ok")], 3, False),
        ([record("invalid")], 0, False),
        ([record("invalid")], 1, True),
        ([record("invalid"), record("invalid")], 1, False),
        ([record("error", cause="machine")], 1, True),
        ([record("error", cause="agent")], 1, False),
        ([record("invalid"), record("ok")], 3, False),
    ],
)
def test_only_failures_of_the_machine_are_run_again(made, retries, again):
    assert needs_attempt(made, retries) == again
