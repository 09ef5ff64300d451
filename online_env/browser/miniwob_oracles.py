"""Scripts that solve tasks of MiniWoB++ by pointer and keyboard, from what a page shows.

A script reads the instruction on the page and its elements in the accessibility tree, as an agent
sees them in the picture. It knows neither the page's variables nor its validator.
"""

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType

from hijack_data.elements.accessibility_nodes import AccessibleNode, nodes_from_tree

from ..errors import DesktopError
from ..tasks.hand import Hand

_HTML = "https://accessibility.ubuntu.example.org/ns/html}"
_QUOTED = re.compile(r'"([^"]*)"')
_NUMBERS = {"1st": 0, "2nd": 1, "3rd": 2}


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
            if node.shown
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
        return [words.strip() for words in _QUOTED.findall(self.query)]

    def click(self, node: AccessibleNode) -> None:
        """Click in the middle of an element."""
        x1, y1, x2, y2 = node.box or (0, 0, 0, 0)
        self._hand.run(f"pyautogui.click({(x1 + x2) // 2}, {(y1 + y2) // 2})")

    def fill(self, node: AccessibleNode, text: str) -> None:
        """Type a text into a field, in the place of what it holds."""
        self.click(node)
        self._hand.replace(text)

    def submit(self, name: str = "Submit") -> None:
        """Click the button of a form."""
        self.click(self.find("button", name))

    def press(self, *keys: str) -> None:
        """Press keys together."""
        self._hand.press(*keys)


def _click_test(page: ShownPage) -> None:
    page.click(page.find("button", id="subbtn"))


def _click_quoted(page: ShownPage) -> None:
    (name,) = page.quoted()
    page.click(page.find(name=name, tag="button"))


def _click_link(page: ShownPage) -> None:
    (name,) = page.quoted()
    page.click(page.find("span", name, **{"class": "alink"}))


def _close_dialog(page: ShownPage) -> None:
    page.click(page.find("button", **{"class": "ui-dialog-titlebar-close"}))


def _answer_dialog(page: ShownPage) -> None:
    (name,) = page.quoted()
    if name == "x":
        _close_dialog(page)
    else:
        page.click(page.find("button", name))


def _chosen(page: ShownPage) -> list[str]:
    """Return the names in "Select a, b and click Submit."."""
    match = re.search(r"Select (.*?)(?: and click|,? and then click)", page.query)
    text = match[1] if match else ""
    return [] if text == "nothing" else [name for name in re.split(r", ?| and ", text) if name]


def _select(page: ShownPage) -> None:
    for name in _chosen(page):
        label = page.find("label", name)
        page.click(label)
    page.submit()


def _click_sequence(page: ShownPage) -> None:
    page.click(page.find("button", "ONE"))
    page.click(page.find("button", "TWO"))


def _click_one(page: ShownPage) -> None:
    page.click(page.find("button", "ONE"))


def _click_tab(page: ShownPage) -> None:
    match = re.search(r"Tab #\d", page.query)
    page.click(page.find("a", match[0] if match else ""))


def _focus(page: ShownPage) -> None:
    fields = page.nodes("input", type="text")
    match = re.search(r"\d(?:st|nd|rd)", page.query)
    page.click(fields[_NUMBERS[match[0]] if match else 0])


def _enter_text(page: ShownPage) -> None:
    (text,) = page.quoted()
    page.fill(page.find("input", id="tt"), text)
    page.submit()


def _enter_password(page: ShownPage) -> None:
    (text,) = page.quoted()
    for field in page.nodes("input", type="password"):
        page.fill(field, text)
    page.submit()


def _log_in(page: ShownPage) -> None:
    user, password = page.quoted()
    page.fill(page.find("input", id="username"), user)
    page.fill(page.find("input", id="password"), password)
    page.submit("Login")


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


def _calculate(page: ShownPage) -> None:
    first, sign, second = page.find(id="math-problem").name.split()[:3]
    a, b = int(first), int(second)
    answer = {"+": a + b, "-": a - b, "x": a * b}[sign]
    page.fill(page.find("input", id="math-answer"), str(answer))
    page.submit()


def _change_case(page: ShownPage) -> None:
    (text,) = page.quoted()
    text = text.upper() if "upper case" in page.query else text.lower()
    page.fill(page.find("input", id="tt"), text)
    page.submit()


def _read_table(page: ShownPage) -> None:
    match = re.search(r"value of (.*) into", page.query)
    cells = [" ".join(cell.name.split()) for cell in page.nodes("td")]
    values = dict(zip(cells[::2], cells[1::2], strict=True))
    page.fill(page.find("input", id="tt"), values[match[1].strip() if match else ""])
    page.submit()


def _find_word(page: ShownPage) -> None:
    match = re.search(r"the (\d+)\w\w word", page.query)
    words = page.find("p").name.split()
    word = words[int(match[1]) - 1 if match else 0].strip(".,")
    page.fill(page.find("input", id="answer-input"), word)
    page.submit()


def _solve_for_x(page: ShownPage) -> None:
    first, sign, second, _, result = page.find(id="math-problem").name.split()
    if first == "x":
        answer = int(result) - int(second) if sign == "+" else int(result) + int(second)
    else:
        answer = int(result) - int(first) if sign == "+" else int(first) - int(result)
    page.fill(page.find("input", id="math-answer"), str(answer))
    page.submit()


def _choose_from_list(page: ShownPage) -> None:
    match = re.search(r"Select (.*) from the list", page.query)
    page.click(page.find("select"))
    page.press("esc")  # the list itself is no part of the page's picture
    for character in match[1] if match else "":
        page.press("space" if character == " " else character)
    page.submit()


# By the name of the page, without `.html`.
ORACLES: Mapping[str, Callable[[ShownPage], None]] = MappingProxyType(
    {
        "choose-list": _choose_from_list,
        "click-button": _click_quoted,
        "click-button-sequence": _click_sequence,
        "click-checkboxes": _select,
        "click-checkboxes-large": _select,
        "click-checkboxes-transfer": _select,
        "click-collapsible": _expand,
        "click-collapsible-nodelay": _expand,
        "click-dialog": _close_dialog,
        "click-dialog-2": _answer_dialog,
        "click-link": _click_link,
        "click-option": _select,
        "click-tab": _click_tab,
        "click-test": _click_test,
        "click-test-2": _click_one,
        "click-test-transfer": _click_test,
        "click-widget": _click_widget,
        "enter-password": _enter_password,
        "enter-text": _enter_text,
        "enter-text-2": _change_case,
        "enter-text-dynamic": _enter_text,
        "find-word": _find_word,
        "focus-text": _focus,
        "focus-text-2": _focus,
        "login-user": _log_in,
        "read-table": _read_table,
        "simple-algebra": _solve_for_x,
        "simple-arithmetic": _calculate,
    }
)
