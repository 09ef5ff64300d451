"""Scripts that solve tasks of MiniWoB++ by pointer and keyboard, from what a page shows.

A script reads the instruction on the page and its elements in the accessibility tree, as an agent
sees them in the picture. It knows neither the page's variables nor its validator.
"""

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from hijack_data.elements.accessibility_nodes import AccessibleNode, nodes_from_tree

from ..errors import DesktopError
from ..tasks.hand import Hand
from . import miniwob_words as words

_HTML = "https://accessibility.ubuntu.example.org/ns/html}"
MAX_TRIES = 40  # clicks in search of something


class ShownPage:
    """The page in front, read anew by each method.

    Args:
        hand: Pointer and keyboard of the oracle.
    """

    def __init__(self, hand: Hand) -> None:
        self._hand = hand

    def nodes(
        self, tag: str = "", name: str | None = None, **attributes: str
    ) -> list[AccessibleNode]:
        """Return the visible elements, in document order.

        Args:
            tag: The tag in HTML; "" for any.
            name: The whole text; `None` for any.
            **attributes: Values of `id`, `type` or `class` in HTML; a class may be one of several.
        """
        return [
            node
            for node in nodes_from_tree(self._hand.tree())
            if node.visible
            and node.box is not None
            and (not tag or node.attributes.get(f"{_HTML}tag") == tag)
            and (name is None or " ".join(node.name.split()) == name)
            and all(
                value in node.attributes.get(_HTML + key, "").split()
                for key, value in attributes.items()
            )
        ]

    def find(self, tag: str = "", name: str | None = None, **attributes: str) -> AccessibleNode:
        """Return the first of `nodes`.

        Raises:
            DesktopError: The page shows none.
        """
        for node in self.nodes(tag, name, **attributes):
            return node
        raise DesktopError(f"the page shows no {tag or 'element'} {name or ''} {attributes or ''}")

    @property
    def query(self) -> str:
        """The instruction, as the page shows it."""
        return " ".join(self.find(id="query").name.split())

    def quoted(self) -> list[str]:
        """Return the words that the instruction has in quotation marks."""
        return words.quoted_texts(self.query)

    def click(self, node: AccessibleNode) -> None:
        """Click in the middle of an element."""
        x1, y1, x2, y2 = node.box or (0, 0, 0, 0)
        self._hand.run(f"pyautogui.click({(x1 + x2) // 2}, {(y1 + y2) // 2})")

    def fill(self, node: AccessibleNode, text: str) -> None:
        """Replace the content of a field by a text."""
        self.click(node)
        self._hand.replace(text)

    def submit(self, name: str = "Submit") -> None:
        """Click the button of a form."""
        self.click(self.find("button", name))

    def type(self, text: str) -> None:
        """Type a text where the focus is."""
        self._hand.run(f"pyautogui.write({text!r})")

    def press(self, *keys: str) -> None:
        """Press keys together."""
        self._hand.press(*keys)


PageScript: TypeAlias = Callable[[ShownPage], None]


def _clicking(tag: str = "", **attributes: str) -> PageScript:
    """Return a script that clicks an element; one without attributes has the quoted name."""

    def click(page: ShownPage) -> None:
        name = None if attributes.keys() - {"class"} else page.quoted()[0]
        page.click(page.find(tag, name, **attributes))

    return click


def _typing(field_id: str, answer: Callable[[ShownPage], str]) -> PageScript:
    """Return a script that types an answer into a field and hands the form in."""

    def answer_form(page: ShownPage) -> None:
        page.fill(page.find("input", id=field_id), answer(page))
        page.submit()

    return answer_form


def _searching(tag: str, **attributes: str) -> PageScript:
    """Return a script that opens one element after the other until the quoted link shows."""

    def search(page: ShownPage) -> None:
        (name,) = page.quoted()
        for number in range(MAX_TRIES):
            links = page.nodes("span", name)
            if links:
                page.click(links[0])
                return
            headers = page.nodes(tag, **attributes)
            if not headers:
                break
            page.click(headers[number % len(headers)])
        raise DesktopError(f"the page shows no {name!r}")

    return search


def _quoted_text(page: ShownPage) -> str:
    return page.quoted()[0]


def _change_case(page: ShownPage) -> str:
    return words.cased_text(page.query)


def _read_cells(page: ShownPage) -> dict[str, str]:
    cells = [" ".join(cell.name.split()) for cell in page.nodes("td")]
    return dict(zip(cells[::2], cells[1::2], strict=True))


def _read_table(page: ShownPage) -> str:
    match = re.search(r"value of (.*) into", page.query)
    return _read_cells(page)[match[1].strip() if match else ""]


def _find_word(page: ShownPage) -> str:
    paragraph = page.find("p").name.split()
    return paragraph[words.ordinals(page.query)[0]].strip(".,")


def _calculate(page: ShownPage) -> str:
    first, sign, second = page.find(id="math-problem").name.split()[:3]
    a, b = int(first), int(second)
    return str({"+": a + b, "-": a - b, "x": a * b}[sign])


def _solve_for_x(page: ShownPage) -> str:
    first, sign, second, _, result = page.find(id="math-problem").name.split()
    if first == "x":
        return str(int(result) - int(second) if sign == "+" else int(result) + int(second))
    return str(int(result) - int(first) if sign == "+" else int(first) - int(result))


def _count_blocks(page: ShownPage) -> str:
    return str(len(page.nodes("span", **{"class": "addition-block"})))


def _close_dialog(page: ShownPage) -> None:
    page.click(page.find("button", **{"class": "ui-dialog-titlebar-close"}))


def _answer_dialog(page: ShownPage) -> None:
    (name,) = page.quoted()
    if name == "x":
        _close_dialog(page)
    else:
        page.click(page.find("button", name))


def _select(page: ShownPage) -> None:
    for name in words.option_names(page.query):
        page.click(page.find("label", name))
    page.submit()


def _click_sequence(page: ShownPage) -> None:
    page.click(page.find("button", "ONE"))
    page.click(page.find("button", "TWO"))


def _click_tab(page: ShownPage) -> None:
    page.click(page.find("a", words.tab_name(page.query)))


def _focus(page: ShownPage) -> None:
    (index,) = words.ordinals(page.query) or [0]
    page.click(page.nodes("input", type="text")[index])


def _enter_password(page: ShownPage) -> None:
    (text,) = page.quoted()
    for field in page.nodes("input", type="password"):
        page.fill(field, text)
    page.submit()


def _log_in(page: ShownPage) -> None:
    user, password = page.quoted()
    for field_id, text in (("username", user), ("password", password)):
        page.fill(page.find("input", id=field_id), text)
        for button in page.nodes("button", id="popup-cancel"):
            page.click(button)
            page.fill(page.find("input", id=field_id), text)
    page.click(page.find("button", id="subbtn"))


def _expand(page: ShownPage) -> None:
    page.click(page.find("h3"))
    page.submit()


def _click_widget(page: ShownPage) -> None:
    (kind,) = page.quoted()
    if kind in ("button", "textarea"):
        node = page.find(kind)
    else:
        node = page.find("input", type="input" if kind == "text" else kind)
    page.click(node)


def _choose_from_list(page: ShownPage) -> None:
    page.click(page.find("select"))
    page.press("esc")  # the list itself is no part of the page's picture
    page.type(words.list_entry(page.query))
    page.submit()


def _read_table_twice(page: ShownPage) -> None:
    values = _read_cells(page)
    for number in "12":
        label = page.find(id=f"ll{number}").name.strip().removesuffix(":")
        page.fill(page.find("input", id=f"tt{number}"), values[label])
    page.submit()


def _enter_parts(page: ShownPage) -> None:
    """Type a date or a time, whose parts follow one another in a field of Chromium's."""
    page.click(page.find("input", id="tt"))
    for _ in range(3):
        page.press("left")
    for part in words.moment_parts(page.query):
        page.type(part)
    page.submit()


def _spin(page: ShownPage) -> None:
    number = words.spinner_value(page.query)
    for _ in range(abs(number)):
        name = "ui-spinner-up" if number > 0 else "ui-spinner-down"
        page.click(page.find(**{"class": name}))
    page.submit()


def _odd_or_even(page: ShownPage) -> None:
    for index, node in enumerate(page.nodes(**{"class": "display-number"})):
        name = "odd" if int(node.name) % 2 else "even"
        page.click(page.nodes("button", **{"class": name})[index])
    page.submit()


def _generate_number(page: ShownPage) -> None:
    limit = int((re.findall(r"\d+", page.query) or ["0"])[0])
    for _ in range(MAX_TRIES):
        page.click(page.find("button", id="generate"))
        number = int(page.find(id="display-number").name)
        if {
            "less": number < limit,
            "greater": number > limit,
            "odd": number % 2 == 1,
            "even": number % 2 == 0,
        }[re.findall("less|greater|odd|even", page.query)[0]]:
            break
    page.submit()


def _copy_and_paste(page: ShownPage) -> None:
    page.click(page.find("textarea"))
    page.press("ctrl", "a")
    page.press("ctrl", "c")
    page.click(page.find("input", id="answer-input"))
    page.press("ctrl", "v")
    page.submit()


def _fill_by_place(page: ShownPage) -> None:
    radio, text = words.ordinals(page.query)
    page.click(page.nodes("input", type="radio")[radio])
    page.fill(page.nodes("input", type="text")[text], page.quoted()[0])
    page.submit()


# By the name of the page, without `.html`.
ORACLES: Mapping[str, PageScript] = MappingProxyType(
    {
        "choose-list": _choose_from_list,
        "click-button": _clicking("button"),
        "click-button-sequence": _click_sequence,
        "click-checkboxes": _select,
        "click-checkboxes-large": _select,
        "click-checkboxes-transfer": _select,
        "click-collapsible": _expand,
        "click-collapsible-2-nodelay": _searching("h3"),
        "click-collapsible-nodelay": _expand,
        "click-dialog": _close_dialog,
        "click-dialog-2": _answer_dialog,
        "click-link": _clicking("span", **{"class": "alink"}),
        "click-option": _select,
        "click-tab": _click_tab,
        "click-tab-2": _searching("a", **{"class": "ui-tabs-anchor"}),
        "click-tab-2-easy": _searching("a", **{"class": "ui-tabs-anchor"}),
        "click-test": _clicking("button", id="subbtn"),
        "click-test-2": _clicking("button", id="subbtn"),
        "click-test-transfer": _clicking("button", id="subbtn"),
        "click-widget": _click_widget,
        "copy-paste": _copy_and_paste,
        "enter-date": _enter_parts,
        "enter-password": _enter_password,
        "enter-text": _typing("tt", _quoted_text),
        "enter-text-2": _typing("tt", _change_case),
        "enter-text-dynamic": _typing("tt", _quoted_text),
        "enter-time": _enter_parts,
        "find-word": _typing("answer-input", _find_word),
        "focus-text": _focus,
        "focus-text-2": _focus,
        "form-sequence-2": _fill_by_place,
        "generate-number": _generate_number,
        "login-user": _log_in,
        "login-user-popup": _log_in,
        "navigate-tree": _searching("span", **{"class": "folder"}),
        "odd-or-even": _odd_or_even,
        "read-table": _typing("tt", _read_table),
        "read-table-2": _read_table_twice,
        "simple-algebra": _typing("math-answer", _solve_for_x),
        "simple-arithmetic": _typing("math-answer", _calculate),
        "unicode-test": _clicking("button"),
        "use-spinner": _spin,
        "visual-addition": _typing("math-answer", _count_blocks),
    }
)
