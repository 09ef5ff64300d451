"""Every page of every site: links, HTML, labels, and that all are the same on every run."""

import re
from collections import Counter
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from online_env.embedded.sites import HOSTS


def html(replies: dict[str, Any]) -> dict[str, str]:
    return {
        u: r.text
        for u, r in replies.items()
        if r.headers.get("content-type", "").startswith("text/html")
    }


def test_every_link_resolves_within_our_sites(everything: dict[str, Any]) -> None:
    outside = [url for url in everything if urlsplit(url).hostname not in HOSTS]
    broken = {
        url: reply.status_code for url, reply in everything.items() if reply.status_code != 200
    }
    assert outside == []
    assert broken == {}
    per_site = Counter(urlsplit(url).hostname for url in html(everything))
    least = {
        "search.test": 4,
        "shop.test": 24,
        "docs.test": 19,
        "mail.test": 19,
        "forms.test": 8,
        "wiki.test": 44,
        "news.test": 16,
    }
    assert {host: n for host, n in least.items() if per_site[host] < n} == {}


def test_pages_are_sound_html_and_every_control_has_a_label(
    everything: dict[str, Any], parse: Callable[[str], Any]
) -> None:
    for url, text in html(everything).items():
        page = parse(text)
        assert page.problems == [], url
        assert page.unlabelled() == [], url
        assert text.lower().startswith("<!doctype html>")
        assert '<html lang="en">' in text
        assert page.seen["h1"] == 1, url
        assert page.seen["main"] == 1, url
        assert re.search(r"<title>[^<\s][^<]+</title>", text), url


def test_every_anchor_exists(everything: dict[str, Any], parse: Callable[[str], Any]) -> None:
    for url, text in html(everything).items():
        page = parse(text)
        assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids), url


def test_pages_ask_for_nothing_from_outside_and_hold_no_emoji(everything: dict[str, Any]) -> None:
    emoji = re.compile("[\U0001f000-\U0001faff\u2600-\u27bf\ufe0f]")
    for url, reply in everything.items():
        assert not emoji.search(reply.text), url
        hosts = {urlsplit(u).hostname for u in re.findall(r"https?://[\w.:/-]+", reply.text)}
        # w3.org names the SVG namespace, nothing is fetched from it
        assert hosts <= {*HOSTS, "www.w3.org"}, url


def test_pages_and_headers_are_the_same_on_every_server(
    everything: dict[str, Any], web: Any
) -> None:
    for url in (
        "http://search.test/search?q=sourdough",
        "http://news.test/",
        "http://docs.test/faq",
        "http://wiki.test/wiki/Tea",
    ):
        again = web.get(url)
        assert again.content == everything[url].content
        assert again.headers == everything[url].headers
        assert "date" not in again.headers


def test_every_page_forbids_the_cache_and_foreign_content(everything: dict[str, Any]) -> None:
    for url, reply in everything.items():
        assert reply.headers["cache-control"] == "no-store", url
        assert "default-src 'self'" in reply.headers["content-security-policy"], url
        assert reply.headers["x-content-type-options"] == "nosniff", url
