"""Articles of the wiki as they are stored, and pages of the local sites."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.rng import Stream
from online_env.embedded.sites.state import SiteState
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import articles, sample_links
from online_env.tasks.machine import Machine


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(FolderDesktop(tmp_path), SiteState(tmp_path / "sites"))


def test_an_article_is_stored_as_the_site_does(machine: Machine) -> None:
    articles.store_article(
        machine, "Gull Rock", "One.", [{"summary": "a"}, {"summary": "b", "by": "Ada"}]
    )
    assert articles.text(machine, "Gull Rock") == "One."
    assert (articles.comment(machine, "Gull Rock"), articles.comment(machine, "Tea")) == ("b", "")
    assert articles.pages(machine)["Gull Rock"]["revisions"] == [
        {"number": 1, "size": 4, "summary": "a"},
        {"number": 2, "size": 4, "summary": "b", "by": "Ada"},
    ]


def test_other_articles_that_changed_are_named(machine: Machine) -> None:
    articles.store_article(machine, "Tea", "One.")
    articles.store_article(machine, "Tide", "One.")
    machine.remember()
    articles.store_article(machine, "Tea", "Two.")
    articles.store_article(machine, "Gull Rock", "New.")
    assert articles.unexpected_article_changes(machine, "Tea") == ["Gull Rock"]
    assert articles.unexpected_article_changes(machine) == ["Gull Rock", "Tea"]


def test_texts_are_the_same_if_their_pages_are() -> None:
    assert articles.same("a b\n\n## c\n\nd", " a\nb\n## c\nd \n\n")
    assert not articles.same("a b", "ab")
    assert not articles.same("a\n\nb", "a\nb")
    assert not articles.same("a\n\n## c", "a ## c")


def test_addresses_and_texts_of_articles() -> None:
    assert articles.address("Coral reef", "edit") == "http://wiki.test/edit/Coral_reef"
    assert articles.original_text("Coral reef").startswith("A **coral reef** is")


@given(st.integers(0, 2**64 - 1))
def test_a_bookmarks_bar_has_every_site_and_no_page_twice(seed: int) -> None:
    entries = sample_links.bar(Stream(seed, "test"))
    urls = [url for _, pages in entries for _, url in pages]
    assert len(set(urls)) == len(urls) == 3 * sample_links.PER_FOLDER
    for host in sample_links.HOSTS:
        remaining_urls = [
            url for _, pages in sample_links.without(entries, host) for _, url in pages
        ]
        assert 0 < len(remaining_urls) < len(urls)
        assert not any(f"//{host}/" in url for url in remaining_urls)
