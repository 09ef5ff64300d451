"""The sets of the suite: none changes, and no task ever changes its side."""

import hashlib

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.errors import UnknownNameError
from online_env.bench.config import load_bench, override
from online_env.tasks import catalogue, suite, task_sets

# Runs over `small` and `core` stay comparable, and what was trained on must never be scored: a task
# that is added gets a side, none moves. Write the digest of `held_out` anew only for added tasks.
DIGESTS = {"small": "a37efe065c2a8ef8", "core": "c9711a44459c356d", "held_out": "aeebe8e4ff8b18d0"}


def test_every_task_is_on_exactly_one_side() -> None:
    training, held_out = task_sets.members("training"), task_sets.members("held_out")
    assert sorted([*training, *held_out]) == sorted(suite.class_references())
    assert set(training) & set(held_out) == set()


@pytest.mark.parametrize("name", DIGESTS)
def test_no_set_of_published_runs_changes(name: str) -> None:
    names = "\n".join(sorted(task_sets.members(name)))
    assert hashlib.sha256(names.encode()).hexdigest()[:16] == DIGESTS[name]


def test_every_task_was_measured() -> None:
    measurements = task_sets.read_measurements()
    assert sorted(measurements) == sorted(suite.class_references()), (
        "measure: python benchmarks/suite.py --write"
    )
    assert max(measured.actions for measured in measurements.values()) <= 25
    assert min(measured.actions for measured in measurements.values()) >= 2


def test_sets_are_named_in_configurations_and_on_the_command_line() -> None:
    assert load_bench("embedded_small").tasks == task_sets.members("small")
    assert load_bench("embedded_core").tasks == task_sets.members("core")
    assert load_bench("embedded").tasks == task_sets.members("suite")
    assert override(load_bench("embedded_small"), task="held_out").tasks == task_sets.members(
        "held_out"
    )
    with pytest.raises(UnknownNameError, match="did you mean 'core'"):
        task_sets.members("cor")


def test_at_least_a_hundred_tasks_in_twelve_domains_and_a_third_of_them_long() -> None:
    result = catalogue.rows()
    assert len(result) >= 100
    assert len({row["domain"] for row in result}) >= 12
    assert sum(bool(row["infeasible"]) for row in result) >= 8
    assert 3 * sum(row["actions"] > 8 for row in result) >= len(result)


def test_the_catalogue_is_that_of_the_tasks() -> None:
    from pathlib import Path

    page = Path(__file__).parents[2] / "docs" / "suite.md"
    pictures = "images/suite" if (page.parent / "images" / "suite").is_dir() else ""
    assert page.read_text() == catalogue.page(catalogue.rows(), pictures)
