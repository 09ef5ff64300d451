"""Every task of the suite: its words, and its judgement of right and wrong results, in a folder."""

from pathlib import Path

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.tasks import TASKS, checking, get, suite

NAMES = sorted(suite.class_references())


def test_no_two_tasks_have_one_name() -> None:
    files = list(Path(suite.__file__).parent.glob("*/[a-z]*.py"))
    assert len(files) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_task_judges_results_as_it_should(name: str) -> None:
    for seed in range(2):
        assert list(checking.problems(get(name, seed))) == []


@pytest.mark.parametrize("name", NAMES)
def test_a_task_of_the_suite_has_all_that_it_should(name: str) -> None:
    assert list(checking.shortcomings(get(name))) == []


@pytest.mark.parametrize("name", NAMES)
def test_a_task_stands_in_the_folder_of_its_domain(name: str) -> None:
    task = TASKS.get(name)
    assert (task.name, task.domain) == (name, task.__module__.split(".")[-2])


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_gives_the_same_task_and_other_seeds_others(name: str) -> None:
    instructions = [get(name, seed).instruction for seed in range(20)]
    assert instructions == [get(name).variant(seed).instruction for seed in range(20)]
    assert len(set(instructions)) > 2
