"""The search page, its index and the Markdown of the articles."""

import re
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from online_env.embedded.sites.index import Document, find, words
from online_env.embedded.sites.library import plain, render


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("lighthouse", "http://wiki.test/wiki/Lighthouse"),
        ("harbour bridge opens", "http://news.test/article/harbour-bridge-opens"),
        ("chef's knife", "http://shop.test/product/knife"),
        ("retention rules", "http://docs.test/retention-rules"),
        ("honey bees", "http://wiki.test/wiki/Honey_bee"),
        ("course registration", "http://forms.test/register"),
    ],
)
def test_search_finds_the_page_that_is_meant(web: Any, text: str, first: str) -> None:
    text = web.get(f"http://search.test/search?q={text}").text
    assert re.search(r'<h2><a href="([^"]+)"', text)[1] == first  # type: ignore[index]


@pytest.mark.parametrize(
    "words",
    ["<script>alert(1)</script>", '"><img src=x>', "{{7*7}}", "%", "a" * 5000, "\u202e", "zzzz"],
)
def test_search_repeats_any_words_harmlessly(
    web: Any, words: str, parse: Callable[[str], Any]
) -> None:
    reply = (
        web.ask("GET", "http://search.test/search", params={"q": words})
        if len(words) < 300
        else web.get(f"http://search.test/search?q={words}")
    )
    assert reply.status_code == 200
    assert parse(reply.text).problems == []
    assert "<script>" not in reply.text
    assert "49" not in reply.text


@pytest.mark.parametrize("page", ["0", "-1", "2", "999", "x", "²", "99999999999999999999"])
def test_any_page_number_shows_a_page_of_results(web: Any, page: str) -> None:
    assert '<h2><a href="' in web.get(f"http://search.test/search?q=the&page={page}").text


@given(st.text(max_size=60))
def test_what_is_found_holds_a_word_that_was_asked(text: str) -> None:
    documents = [
        Document("a.test", "/", "Red apple", "An apple a day", "x"),
        Document("a.test", "/b", "Pears", "green & sweet", "x"),
    ]
    for hit in find(text, documents):
        assert set(words(text)) & set(hit.document.weights)
    assert [h.document.path for h in find("apples", documents)] == ["/"]
    assert find("cherry", documents) == []


def test_plain_text_and_markdown() -> None:
    assert plain("## A *b* `c`\n\n- [d](/e) **f**\n\n| g | h |\n|---|---|\n") == "A b c d f g h"
    result = render("## Two words\n\n<b>x</b>\n\n## Two")
    assert result.headings == (("two-words", "Two words"), ("two", "Two"))
    assert '<h2 id="two-words">' in result.html
    assert "<b>" not in result.html
