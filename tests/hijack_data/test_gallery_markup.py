"""Templates and JSON of the gallery page: text stays text, data stays data."""

import json
import re
from html.parser import HTMLParser
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.gallery.markup import Html, fill, pretty, script_json


class Counter(HTMLParser):
    """Counts the elements of some markup."""

    def __init__(self, markup: str) -> None:
        super().__init__()
        self.count = 0
        self.feed(markup)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count += 1


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=40,
)


@given(JSON)
@settings(max_examples=60, deadline=None)
def test_json_on_the_page_parses_back(data: Any) -> None:
    assert json.loads(pretty(data)) == data
    safe = script_json(data)
    assert json.loads(safe) == data
    assert not set("<>&") & set(safe)


def test_pretty_json_keeps_short_things_on_a_line_and_packs_points() -> None:
    data = {"at": [[i, i + 1000] for i in range(40)], "name": "x"}
    lines = pretty(data).splitlines()
    assert 8 < len(lines) < 16
    assert max(map(len, lines)) <= 80
    assert json.loads(pretty({"lone": "\udc80"}).encode("utf-8")) == {"lone": "\udc80"}


@given(st.text())
@settings(max_examples=60, deadline=None)
def test_filled_text_comes_back_as_text(text: str) -> None:
    page = fill("message.html", title="t", message=text, number=text)
    assert Counter(page).count == 5
    assert len(re.findall("<", page)) == 10
    assert fill("message.html", title=Html("<b>"), message="", number="").count("<b>") == 1
