"""Articles of wiki.test as they are stored."""

from collections.abc import Mapping, Sequence
from typing import Any

from ...embedded.sites.library import articles, render
from ..hand import Hand
from ..machine import Machine
from .pages import visit, wait_for_page

SITE = "http://wiki.test"


def address(title: str, site: str = "wiki") -> str:
    """Return the address of an article, or of its `edit` or `history` page."""
    return f"{SITE}/{site}/{title.replace(' ', '_')}"


def original_text(title: str) -> str:
    """Return the text that an article has in the beginning."""
    return articles("wiki")[title.replace(" ", "_")].body


def pages(machine: Machine) -> dict[str, Any]:
    """Return the articles that were edited, by title."""
    return machine.sites.read("wiki").get("pages", {})


def text(machine: Machine, title: str) -> str:
    """Return the text of an article now; "" if it was never edited."""
    return pages(machine).get(title, {}).get("text", "")


def comment(machine: Machine, title: str) -> str:
    """Return what the latest edit of an article says that it changed; "" if there is none."""
    revisions = pages(machine).get(title, {}).get("revisions", [])
    return revisions[-1]["summary"] if revisions else ""


def store_article(
    machine: Machine,
    title: str,
    body: str,
    revisions: Sequence[Mapping[str, Any]] = ({"summary": ""},),
) -> None:
    """Store an article with its revisions, oldest first; numbers and sizes are filled in."""
    stored_revisions = [
        {"number": number, "size": len(body), **revision}
        for number, revision in enumerate(revisions, 1)
    ]
    with machine.sites.update("wiki") as state:
        state.setdefault("pages", {})[title] = {"text": body, "revisions": stored_revisions}


def unexpected_article_changes(machine: Machine, *titles: str) -> list[str]:
    """Return the titles of other articles that were edited, added or removed."""
    before = machine.before.sites.get("wiki", {}).get("pages", {})
    after = pages(machine)
    titles_changed = {title for title in {*before, *after} if before.get(title) != after.get(title)}
    return sorted(titles_changed - set(titles))


def open_history(hand: Hand, title: str) -> None:
    """Open an article, and its history by the tab above it."""
    visit(hand, address(title), title)
    hand.find("link", "History")
    links = [node for node in hand.look() if node.name == "History" and node.box]
    tab = max(links, key=lambda node: node.centre)  # an article may have a heading of that name
    hand.click(tab)
    wait_for_page(hand, "History of")


def same(first: str, second: str) -> bool:
    """Return whether two texts are shown as the same page."""
    return render(first).html.split() == render(second).html.split()
