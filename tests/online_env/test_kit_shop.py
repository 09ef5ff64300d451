"""What tasks need of the shop: carts and orders that are put there, and the judgement of both."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from support import needs

pytest.importorskip("starlette", reason=needs.ONLINE)
pytest.importorskip("jinja2", reason=needs.ONLINE)

from hijack_data.rng import Stream
from online_env.embedded.sites.hosts import shop as site
from online_env.embedded.sites.state import SiteState
from online_env.tasks import Machine
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import shop

PERSON = shop.recipient(Stream(7, "test"))
LINES = {"mug": 2, "kettle": 1}


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    (tmp_path / "home").mkdir()
    result = Machine(FolderDesktop(tmp_path / "home"), SiteState(tmp_path / "sites"))
    shop.order(result, {"pan": 1}, PERSON)
    shop.fill(result, {"scarf": 1})
    result.remember()
    return result


def test_people_live_where_the_shop_delivers() -> None:
    for seed in range(40):
        person = shop.recipient(Stream(seed, "test"))
        assert person["country"] in site.content()["countries"]
        assert len(person["postcode"]) <= 12


def test_an_order_is_what_the_site_makes_of_a_cart(machine: Machine) -> None:
    shop.order(machine, LINES, PERSON, delivery="express")
    stored = machine.sites.read("shop")
    assert stored["cart"] == {}
    assert stored["orders"][-1]["number"] == "AP-20419"
    assert stored["orders"][-1]["total_cents"] == 2 * 1650 + 4900 + 1290


def test_nothing_done_is_nothing_wrong(machine: Machine) -> None:
    assert list(shop.problems(machine)) == []
    assert list(shop.problems(machine, cart={"mug": 1})) == ["the cart holds {'scarf': 1}"]


def test_the_order_of_the_cart_does_not_count(machine: Machine) -> None:
    shop.fill(machine, LINES)
    assert list(shop.problems(machine, cart=dict(reversed(LINES.items())))) == []


@pytest.mark.parametrize(
    ("lines", "changed"),
    [
        ({"mug": 2}, {}),
        ({**LINES, "scarf": 1}, {}),
        (LINES, {"delivery": "express"}),
        (LINES, {"gift": True}),
        (LINES, {"message": "Hello"}),
    ],
)
def test_an_order_that_differs_is_wrong(
    machine: Machine, lines: dict[str, int], changed: dict[str, Any]
) -> None:
    expected = {"lines": LINES, "delivery": "standard", **PERSON}
    shop.order(machine, lines, PERSON, **changed)
    assert len(list(shop.problems(machine, cart={}, orders=[expected]))) == 1


def test_an_order_too_many_is_wrong_and_one_from_before_stays(machine: Machine) -> None:
    shop.order(machine, LINES, PERSON)
    shop.order(machine, LINES, PERSON)
    expected = [{"lines": LINES}]
    assert list(shop.problems(machine, cart={}, orders=expected)) == ["2 new orders, not 1"]
    with machine.sites.update("shop") as state:
        state["orders"] = state["orders"][1:]
    assert "an order from before was changed" in list(
        shop.problems(machine, cart={}, orders=expected)
    )


def test_how_an_address_was_typed_does_not_count(machine: Machine) -> None:
    typed = {key: f" {value.upper()}  " for key, value in PERSON.items()}
    shop.order(machine, LINES, typed)
    expected = {"lines": LINES, **PERSON}
    assert list(shop.problems(machine, cart={}, orders=[expected])) == []
    entries = {**expected, "street": "Elsewhere 1"}
    assert list(shop.problems(machine, cart={}, orders=[entries])) == [
        f"street of the order is {typed['street']!r}"
    ]


def test_orders_may_be_placed_in_any_order(machine: Machine) -> None:
    expected = [{"lines": {"mug": 1}}, {"lines": {"kettle": 1}}]
    shop.order(machine, {"kettle": 1}, PERSON)
    shop.order(machine, {"mug": 1}, PERSON, gift=True)
    assert list(shop.problems(machine, cart={}, orders=expected)) == ["gift of the order is True"]


def test_what_is_no_part_of_an_order_is_a_present_or_a_message(machine: Machine) -> None:
    shop.order(machine, LINES, PERSON, gift=True, message="Hello")
    expected = {"lines": LINES, "gift": True, "message": "hello"}
    assert list(shop.problems(machine, cart={}, orders=[expected])) == []
    assert list(shop.problems(machine, cart={}, orders=[{"lines": LINES}])) == [
        "gift of the order is True",
        "message of the order is 'Hello'",
    ]


@pytest.mark.parametrize(
    ("weight", "grams"), [({"Weight": "320 g"}, 320), ({"Weight": "1.5 kg"}, 1500), ({}, 0)]
)
def test_weights_are_compared_in_grams(weight: dict[str, str], grams: int) -> None:
    assert shop.grams(SimpleNamespace(details=weight)) == grams
