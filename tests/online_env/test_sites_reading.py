"""Mail, the encyclopedia, the newspaper and the manual, as one who reads and writes there."""

import pytest

from support import needs

pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.embedded.sites.hosts import mail
from online_env.embedded.sites.library import articles, render

from support.sites import local_web


@pytest.fixture(scope="module")
def serving(tmp_path_factory):
    with local_web(tmp_path_factory.mktemp("sites")) as web:
        yield web


@pytest.fixture
def web(serving):
    """The sites with nothing done on them."""
    for path in serving.state.folder.glob("*.json"):
        path.unlink()
    return serving


def write_mails(web, *mails):
    """Put mails into the inbox, as the setup of a task does."""
    common = {"from": {"name": "Ada", "address": "ada@mail.test"}, "subject": "Rope", "body": "-"}
    with web.state.update("mail") as state:
        state["received"] = [common | item for item in mails]


def mail_links(web, url, **query):
    return web.links(f"mail.test/{url}", "/message/", **query)


# Mail


@pytest.mark.parametrize(
    ("date", "short", "long"),
    [
        ("2026-01-31T08:00", "31 Jan", "31 January 2026, 08:00"),
        ("2025-12-01T23:59", "1 Dec", "1 December 2025, 23:59"),
        ("2026-03-03T08:05", "3 Mar", "3 March 2026, 08:05"),
        ("2026-03-04T07:00", "07:00", "4 March 2026, 07:00"),
    ],
)
def test_a_mail_of_any_month_is_listed_and_read(web, date, short, long):
    write_mails(web, {"id": "x1", "date": date})
    assert f">{short}</time>" in web.get("mail.test/").text
    assert f">{long}</time>" in web.get("mail.test/message/x1").text


def test_mails_are_listed_from_the_newest_to_the_oldest(web):
    write_mails(
        web, {"id": "old", "date": "2020-01-01T00:00"}, {"id": "new", "date": "2026-03-04T23:00"}
    )
    entries = {message["id"]: message["date"] for message in mail.content()["messages"]}
    expected = sorted(entries, key=entries.__getitem__, reverse=True)
    assert mail_links(web, "folder/inbox") == ["new", *expected, "old"]


def test_stars_flags_and_folders_go_together(web):
    def act(ident, action, back="inbox"):
        return web.post(f"mail.test/message/{ident}/{action}", back=back)

    assert mail_links(web, "folder/starred") == ["m01", "m07"]
    assert act("m01", "trash").headers["location"] == "/folder/inbox"
    assert mail_links(web, "folder/starred") == ["m07"], "what was deleted is not starred any more"
    assert mail_links(web, "folder/trash") == ["m01"]
    assert act("m01", "inbox", back="message").headers["location"] == "/message/m01"
    assert mail_links(web, "folder/starred") == ["m01", "m07"]
    assert act("m07", "unstar", back="nowhere").headers["location"] == "/"
    assert act("m02", "read", back="starred").headers["location"] == "/folder/starred"
    assert "Inbox (3)" in web.get("mail.test/").text
    assert act("m05", "unread").status_code == 303
    assert "Inbox (4)" in web.get("mail.test/").text
    for ident, action in (("m01", "burn"), ("m99", "star")):
        assert act(ident, action).status_code == 404
    assert web.get("mail.test/folder/spam").status_code == 404
    assert set(web.state.read("mail")["flags"]) == {"m01", "m07", "m02", "m05"}


def test_to_open_a_mail_is_to_have_read_it(web):
    before = mail_links(web, "")
    assert "Inbox (4)" in web.get("mail.test/").text
    web.get("mail.test/message/m02")
    web.get("mail.test/message/m02")
    assert web.state.read("mail") == {"flags": {"m02": {"read": True}}}
    assert mail_links(web, "") == before


def test_mails_are_found_by_names_subjects_and_words_in_any_case(web):
    web.post("mail.test/send", action="send", to="oda@mail.test", subject="ROPE", body="12 metres")
    assert mail_links(web, "search", q="rope") == ["s01"]
    assert mail_links(web, "search", q="12 METRES") == ["s01"]
    assert mail_links(web, "search", q="tomas idle")[0] == "m03"
    assert "Nothing here." in web.text("mail.test/search", q="no such words")
    assert "Nothing here." in web.text("mail.test/search", q="  ")


def test_an_answer_quotes_and_keeps_its_subject(web):
    write_mails(
        web, {"id": "x1", "date": "2026-03-01T00:00", "subject": "Re: Rope", "body": "a\n\nb"}
    )
    page = web.get("mail.test/compose", reply="x1").text
    assert 'name="to" value="ada@mail.test"' in page
    assert 'name="subject" value="Re: Rope"' in page
    assert "\n\n\n&gt; a\n&gt; \n&gt; b</textarea>" in page
    assert web.get("mail.test/compose", reply="x2").status_code == 404
    assert (
        'name="to" value="oda@mail.test"' in web.get("mail.test/compose", to="oda@mail.test").text
    )


def test_a_draft_is_kept_once_and_goes_when_it_is_sent(web):
    def write(action, draft="", **fields):
        letter = {"to": "", "cc": "", "subject": "Rope", "body": "a", **fields}
        return web.post("mail.test/send", action=action, draft=draft, **letter)

    assert write("draft").headers["location"] == "/folder/drafts"
    assert write("draft", "s01", to="oda@mail.test; x, ").status_code == 303
    (draft,) = web.state.read("mail")["drafts"]
    assert (draft["id"], draft["to"]) == ("s02", ["oda@mail.test", "x"])
    assert 'name="to" value="oda@mail.test, x"' in web.get("mail.test/compose", draft="s02").text
    refused = write("send", "s02", to="oda@mail.test", cc="tomas@mail.test, x")
    assert refused.status_code == 422
    assert "x is no e-mail address." in refused.text
    assert 'name="draft" value="s02"' in refused.text
    assert "Please enter at least one recipient." in write("send", "s02", to=" ;, ").text
    assert write("send", "s02", to="oda@mail.test", cc="tomas@mail.test").status_code == 303
    state = web.state.read("mail")
    assert state["drafts"] == []
    assert [(item["id"], item["cc"]) for item in state["sent"]] == [("s03", ["tomas@mail.test"])]
    assert "to oda@mail.test, cc tomas@mail.test" in web.text("mail.test/message/s03")
    assert web.get("mail.test/message/s02").status_code == 404


# The encyclopedia


def test_a_title_is_one_however_it_is_written(web):
    assert "<title>Honey bee - Openfolio" in web.get("wiki.test/wiki/honey__bee").text
    web.post("wiki.test/edit/a__b%20c_", text="One.", summary="x" * 300)
    (title,) = web.state.read("wiki")["pages"]
    assert title == "A b c"
    assert len(web.state.read("wiki")["pages"][title]["revisions"][0]["summary"]) == 200
    assert web.get(f"wiki.test/wiki/{'x' * 80}").status_code == 404
    assert f"/edit/{'X' + 'x' * 79}" in web.get(f"wiki.test/wiki/{'x' * 80}").text
    missing = web.get(f"wiki.test/wiki/{'x' * 81}")
    assert (missing.status_code, "/edit/" in missing.text) == (404, False)


def test_edits_are_numbered_and_listed_from_the_last_one(web):
    for text in ("One.", "Two, longer."):
        answer = web.post("wiki.test/edit/Port_Alder_%26_sea", text=text, summary="")
        assert answer.headers["location"] == "/wiki/Port_Alder_%26_sea"
    history = web.text("wiki.test/history/Port_Alder_&_sea")
    first = "Edit 1 by Robin Hale, 4 characters No comment"
    second = "Edit 2 by Robin Hale, 12 characters No comment"
    assert history.index(second) < history.index(first)
    assert "First version" not in history
    assert "First version" in web.text("wiki.test/history/Tea")
    assert web.get("wiki.test/history/Nothing").status_code == 404
    assert "Edited by readers Port Alder & sea" in web.text("wiki.test/")
    assert "An encyclopedia with 15 articles" in web.text("wiki.test/")
    assert "Port_Alder_%26_sea" in web.links("wiki.test/all", "/wiki/")
    assert ">Two, longer.</textarea>" in web.get("wiki.test/edit/Port_Alder_%26_sea").text.replace(
        ">\nTwo", ">Two"
    )


def test_an_article_is_found_by_its_title_else_by_its_present_words(web):
    exact = web.get("wiki.test/search", q="hONEY bee")
    assert exact.headers["location"] == "/wiki/Honey_bee"
    assert '0 articles for "xylophone"' in web.text("wiki.test/search", q="xylophone")
    web.post("wiki.test/edit/Tea", text="Played on a xylophone.", summary="")
    assert '1 article for "xylophone"' in web.text("wiki.test/search", q="xylophone")
    assert web.links("wiki.test/search", "/wiki/", q="xylophone")[0] == "Tea"


def test_headings_have_anchors_and_code_can_be_reached_by_keys():
    result = render(
        "# One & two\n\n## Größe *x*\n\n### Three\n\n```\ncode\n```\n\n| a |\n|---|\n| b |\n"
    )
    assert result.headings == (("größe-x", "Größe *x*"),)
    for part in ('<h1 id="one-two">', '<h3 id="three">', '<code tabindex="0">', "<td>b</td>"):
        assert part in result.html


# The newspaper and the manual


def test_beside_an_article_are_four_others_those_of_its_section_first(web):
    result = articles("news")
    for slug, article in list(result.items())[::4]:
        matches = [item for item in result if item != slug]
        values = [
            item for item in matches if result[item].head["section"] == article.head["section"]
        ]
        other_items = [item for item in matches if item not in values]
        beside = web.get(f"news.test/article/{slug}").text.partition("Read next")[2]
        value = [item for item in matches if f"/article/{item}" in beside]
        assert set(value) == set((values + other_items)[:4]), slug


def test_a_section_has_its_articles_however_its_name_is_spelled(web):
    result = articles("news")
    local = [slug for slug, value in result.items() if value.head["section"] == "Local"]
    for name in ("local", "Local", "LOCAL"):
        assert web.links(f"news.test/section/{name}", "/article/") == local
    assert web.get("news.test/section/gossip").status_code == 404
    assert web.get("news.test/article/gossip").status_code == 404


def test_the_manual_can_be_read_from_page_to_page(web):
    order = list(articles("docs"))
    slug, read = order[0], []
    while slug:
        read.append(slug)
        page = web.get(f"docs.test/{slug}").text
        onward = page.partition('class="onward"')[2].partition("</nav>")[0]
        before = onward.partition("<span>Previous</span>")[0].rpartition('href="/')[2]
        expected = f'{read[-2]}">' if len(read) > 1 else ""
        assert before == expected if expected else "Previous" not in onward
        slug = onward.partition('class="next" href="/')[2].partition('"')[0]
    assert read == order
    assert web.get("docs.test/nothing").status_code == 404
