"""Names and pages of the local internet, and how they are found: DNS, hosts and the search."""

import math
import re
import struct
from collections import Counter
from ipaddress import IPv4Address

import pytest

from support import needs

pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.embedded.sites.dns import answer
from online_env.embedded.sites.hosts import search
from online_env.embedded.sites.hosts_and_dates import host_name
from online_env.embedded.sites.index import MAX_WORDS, Document, find
from online_env.embedded.sites.pages import clean, money

from support.sites import local_web

OURS = IPv4Address("10.77.0.1")


@pytest.fixture(scope="module")
def web(tmp_path_factory):
    with local_web(tmp_path_factory.mktemp("sites")) as result:
        yield result


# The search


def hits(web, **query):
    """The addresses of the results on a page."""
    return re.findall(r'<h2><a href="([^"]+)"', web.get("search.test/search", **query).text)


def test_the_pages_of_results_together_have_each_result_once(web):
    first = web.text("search.test/search", q="the")
    total, pages = map(int, re.search(r"(\d+) results, page 1 of (\d+)", first).groups())
    assert pages == math.ceil(total / search.PER_PAGE) > 2
    values = [hits(web, q="the", page=number + 1) for number in range(pages)]
    assert [len(item) for item in values[:-1]] == [search.PER_PAGE] * (pages - 1)
    items = [item for page in values for item in page]
    assert len(set(items)) == len(items) == total
    for beyond in (pages + 1, 9999):
        assert hits(web, q="the", page=beyond) == values[-1]
    for wrong in ("0", "１"):
        assert hits(web, q="the", page=wrong) == values[0]
    links = web.links("search.test/search", "/search?q=the&page=", q="the")
    assert links == [str(number + 1) for number in range(pages)]


def test_a_tab_keeps_the_results_of_its_site(web):
    everywhere = set()
    for page in range(1, 6):
        everywhere |= set(hits(web, q="water", page=page))
    for site in ("wiki.test", "shop.test"):
        result = hits(web, q="water", site=site)
        assert set(result) == {item for item in everywhere if item.startswith(f"http://{site}/")}
    assert hits(web, q="water", site="evil.test") == hits(web, q="water")
    assert "1 result " in web.text("search.test/search", q="postbox")
    assert "0 results" in web.text("search.test/search", q="xylophone")


def test_a_word_that_is_an_article_has_a_box_of_its_own(web):
    requests = {"q": "  hONEY   bee "}
    assert 'aria-label="About Honey bee"' in web.get("search.test/search", **requests).text
    for second in ({"q": "honey bees"}, {"q": "honey bee", "site": "news.test"}):
        assert "About Honey" not in web.get("search.test/search", **second).text
    assert web.text("search.test/search", q=" ") == web.text("search.test/")


def pages(*texts, title="T"):
    return [Document("a.test", f"/{n}", title, text, "x") for n, text in enumerate(texts)]


def test_pages_with_all_words_come_alone_and_else_those_with_any():
    result = pages("apple pear", "apple", "pear", "plum")
    paths = [hit.document.path for hit in find("pear apple", result)]
    assert paths == ["/0"]
    assert {hit.document.path for hit in find("apple plum", result)} == {"/0", "/1", "/3"}
    assert find("apple", result)[0].document.path == "/0", "ties stay in their order"
    assert find("", result) == find("?!", result) == []


def test_rare_words_and_titles_weigh_more_as_the_formula_says():
    items = [
        Document("a.test", "/title", "Tides", "of the sea", "x"),
        Document("a.test", "/text", "Sea", "tide tide tides tide and more", "x"),
        Document("a.test", "/rare", "Other", "xylophone, xylophones", "x"),
    ]
    # Independently: the rarity of a word is log(1 + pages / pages with it), its weight in a page
    # log(1 + how often), and a title counts eight times.
    tide = math.log(1 + 3 / 2)
    scores = {"/title": tide * math.log1p(8), "/text": tide * math.log1p(4)}
    scores["/rare"] = math.log(1 + 3) * math.log1p(2)
    expected = sorted(scores, key=scores.__getitem__, reverse=True)
    assert [hit.document.path for hit in find("tide xylophone", items)] == expected
    assert [hit.document.path for hit in find("TIDES", items)] == ["/title", "/text"]
    assert find("glas", pages("glass")) == [], "only a plural ends in a single s"
    assert find("gas", pages("ga")) == [], "and has four letters"


def test_a_query_of_many_words_is_cut(monkeypatch):
    words = [f"w{number}" for number in range(MAX_WORDS + 1)]
    result = pages(" ".join(words[:-1]), words[-1])
    assert [hit.document.path for hit in find(" ".join(words), result)] == ["/0"]
    assert find(" ".join([*words[:1] * 50, words[-1]]), result) != [], "each word counts once"


def test_a_snippet_begins_a_little_before_the_first_match():
    words = [f"n{number}" for number in range(100)]
    words[20] = "Bees,"
    (hit,) = find("bee", pages(" ".join(words)))
    assert hit.snippet[0] == ("... ", False)
    assert hit.snippet[1] == ("n14 ", False)
    assert [text for text, matches in hit.snippet if matches] == ["Bees, "]
    assert len(hit.snippet) == 1 + 34 + 1
    assert hit.snippet[-1] == ("...", False)
    (short,) = find("bee", pages("a bee"))
    assert short.snippet == (("a ", False), ("bee ", True))
    (title,) = find("t", pages("nothing of it"))
    assert title.snippet[0] == ("nothing ", False)


# Hosts, and what is written


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/generate_204", 204),
        ("/static/base.css", 200),
        ("/static/none.css", 404),
        ("/staticbase.css", 404),
    ],
)
def test_what_every_site_serves(web, path, status):
    for host in ("shop.test", "wiki.test:80", "NEWS.test."):
        answer = web.ask("GET", f"{host}{path}")
        assert answer.status_code == status, host
        assert answer.headers["cache-control"] == "no-store"
        assert not {"etag", "last-modified"} & set(answer.headers)
    posted = web.ask("POST", "shop.test/static/base.css", data={"a": "b"})
    assert posted.status_code == 404
    assert web.ask("GET", "10.77.0.1/").status_code == 421


@pytest.mark.parametrize(
    ("header", "host"),
    [
        ("Shop.Test:80", "shop.test"),
        ("shop.test.", "shop.test"),
        ("shop.test.:80", "shop.test"),
        ("[::1]:80", "[::1]:80"),
        ("", ""),
        (":80", ""),
    ],
)
def test_a_host_is_a_name_without_port_and_final_dot(header, host):
    assert host_name(header) == host


def test_text_is_stored_without_what_nobody_typed():
    assert clean(" a\r\nb\rc\x00\x1b\x7f\x85\ud800\td\u200b ") == "a\nb\nc\td\u200b"
    assert len(clean("x" * 30_000)) == 20_000
    assert [money(cents) for cents in (0, 5, 123456, 100000000)] == [
        "$0.00",
        "$0.05",
        "$1,234.56",
        "$1,000,000.00",
    ]


# DNS


def question(name="shop.test", kind=1, family=1, *, flags=0x0100, count=1):
    labels = b"".join(bytes([len(part)]) + part.encode() for part in name.split("."))
    head = struct.pack("!6H", 77, flags, count, 0, 0, 0)
    return head + labels + b"\0" + struct.pack("!2H", kind, family)


RECORD = b"\xc0\x0c" + struct.pack("!2HIH", 1, 1, 5, 4) + OURS.packed


@pytest.mark.parametrize(
    ("packet", "flags", "counts", "record"),
    [
        (question(), 0x8580, (1, 1), RECORD),
        (question(kind=255), 0x8580, (1, 1), RECORD),
        (question(family=255), 0x8580, (1, 1), RECORD),
        (question(flags=0), 0x8480, (1, 1), RECORD),  # recursion was not asked for
        (question(flags=0x0310), 0x8580, (1, 1), RECORD),  # other bits are not repeated
        (question(family=3), 0x8580, (1, 0), b""),
        (question(kind=28), 0x8580, (1, 0), b""),
        (question("x.shop.test"), 0x8583, (1, 0), b""),
    ],
)
def test_a_question_gets_its_answer(packet, flags, counts, record):
    head = struct.pack("!6H", 77, flags, *counts, 0, 0)
    assert answer(packet, {"shop.test"}, OURS) == head + packet[12:] + record


@pytest.mark.parametrize(
    ("packet", "flags"),
    [
        (question(flags=0x1000), 0x9484),  # STATUS: not implemented
        (question(flags=0x2900), 0xAD84),  # UPDATE
        (question(count=0), 0x8581),
        (question(count=2), 0x8581),
        (question()[:-1], 0x8581),
        (question("a" * 64), 0x8581),
    ],
)
def test_what_is_no_question_gets_an_error_and_nothing_else(packet, flags):
    assert answer(packet, {"shop.test"}, OURS) == struct.pack("!6H", 77, flags, 0, 0, 0, 0)


def test_the_longest_name_is_a_name_and_a_longer_one_is_none():
    longest = ".".join(["a" * 63] * 3 + ["b" * 61])
    assert len(longest) == 253
    assert Counter(answer(question(longest), {longest}, OURS))[10] >= 1
    assert answer(question(longest), {longest}, OURS).endswith(OURS.packed)
    assert answer(question(f"{longest}b"), {f"{longest}b"}, OURS)[3] & 15 == 1
