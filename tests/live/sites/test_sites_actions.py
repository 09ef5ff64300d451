"""What can be done on the sites, and what is stored of it."""

import re
import threading
from collections.abc import Callable
from typing import Any

import pytest

from online_env.embedded.sites.state import MAX_BYTES


def test_a_registration_is_stored_and_confirmed(fresh: Any, registration: dict[str, Any]) -> None:
    reply = fresh.post("http://forms.test/register", **registration)
    assert (reply.status_code, reply.headers["location"]) == (303, "/registrations/1001")
    stored = {**registration, "interests": ["carpool", "volunteer"], "number": 1001}
    del stored["agree"]
    assert fresh.state.read("forms") == {"registrations": [stored]}
    text = fresh.get("http://forms.test/registrations/1001").text
    assert "Zoë O&#39;Neill" in text
    assert "Ω &lt; ω" in text
    assert fresh.get("http://forms.test/registrations/1002").status_code == 404


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("name", ""),
        ("name", "x" * 101),
        ("email", "zoe"),
        ("email", "a@b@c.d"),
        ("birth_date", "17.5.1990"),
        ("birth_date", "2090-01-01"),
        ("birth_date", "1990-02-30"),
        ("country", "Atlantis"),
        ("course", ""),
        ("level", "expert"),
        ("interests", "spam"),
        ("notes", "x" * 1001),
        ("agree", ""),
    ],
)
def test_a_wrong_field_is_named_and_nothing_is_stored(
    web: Any, field: str, value: str, parse: Callable[[str], Any], registration: dict[str, Any]
) -> None:
    reply = web.post("http://forms.test/register", **{**registration, field: value})
    assert reply.status_code == 422
    assert f'id="p-{field}"' in reply.text
    assert parse(reply.text).problems == []
    assert web.state.read("forms") == {}


def test_a_refused_form_keeps_what_was_entered(web: Any, registration: dict[str, Any]) -> None:
    text = web.post("http://forms.test/register", **{**registration, "name": ""}).text
    assert 'value="zoe@mail.test"' in text
    assert re.search(r"<option selected>Norway</option>", text)
    assert re.search(r'value="some" checked', text)
    assert len(re.findall(r'name="interests" value="\w+" checked', text)) == 2


def test_concurrent_posts_are_all_stored(fresh: Any, registration: dict[str, Any]) -> None:
    def send(number: int) -> None:
        fresh.post("http://forms.test/register", **{**registration, "name": f"Person {number}"})

    threads = [threading.Thread(target=send, args=(n,)) for n in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    registrations = fresh.state.read("forms")["registrations"]
    assert {e["name"] for e in registrations} == {f"Person {n}" for n in range(16)}
    assert [e["number"] for e in registrations] == list(range(1001, 1017))


def test_a_registration_is_found_changed_and_cancelled(
    fresh: Any, registration: dict[str, Any]
) -> None:
    site = "http://forms.test"
    fresh.post(f"{site}/register", **registration)
    fresh.post(f"{site}/register", **{**registration, "name": "Other"})
    email = registration["email"]
    assert fresh.get(f"{site}/find?number=1002&email=nobody@mail.test").status_code == 422
    result = fresh.get(f"{site}/find?number=1002&email={email.upper()}")
    assert result.headers["location"] == "/registrations/1002"
    other_registration = {**registration, "name": "Other", "course": "pottery"}
    wrong = fresh.post(f"{site}/registrations/1002/change", **{**other_registration, "email": "x"})
    assert wrong.status_code == 422
    assert fresh.post(f"{site}/registrations/1002/change", **other_registration).status_code == 303
    assert "Cancel registration 1002?" in fresh.get(f"{site}/registrations/1002/cancel").text
    assert fresh.post(f"{site}/registrations/1002/cancel").status_code == 303
    assert "Registration cancelled" in fresh.get(f"{site}/registrations/1002").text
    assert fresh.post(f"{site}/registrations/1002/change", **other_registration).status_code == 409
    assert fresh.post(f"{site}/registrations/1002/cancel").status_code == 409
    assert fresh.post(f"{site}/registrations/1003/cancel").status_code == 404
    first, second = fresh.state.read("forms")["registrations"]
    assert (first["course"], "cancelled" in first) == (registration["course"], False)
    assert (second["course"], second["number"], second["cancelled"]) == ("pottery", 1002, True)


def test_feedback_is_stored_once_it_is_complete(fresh: Any) -> None:
    output = {"course": "chess", "rating": "good", "comment": "Ω fine", "quote": "yes"}
    refused = fresh.post("http://forms.test/feedback", **{**output, "rating": ""})
    assert (refused.status_code, "Ω fine" in refused.text) == (422, True)
    assert fresh.post("http://forms.test/feedback", **output).headers["location"] == "/thanks"
    fresh.post("http://forms.test/feedback", course="chess", rating="poor")
    assert fresh.state.read("forms")["feedback"] == [
        {**output, "quote": True},
        {"course": "chess", "rating": "poor", "comment": "", "quote": False},
    ]


def test_the_history_of_an_article_names_who_and_when(fresh: Any) -> None:
    edit = {"number": 1, "summary": "Units", "size": 4, "by": "Ada Novak", "when": "7 March 2026"}
    with fresh.state.update("wiki") as state:
        state["pages"] = {"Tea": {"text": "One.", "revisions": [edit]}}
    fresh.post("http://wiki.test/edit/Tea", text="Two.", summary="More")
    text = fresh.get("http://wiki.test/history/Tea").text
    assert "by Ada Novak, 7 March 2026, 4 characters" in text
    assert "by Robin Hale, 4 characters" in text


def test_control_characters_are_not_stored(fresh: Any, registration: dict[str, Any]) -> None:
    fresh.post(
        "http://forms.test/register",
        **{**registration, "name": " A\0B\x1b[31m ", "notes": "one\r\ntwo"},
    )
    entry = fresh.state.read("forms")["registrations"][0]
    assert (entry["name"], entry["notes"]) == ("AB[31m", "one\ntwo")


def test_from_the_shelf_to_the_order(fresh: Any) -> None:
    shop = "http://shop.test"
    assert fresh.post(f"{shop}/cart/add", product="mug", quantity="2").status_code == 303
    fresh.post(f"{shop}/cart/add", product="mug", quantity="1")
    fresh.post(f"{shop}/cart/add", product="knife", quantity="8")  # six in stock
    fresh.post(f"{shop}/cart/add", product="lamp", quantity="1")
    fresh.post(f"{shop}/cart/update", product="lamp", quantity="0")
    assert fresh.state.read("shop")["cart"] == {"mug": 3, "knife": 6}
    address = {
        "name": "Robin Hale",
        "email": "robin@mail.test",
        "street": "Quay Row 3",
        "postcode": "1234",
        "city": "Port Alder",
        "country": "Norway",
        "delivery": "express",
        "payment": "invoice",
        "message": "",
        "gift": "yes",
    }
    wrong = fresh.post(f"{shop}/checkout", **{**address, "city": ""})
    assert (wrong.status_code, "Enter the town." in wrong.text) == (422, True)
    assert fresh.post(f"{shop}/checkout", **address).headers["location"] == "/order/AP-20418"
    state = fresh.state.read("shop")
    assert state["cart"] == {}
    assert state["orders"][0]["lines"] == [
        {"product": "mug", "quantity": 3, "cents": 4950},
        {"product": "knife", "quantity": 6, "cents": 53400},
    ]
    assert state["orders"][0]["total_cents"] == 4950 + 53400 + 1290
    assert state["orders"][0]["gift"] is True
    assert "$596.40" in fresh.get(f"{shop}/order/AP-20418").text
    assert fresh.post(f"{shop}/checkout", **address).headers["location"] == "/cart"


@pytest.mark.parametrize(
    ("product", "quantity"),
    [("gold", "1"), ("mug", "-1"), ("mug", "1e9"), ("mug", "9999"), ("mug", "²")],
)
def test_the_cart_refuses_what_is_no_product_or_number(
    web: Any, product: str, quantity: str
) -> None:
    assert (
        web.post("http://shop.test/cart/add", product=product, quantity=quantity).status_code == 400
    )
    assert web.state.read("shop") == {}


def test_products_are_sorted(web: Any) -> None:
    text = web.get("http://shop.test/category/all?sort=price").text
    prices = [float(p.replace(",", "")) for p in re.findall(r'class="price">\$([\d,.]+)', text)]
    assert len(prices) == 18
    assert prices == sorted(prices)


def test_mail_is_read_sent_and_kept_as_a_draft(fresh: Any) -> None:
    mail = "http://mail.test"
    assert "Inbox (4)" in fresh.get(f"{mail}/").text
    assert "soup on Thursdays" in fresh.get(f"{mail}/message/m01").text
    assert "Inbox (3)" in fresh.get(f"{mail}/").text
    fresh.post(f"{mail}/message/m02/archive", back="inbox")
    assert "AP-20417" not in fresh.get(f"{mail}/").text
    assert "AP-20417" in fresh.get(f"{mail}/folder/archive").text
    reply = fresh.get(f"{mail}/compose?reply=m03").text
    assert 'value="Re: Planets on Saturday"' in reply
    refused = fresh.post(f"{mail}/send", action="send", to="nobody", subject="Hi", body="there")
    assert (refused.status_code, "nobody is no e-mail address." in refused.text) == (422, True)
    fresh.post(f"{mail}/send", action="draft", to="", subject="Later", body="a\nb")
    draft = fresh.state.read("mail")["drafts"][0]
    assert "Later" in fresh.get(f"{mail}/compose?draft={draft['id']}").text
    fresh.post(
        f"{mail}/send",
        action="send",
        draft=draft["id"],
        to="oda@mail.test; tomas@mail.test",
        subject="Now",
        body="a\nb",
    )
    state = fresh.state.read("mail")
    assert state["drafts"] == []
    assert state["sent"] == [
        {
            "id": "s02",
            "to": ["oda@mail.test", "tomas@mail.test"],
            "cc": [],
            "subject": "Now",
            "body": "a\nb",
        }
    ]
    assert "Now" in fresh.get(f"{mail}/folder/sent").text
    assert fresh.get(f"{mail}/message/s02").status_code == 200
    assert fresh.post(f"{mail}/message/s02/trash", back="sent").status_code == 404


def test_mails_that_were_put_there_are_read_moved_and_forwarded(fresh: Any) -> None:
    mail = "http://mail.test"
    fields = {"name": "Ada", "address": "ada@mail.test"}
    new = {
        "id": "x1",
        "from": fields,
        "subject": "Rope",
        "body": "12 m",
        "date": "2026-03-02T08:00",
    }
    with fresh.state.update("mail") as state:
        state["received"] = [new]
    assert "Inbox (5)" in fresh.get(f"{mail}/").text
    form = fresh.get(f"{mail}/compose?forward=x1").text
    assert 'value="Fwd: Rope"' in form
    assert "From: Ada &lt;ada@mail.test&gt;" in form
    assert "12 m" in form
    fresh.post(f"{mail}/message/x1/archive", back="inbox")
    assert "Rope" in fresh.get(f"{mail}/folder/archive").text
    assert fresh.post(f"{mail}/message/x2/archive", back="inbox").status_code == 404


def test_wiki_articles_are_edited_and_made(fresh: Any) -> None:
    wiki = "http://wiki.test"
    assert (
        fresh.post(
            f"{wiki}/edit/Tea", text="**Tea** is <script>alert(1)</script> hot.", summary="short"
        ).status_code
        == 303
    )
    text = fresh.get(f"{wiki}/wiki/Tea").text
    assert "<strong>Tea</strong> is &lt;script&gt;" in text
    assert fresh.state.read("wiki")["pages"]["Tea"]["revisions"] == [
        {"number": 1, "size": 41, "summary": "short"}
    ]
    assert "short" in fresh.get(f"{wiki}/history/Tea").text
    assert fresh.get(f"{wiki}/wiki/Café_crème").status_code == 404
    fresh.post(
        f"{wiki}/edit/Café_crème",
        text="See [tea](/wiki/Tea), [bad](javascript:alert(1)).",
        summary="",
    )
    page = fresh.get(f"{wiki}/wiki/Café_crème").text
    assert '<a href="/wiki/Tea">tea</a>' in page
    assert 'href="javascript' not in page
    assert (
        fresh.ask("GET", f"{wiki}/search?q=café crème").headers["location"]
        == "/wiki/Caf%C3%A9_cr%C3%A8me"
    )
    assert fresh.post(f"{wiki}/edit/Tea", text="  ", summary="").status_code == 422


@pytest.mark.parametrize("title", ["a%2Fb", "%3Cb%3E", "x" * 81, "%00", "%20"])
def test_wiki_refuses_what_is_no_title(web: Any, title: str) -> None:
    assert web.get(f"http://wiki.test/edit/{title}").status_code == 404


def test_a_full_site_refuses_more_and_keeps_what_it_has(fresh: Any) -> None:
    with fresh.state.update("wiki") as state:
        state["pages"] = {"Big": {"text": "x" * (MAX_BYTES - 5000), "revisions": []}}
    before = fresh.state.path("wiki").read_bytes()
    assert fresh.post("http://wiki.test/edit/Tea", text="y" * 10_000, summary="").status_code == 507
    assert fresh.state.path("wiki").read_bytes() == before
