"""shop.test: a shop for things that last.

State, `shop.json`: `{"cart": {PRODUCT: quantity}, "orders": [{"number", "lines": [{"product",
"quantity", "cents"}], "delivery", "payment", "total_cents", "name", "email", "street", "city",
"postcode", "country", "gift" (bool), "message"}]}`, oldest order first.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..index import Document, find
from ..library import load
from ..pages import fields, first, page, query, see_other, site, site_state
from ..state import SiteState
from .forms import EMAIL

HOST = "shop.test"
MAX_QUANTITY = 9
SORTS = {
    "": "Featured",
    "price": "Price: low to high",
    "-price": "Price: high to low",
    "-rating": "Best rated",
}
FIRST_ORDER = 20418


@cache
def content() -> dict[str, Any]:
    """`content/shop.yaml`."""
    return load("shop")


@cache
def products() -> dict[str, dict[str, Any]]:
    """Return the products by id."""
    return {p["id"]: {"was": None, **p} for p in content()["products"]}


def documents() -> list[Document]:
    """Return the pages of this site that the search page finds."""
    return [
        Document(
            HOST,
            f"/product/{i}",
            p["name"],
            f"{p['blurb']} {p['text']}",
            "Shopping",
            f"product-{i}",
        )
        for i, p in products().items()
    ]


def _cart(request: Request) -> dict[str, int]:
    return site_state(request).read("shop").get("cart", {})


def _common(request: Request) -> dict[str, object]:
    return {
        "shop": content(),
        "query": query(request, "q"),
        "cart_count": sum(_cart(request).values()),
        "category": None,
    }


def _lines(cart: Mapping[str, int]) -> list[dict[str, Any]]:
    return [
        {"product": products()[i], "quantity": n, "cents": n * products()[i]["cents"]}
        for i, n in cart.items()
    ]


def _sorted(selection: Sequence[dict[str, Any]], order: str) -> list[dict[str, Any]]:
    keys = {
        "price": lambda p: p["cents"],
        "-price": lambda p: -p["cents"],
        "-rating": lambda p: -p["rating"],
    }
    return sorted(selection, key=keys[order]) if order in keys else list(selection)


async def home(request: Request) -> Response:
    """Offers, and the best products."""
    selection = list(products().values())
    return page(
        request,
        "home.html",
        offers=[p for p in selection if p["was"]],
        best=_sorted(selection, "-rating")[:8],
    )


async def category(request: Request) -> Response:
    """Return the products of a category.

    Raises:
        HTTPException: There is no such category (404).
    """
    name = request.path_params["name"]
    if name != "all" and name not in content()["categories"]:
        raise HTTPException(404)
    order = query(request, "sort")
    selection = [p for p in products().values() if name in ("all", p["category"])]
    return page(
        request,
        "list.html",
        category=name,
        heading=content()["categories"].get(name, "All products"),
        chosen=_sorted(selection, order),
        sorts=SORTS,
        order=order if order in SORTS else "",
    )


async def search(request: Request) -> Response:
    """Return the products with certain words."""
    hits = find(query(request, "q"), documents())
    selection = [products()[h.document.path.rsplit("/", 1)[1]] for h in hits]
    return page(
        request,
        "list.html",
        heading=f'Results for "{query(request, "q")}"',
        chosen=selection,
        sorts={},
        order="",
    )


async def product(request: Request) -> Response:
    """Return one product.

    Raises:
        HTTPException: There is no such product (404).
    """
    item = products().get(request.path_params["id"])
    if item is None:
        raise HTTPException(404)
    related = [
        p for p in products().values() if p is not item and p["category"] == item["category"]
    ]
    return page(
        request,
        "product.html",
        product=item,
        others=related[:4],
        most=min(MAX_QUANTITY, item["stock"]),
    )


async def cart(request: Request) -> Response:
    """Return the cart."""
    lines = _lines(_cart(request))
    return page(
        request,
        "cart.html",
        lines=lines,
        subtotal=sum(x["cents"] for x in lines),
        most=MAX_QUANTITY,
    )


async def change_cart(request: Request) -> Response:
    """Put a product into the cart, or change how many are there.

    Raises:
        HTTPException: There is no such product or quantity (400).
    """
    form = await fields(request)
    product_id = first(form, "product")
    number = first(form, "quantity", "1")
    if product_id not in products() or not (
        number.isascii() and number.isdigit() and len(number) < 4
    ):
        raise HTTPException(400, "There is no such product or quantity.")
    with site_state(request).update("shop") as state:
        cart = state.setdefault("cart", {})
        already = cart.get(product_id, 0) if request.url.path == "/cart/add" else 0
        quantity = min(already + int(number), MAX_QUANTITY, products()[product_id]["stock"])
        cart[product_id] = quantity
        if not quantity:
            del cart[product_id]
    return see_other("/cart")


def _problems(order: Mapping[str, str]) -> dict[str, str]:
    checks = {
        "name": (0 < len(order["name"]) <= 100, "Enter the name of the recipient."),
        "email": (
            EMAIL.fullmatch(order["email"]),
            "Enter an e-mail address, such as name@mail.test.",
        ),
        "street": (0 < len(order["street"]) <= 100, "Enter street and number."),
        "city": (0 < len(order["city"]) <= 100, "Enter the town."),
        "postcode": (0 < len(order["postcode"]) <= 12, "Enter the postcode."),
        "country": (order["country"] in content()["countries"], "Choose a country."),
        "delivery": (order["delivery"] in content()["delivery"], "Choose how we deliver."),
        "payment": (order["payment"] in content()["payment"], "Choose how to pay."),
        "message": (len(order["message"]) <= 500, "Use at most 500 characters."),
    }
    return {name: message for name, (fine, message) in checks.items() if not fine}


async def checkout(request: Request) -> Response:
    """Return the form for an order, and its answers."""
    lines = _lines(_cart(request))
    if not lines:
        return see_other("/cart")
    form = await fields(request) if request.method == "POST" else {}
    names = (
        "name",
        "email",
        "street",
        "city",
        "postcode",
        "country",
        "delivery",
        "payment",
        "message",
    )
    order: dict[str, Any] = {n: first(form, n) for n in names}
    problems = _problems(order) if form else {}
    if not form or problems:
        order["delivery"] = order["delivery"] or "standard"
        order["gift"] = first(form, "gift") == "yes"
        return page(
            request,
            "checkout.html",
            422 if problems else 200,
            lines=lines,
            order=order,
            problems=problems,
            subtotal=sum(x["cents"] for x in lines),
        )
    order["gift"] = first(form, "gift") == "yes"
    return see_other(f"/order/{_place_order(site_state(request), order)}")


def _place_order(sites: SiteState, order: dict[str, Any]) -> str:
    """Turn the cart as it is now into an order; returns its number."""
    with sites.update("shop") as state:
        lines = _lines(state.get("cart", {}))
        order["lines"] = [{**x, "product": x["product"]["id"]} for x in lines]
        order["total_cents"] = (
            sum(x["cents"] for x in lines) + content()["delivery"][order["delivery"]]["cents"]
        )
        orders = state.setdefault("orders", [])
        order["number"] = f"AP-{FIRST_ORDER + len(orders)}"
        orders.append(order)
        state["cart"] = {}
    return order["number"]


async def placed(request: Request) -> Response:
    """Return the page after an order.

    Raises:
        HTTPException: There is no such order (404).
    """
    for order in site_state(request).read("shop").get("orders", []):
        if order["number"] == request.path_params["number"]:
            return page(request, "order.html", order=order, products=products())
    raise HTTPException(404)


def make(sites: SiteState) -> Starlette:
    """Return the application."""
    routes = [
        Route("/", home),
        Route("/category/{name}", category),
        Route("/search", search),
        Route("/product/{id}", product),
        Route("/cart", cart),
        Route("/cart/add", change_cart, methods=["POST"]),
        Route("/cart/update", change_cart, methods=["POST"]),
        Route("/checkout", checkout, methods=["GET", "POST"]),
        Route("/order/{number}", placed),
    ]
    return site("shop", routes, sites, _common)
