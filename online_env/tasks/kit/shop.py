"""shop.test: fill the cart, order, and judge what was ordered."""

import re
from collections.abc import Iterator, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, ClassVar

from hijack_data.rng import Stream

from ...embedded.sites.hosts import shop as site
from ..base import Task
from ..hand import BUTTONS, Hand
from ..machine import Machine
from . import browser
from .assignment import best_assignment_problems
from .word_lists import FIRST_NAMES, LAST_NAMES, even, sample

HOME = "http://shop.test/"
CART = "http://shop.test/cart"
_PLACES = (
    ("Lisbon", "Portugal", "Rua da Prata {}", "1100-{:03d}"),
    ("Dresden", "Germany", "Alaunstraße {}", "01{:03d}"),
    ("Bergen", "Norway", "Nygårdsgaten {}", "5{:03d}"),
    ("Toronto", "Canada", "{} Harbord Street", "M5S {:03d}"),
    ("Utrecht", "Netherlands", "Kade {}", "9{:03d} AB"),
    ("Nelson", "New Zealand", "{} Bridge Street", "7{:03d}"),
    ("Lund", "Sweden", "Klostergatan {}", "22{:03d}"),
    ("Galway", "Ireland", "{} Quay Street", "H91 {:03d}"),
    ("Bologna", "Italy", "Via Zamboni {}", "40{:03d}"),
    ("Graz", "Austria", "Herrengasse {}", "8{:03d}"),
)
ADDRESS = ("name", "email", "street", "postcode", "city", "country")
NOBODY: Mapping[str, str] = dict.fromkeys(ADDRESS, "nobody")
_LABELS = {
    "name": "Full name",
    "email": "E-mail",
    "street": "Street and number",
    "postcode": "Postcode",
    "city": "Town",
    "country": "Country",
}


class ShopTask(Task):
    """A task at shop.test, whose first page is open at the start."""

    domain = "shop"
    apps = ("chrome",)
    sites = ("shop",)
    in_browser = True
    unsolvable: ClassVar = {"network_error": "the shop cannot be reached"}

    def initial_app(self, machine: Machine) -> Sequence[str]:
        """Return the browser with the shop."""
        return "chrome", HOME


def recipient(stream: Stream) -> dict[str, str]:
    """Draw somebody's name, e-mail, street, postcode, city and country."""
    first = stream.choice(FIRST_NAMES)
    last = stream.choice(LAST_NAMES)
    city, country, street, postcode = stream.choice(_PLACES)
    account = "".join(c for c in f"{first[0]}{last}".lower() if c.isascii() and c.isalpha())
    return {
        "name": f"{first} {last}",
        "email": f"{account}{stream.integer(10, 99)}@mail.test",
        "street": street.format(stream.integer(2, 98)),
        "postcode": postcode.format(stream.integer(10, 989)),
        "city": city,
        "country": country,
    }


def address_line(person: Mapping[str, str]) -> str:
    """Return name, street, postcode, city and country in one line."""
    street, town = person["street"], f"{person['postcode']} {person['city']}"
    return f"{person['name']}, {street}, {town}, {person['country']}"


def delivery_label(key: str) -> str:
    """Return how the shop calls a way of delivery."""
    return site.content()["delivery"][key]["label"]


def payment_label(key: str) -> str:
    """Return how the shop calls a way to pay."""
    return site.content()["payment"][key]


def categories() -> Mapping[str, str]:
    """Return how the shop calls its categories, by their ids."""
    return site.content()["categories"]


def in_category(category: str) -> list[str]:
    """Return the ids of all products of a category."""
    return [p["id"] for p in site.products().values() if p["category"] == category]


def goods(stream: Stream, count: int) -> list[SimpleNamespace]:
    """Draw different products, as `product` returns them."""
    identifiers = [p["id"] for p in site.products().values()]
    return [product(ident) for ident in sample(stream, identifiers, count)]


def product(ident: str) -> SimpleNamespace:
    """Return a product: its id, name, category, cents, rating, stock, details and so on."""
    return SimpleNamespace(**site.products()[ident])


def grams(item: SimpleNamespace) -> int:
    """Return what a product weighs, 0 if its page does not say."""
    number, _, unit = item.details.get("Weight", "0 g").partition(" ")
    return round(float(number) * {"g": 1, "kg": 1000}[unit])


# Behind the screen


def fill(machine: Machine, cart: Mapping[str, int]) -> None:
    """Let the cart hold these quantities, by the ids of products."""
    with machine.sites.update("shop") as state:
        state["cart"] = dict(cart)


def order(
    machine: Machine,
    lines: Mapping[str, int],
    person: Mapping[str, str],
    *,
    delivery: str = "standard",
    payment: str = "invoice",
    gift: bool = False,
    message: str = "",
) -> None:
    """Store an order, as the site does, which empties the cart."""
    order_lines = [
        {"product": ident, "quantity": n, "cents": n * product(ident).cents}
        for ident, n in lines.items()
    ]
    sum_cents = sum(line["cents"] for line in order_lines)
    with machine.sites.update("shop") as state:
        orders = state.setdefault("orders", [])
        new_order = {key: person[key] for key in ADDRESS} | {
            "delivery": delivery,
            "payment": payment,
            "message": message,
            "gift": gift,
            "lines": order_lines,
            "total_cents": sum_cents + site.content()["delivery"][delivery]["cents"],
            "number": f"AP-{site.FIRST_ORDER + len(orders)}",
        }
        orders.append(new_order)
        state["cart"] = {}


# The judgement


def problems(
    machine: Machine,
    cart: Mapping[str, int] | None = None,
    orders: Sequence[Mapping[str, Any]] = (),
) -> Iterator[str]:
    """Yield how the shop differs from the expected one: as before, apart from the arguments.

    Args:
        machine: It knows the state from before.
        cart: The quantities that should be in the cart; `None` for those from before.
        orders: What should have been ordered since, in any order: `lines` with quantities, and
            each field that matters. An order without `gift` and `message` has none of either.
    """
    before = machine.before.sites["shop"]
    after = machine.sites.read("shop")
    expected_cart = before.get("cart", {}) if cart is None else cart
    if after.get("cart", {}) != expected_cart:
        yield f"the cart holds {after.get('cart', {})}"
    old = before.get("orders", [])
    orders_after = after.get("orders", [])
    if orders_after[: len(old)] != old:
        yield "an order from before was changed"
    new = orders_after[len(old) :]
    if len(new) != len(orders):
        yield f"{len(new)} new orders, not {len(orders)}"
        return
    defaults = {"gift": False, "message": ""}
    problem_table = [
        [
            list(_differences(problems_found, {**defaults, **expected_cart}))
            for expected_cart in orders
        ]
        for problems_found in new
    ]
    yield from best_assignment_problems(problem_table)


def _differences(actual: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Yield how an order differs from the expected one."""
    for key, value in expected.items():
        if key == "lines":
            quantities = {line["product"]: line["quantity"] for line in actual["lines"]}
            if quantities != value:
                yield f"{quantities} was ordered"
        elif even(str(actual[key])) != even(str(value)):
            yield f"{key} of the order is {actual[key]!r}"


# On the screen


def card(name: str) -> re.Pattern[str]:
    """Return a pattern for the link to a product in a list."""
    return re.compile(f"(Sale )?{re.escape(name)}")


def open_product(hand: Hand, name: str) -> None:
    """Open a product of the list that shows, which may be further down."""
    browser.follow(hand, card(name), name)


def search(hand: Hand, words: str) -> None:
    """Look for products with certain words."""
    browser.enter(hand, "Search products", words)
    hand.press("enter")
    hand.find("heading", f'Results for "{words}"', app=browser.APP)


def add(hand: Hand, quantity: int = 1) -> None:
    """Put the product that is open into the cart, and wait for the cart."""
    if quantity > 1:
        browser.select(hand, "Quantity", str(quantity))
    browser.push(hand, "Add to cart", "Your cart")


def change(hand: Hand, name: str, quantity: int) -> None:
    """Change how many of a product are in the cart that is open."""
    hand.click_on("combo-box", f"Quantity of {name}", app=browser.APP, scroll=True)
    hand.type(str(quantity))
    hand.press("enter")
    hand.click_on("push-button", f"Update quantity of {name}", app=browser.APP)


def remove(hand: Hand, name: str) -> None:
    """Take a product out of the cart that is open, if an earlier try has not."""
    button = f"Remove {name}"
    if not browser.shows_text(hand, BUTTONS, button):
        return
    hand.click_on("push-button", button, app=browser.APP, scroll=True)
    hand.wait_until_gone("push-button", button, app=browser.APP)


def check_out(
    hand: Hand,
    person: Mapping[str, str],
    *,
    delivery: str = "standard",
    payment: str = "invoice",
    message: str = "",
) -> None:
    """Order what is in the cart that is open; a message comes with a wrapped present."""
    browser.follow(hand, "Go to checkout", "Checkout")
    browser.enter_in_turn(hand, {label: person[key] for key, label in _LABELS.items()})
    browser.tick(hand, browser.starting(delivery_label(delivery)))
    browser.tick(hand, payment_label(payment))
    if message:
        browser.tick(hand, "Wrap it as a present")
        browser.enter(hand, "Message on the card", message)
    browser.push(hand, "Place order", browser.starting("Thank you"))


def empty_cart(hand: Hand) -> None:
    """Take out what an earlier try has put into the cart, if there is something."""
    hand.find("link", re.compile("Cart [0-9]+"), app=browser.APP)
    if hand.see("link", "Cart 0", app=browser.APP) is not None:
        return
    browser.visit(hand, CART, "Your cart")
    remove_button = re.compile("Remove ")
    while browser.shows_text(hand, BUTTONS, remove_button):
        hand.click_on(BUTTONS, remove_button, app=browser.APP)
        hand.find("heading", "Your cart", app=browser.APP)
