"""Plans in words for tasks of MiniWoB++, from the instruction that a page shows.

A plan names what stands in the instruction and what every seed shows, such as a button. A page
whose task is to read, count or search has none: there the words depend on the picture.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

from ..tasks.plan_words import quoted
from . import miniwob_words as words

PagePlan: TypeAlias = Callable[[str], Iterator[str]]

_SUBMIT = 'click "Submit"'
_FIRST_FIELD = "press tab"  # it has no text, and stands elsewhere in each seed


def plan_page(page: str, instruction: str) -> Sequence[str]:
    """Return the plan of a task, in the grammar of `plan_words`; () if the page has none.

    Args:
        page: The name of the page, without `.html`.
        instruction: The task as the page words it; "" before it was loaded.
    """
    plan = PLANS.get(page)
    return tuple(plan(instruction)) if plan is not None and instruction else ()


def _click(*names: str) -> PagePlan:
    """Return the plan that clicks what every seed shows."""

    def plan(instruction: str) -> Iterator[str]:
        for name in names:
            yield f"click {quoted(name)}"

    return plan


def _type(text: Callable[[str], str]) -> PagePlan:
    """Return the plan that types a text into the only field."""

    def plan(instruction: str) -> Iterator[str]:
        yield _FIRST_FIELD
        yield f"type {quoted(text(instruction))}"
        yield _SUBMIT

    return plan


def _quoted_text(instruction: str) -> str:
    return words.quoted_texts(instruction)[0]


def _click_quoted(instruction: str) -> Iterator[str]:
    yield f"click {quoted(_quoted_text(instruction))}"


def _click_tab(instruction: str) -> Iterator[str]:
    yield f"click {quoted(words.tab_name(instruction))}"


def _expand(instruction: str) -> Iterator[str]:
    yield 'click "Section #"'
    yield "wait"  # until the section, which moves the button down, is open
    yield _SUBMIT


def _select(instruction: str) -> Iterator[str]:
    for name in words.option_names(instruction):
        yield f"click {quoted(name)}"
    yield _SUBMIT


def _choose_from_list(instruction: str) -> Iterator[str]:
    yield _FIRST_FIELD
    yield f"type {quoted(words.list_entry(instruction))}"
    yield _SUBMIT


def _enter_moment(instruction: str) -> Iterator[str]:
    yield _FIRST_FIELD
    for part in words.moment_parts(instruction):
        yield f"type {quoted(part)}"
    yield _SUBMIT


def _enter_password(instruction: str) -> Iterator[str]:
    for label in ("Password", "Verify password"):
        yield f"click below {quoted(label)}"
        yield f"type {quoted(_quoted_text(instruction))}"
    yield _SUBMIT


def _log_in(instruction: str) -> Iterator[str]:
    for label, text in zip(("Username", "Password"), words.quoted_texts(instruction), strict=True):
        yield f"click below {quoted(label)}"
        yield f"type {quoted(text)}"
    yield 'click "Login"'


# By the name of the page, without `.html`.
PLANS: Mapping[str, PagePlan] = MappingProxyType(
    {
        "choose-list": _choose_from_list,
        "click-button": _click_quoted,
        "click-button-sequence": _click("ONE", "TWO"),
        "click-checkboxes": _select,
        "click-checkboxes-large": _select,
        "click-collapsible": _expand,
        "click-option": _select,
        "click-tab": _click_tab,
        "click-test": _click("Me!"),
        "click-test-2": _click("ONE"),
        "enter-date": _enter_moment,
        "enter-password": _enter_password,
        "enter-text": _type(_quoted_text),
        "enter-text-2": _type(words.cased_text),
        "enter-text-dynamic": _type(_quoted_text),
        "enter-time": _enter_moment,
        "login-user": _log_in,
    }
)
