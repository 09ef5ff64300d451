"""Plans in words: the grammar, and that the plans of all tasks can be read."""

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from online_env import tasks
from online_env.tasks import task_sets
from online_env.tasks.plan_words import PlanStep, PlanWordsError, quoted, read_plan


def read(line: str) -> PlanStep:
    (step,) = read_plan([line])
    assert step.line == line
    return step


def check_step(line: str, **parts: object) -> None:
    assert read(line) == PlanStep(line=line, **parts)


def test_each_form_is_read():
    check_step('window "Thunar"', verb="window", text="Thunar")
    check_step('click "File"', verb="click", text="File")
    check_step('double-click "a b"', verb="double-click", text="a b")
    check_step('click "Edit" near "Summary"', verb="click", text="Edit", near="Summary")
    check_step('right-click left of "x"', verb="right-click", text="x", side="left of")
    check_step('ctrl-click below "x" near "y"', verb="ctrl-click", text="x", side="below", near="y")
    check_step(r'type "one\ntwo"', verb="type", text="one\ntwo")
    check_step("press Ctrl+S", verb="press", keys=("ctrl", "s"))
    check_step("press tab 3 times", verb="press", keys=("tab",), count=3)
    check_step("scroll up", verb="scroll", way="up")
    check_step("scroll down 12", verb="scroll", way="down", count=12)
    check_step('scroll down to "Send"', verb="scroll", way="down", text="Send")
    check_step("wait", verb="wait")
    check_step('wait for "Saved" near "notes"', verb="wait", text="Saved", near="notes")
    check_step('give up "no button"', verb="give up", text="no button")


@pytest.mark.parametrize(
    "text", ['say "no"', "back\\slash", "two\nlines", '" near "Trash', "{braces}", "Ähre 設定"]
)
def test_any_text_survives_its_quotation_marks(text):
    assert read(f"click {quoted(text)} near {quoted(text)}").text == text
    assert read(f"type {quoted(text)}").text == text


@pytest.mark.parametrize(
    ("line", "remedy"),
    [
        ("klick", "did you mean 'click'"),
        ("", "a step begins with a verb; known: click"),
        ("waiting", "did you mean 'wait'"),
        ("click Save", 'click "text"'),
        ('click "Save', 'click "text"'),
        ("click 3", 'click "text"'),
        ('click " "', 'click "text"'),
        ('click "a" "b"', "'\"b\"' is too much"),
        ('click "a" near', 'near "text"'),
        ("type", 'type "text"'),
        ("press", "press ctrl+s"),
        ("press entre", "did you mean 'enter'"),
        ("press tab 1000 times", "1000 times is not 1 to 100"),
        ("press tab 000 times", "0 times is not 1 to 100"),
        ("scroll", 'scroll down to "Send"'),
        ("scroll down to", 'scroll down to "text"'),
        ("wait 3", "'3' is too much"),
    ],
)
def test_a_mistake_names_step_and_remedy(line, remedy):
    with pytest.raises(PlanWordsError) as caught:
        read_plan(["wait", line, "wait", "also wrong"])
    first, second = str(caught.value).split("\n")
    assert first.startswith(f"step 2, {line!r}: ")
    assert remedy in first
    assert second.startswith("step 4, 'also wrong': ")


def test_a_number_that_python_does_not_read_is_too_large():
    with pytest.raises(PlanWordsError, match=r": 9{20} times is not 1 to 100$"):
        read_plan([f"press tab {'9' * 5000} times"])


@pytest.mark.parametrize("name", task_sets.members("suite"))
def test_the_plans_of_the_suite_can_be_read(name):
    plans = [read_plan(tasks.get(name, seed).plan()) for seed in range(3)]
    if name in task_sets.members("small"):
        assert all(plans)
        assert all(plan[0].verb == "window" for plan in plans), "what the onlooker watches"
    for plan in plans:
        assert len(plan) < 60, "an episode has no more steps"
