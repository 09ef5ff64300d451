"""The sets of the suite: each follows from its rule, and no task ever changes its side."""

import hashlib

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.errors import UnknownNameError
from online_env.bench.config import load_bench, override
from online_env.tasks import catalogue, get, suite, task_sets

# What was trained on must never be scored: a task that is added gets a side, none moves. The
# digest is of the held-out tasks of this release; write it anew only for tasks that are added.
HELD_OUT = "aeebe8e4ff8b18d0"


def test_every_task_is_on_exactly_one_side() -> None:
    training, held_out = task_sets.members("training"), task_sets.members("held_out")
    assert sorted([*training, *held_out]) == sorted(suite.class_references())
    assert set(training) & set(held_out) == set()


def test_no_task_moves_to_the_other_side() -> None:
    held_out = "\n".join(sorted(task_sets.members("held_out")))
    assert hashlib.sha256(held_out.encode()).hexdigest()[:16] == HELD_OUT


def test_core_and_small_follow_from_the_rule() -> None:
    domains, lengths = task_sets.candidates()
    assert domains == {name: get(name).domain for name in domains}
    assert list(task_sets.members("core")) == task_sets.choose(domains, lengths, task_sets.CORE)
    light = {name: domain for name, domain in domains.items() if task_sets.is_light(get(name).apps)}
    assert list(task_sets.members("small")) == task_sets.quick(light, lengths, task_sets.SMALL)


def test_every_task_was_measured() -> None:
    measurements = task_sets.read_measurements()
    assert sorted(measurements) == sorted(suite.class_references()), (
        "measure: python benchmarks/suite.py --write"
    )
    assert max(measured.actions for measured in measurements.values()) <= 25
    assert min(measured.actions for measured in measurements.values()) >= 2


def test_the_rule_takes_turns_over_domains_and_lengths() -> None:
    domains = {"a1": "a", "a2": "a", "a3": "a", "b1": "b", "c1": "c", "c2": "c"}
    lengths = {"a1": 1, "a2": 5, "a3": 9, "b1": 4, "c1": 2, "c2": 3}
    assert task_sets.choose(domains, lengths, 3) == ["a2", "b1", "c2"]
    assert task_sets.choose(domains, lengths, 5) == ["a2", "a3", "b1", "c1", "c2"]
    assert task_sets.choose(domains, lengths, 99) == sorted(domains)
    assert task_sets.quick(domains, lengths, 2) == ["b1", "c2"]


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
