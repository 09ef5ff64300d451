"""What a visitor of shop.test and forms.test reads and is told, beyond the way that tasks take."""

import pytest

from support import needs

pytest.importorskip("jinja2", reason=needs.ONLINE)

from online_env.embedded.sites.hosts import forms, shop

from support.sites import local_web

ADDRESS = {
    "name": "Robin Hale",
    "email": "robin@mail.test",
    "street": "Quay Row 3",
    "postcode": "1234",
    "city": "Port Alder",
    "country": "Norway",
    "delivery": "standard",
    "payment": "cash",
    "message": "",
}


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


def fill(web, **products):
    for product, quantity in products.items():
        web.post("shop.test/cart/add", product=product, quantity=str(quantity))


def cart(web):
    return web.state.read("shop").get("cart", {})


# The shelves


@pytest.mark.parametrize(
    ("order", "key"),
    [
        ("price", lambda product: product["cents"]),
        ("-price", lambda product: -product["cents"]),
        ("-rating", lambda product: -product["rating"]),
        ("", lambda product: 0),
        ("rating", lambda product: 0),
    ],
)
def test_a_shelf_is_in_the_order_that_was_asked_for(web, order, key):
    outdoors = [p for p in shop.content()["products"] if p["category"] == "outdoors"]
    expected = [product["id"] for product in sorted(outdoors, key=key)]
    assert len(expected) == 5
    assert web.links("shop.test/category/outdoors", "/product/", sort=order) == expected
    options = web.get("shop.test/category/outdoors", sort=order).text
    result = order if order in shop.SORTS else ""
    assert f'<option value="{result}" selected>' in options


def test_the_front_page_has_what_is_on_sale_and_the_eight_best(web):
    products = shop.content()["products"]
    page = web.get("shop.test/").text
    offers, _, best = page.partition('id="best"')
    sale = {product["id"] for product in products if "was" in product}
    assert sale == {"dripper", "lamp", "headphones", "lantern"}
    assert offers.count("<em>Sale</em>") == len(sale)
    ratings = sorted((product["rating"] for product in products), reverse=True)
    values = [product["rating"] for product in products if f"/product/{product['id']}" in best]
    assert sorted(values, reverse=True) == ratings[:8]


def test_a_product_says_how_many_are_left_and_names_others_of_its_kind(web):
    few = web.text("shop.test/product/knife")
    assert "Only 6 left. Delivered in" in few
    assert "1 2 3 4 5 6 Add to cart" in few
    many = web.text("shop.test/product/kettle")
    assert "In stock. Delivered in" in many
    assert "1 2 3 4 5 6 7 8 9 Add to cart" in many
    remaining = web.links("shop.test/product/kettle", "/product/")
    assert remaining == ["dripper", "mug", "knife", "pan"]
    for path in ("product/gold", "category/toys", "order/AP-20418", "product/"):
        assert web.get(f"shop.test/{path}").status_code == 404, path


def test_what_is_looked_for_is_found_by_all_its_words(web):
    assert web.links("shop.test/search", "/product/", q="camp lantern") == ["lantern"]
    assert "Nothing was found. Try another word" in web.text("shop.test/search", q="gold")
    assert "1 product " in web.text("shop.test/search", q="camp lantern")


# The cart


def test_a_quantity_is_added_on_a_shelf_and_set_in_the_cart(web):
    fill(web, mug=2)
    fill(web, mug=1, lamp=1, knife=0)
    assert cart(web) == {"mug": 3, "lamp": 1}
    assert "$49.50" in web.text("shop.test/cart")
    assert "Subtotal $128.50" in web.text("shop.test/cart")
    web.post("shop.test/cart/update", product="mug", quantity="1")
    web.post("shop.test/cart/update", product="lamp", quantity="0")
    web.post("shop.test/cart/update", product="pan", quantity="0")
    assert cart(web) == {"mug": 1}
    web.post("shop.test/cart/update", product="mug", quantity="999")
    fill(web, radio=9)
    assert cart(web) == {"mug": shop.MAX_QUANTITY, "radio": 5}, "of radios five are in stock"
    web.post("shop.test/cart/add", product="pan")
    assert cart(web)["pan"] == 1


@pytest.mark.parametrize("quantity", ["", " ", "-1", "1.5", "1000", "٣"])
def test_what_is_no_quantity_changes_nothing(web, quantity):
    fill(web, mug=2)
    answer = web.post("shop.test/cart/update", product="mug", quantity=quantity)
    assert answer.status_code == 400
    assert "There is no such product or quantity." in answer.text
    assert cart(web) == {"mug": 2}


# The order


def test_without_a_cart_there_is_no_order(web):
    for answer in (web.get("shop.test/checkout"), web.post("shop.test/checkout", **ADDRESS)):
        assert (answer.status_code, answer.headers["location"]) == (303, "/cart")
    assert "orders" not in web.state.read("shop")


LACKING = [
    ("name", "", "Enter the name of the recipient."),
    ("email", "robin@mail", "Enter an e-mail address, such as name@mail.test."),
    ("street", "x" * 101, "Enter street and number."),
    ("postcode", "x" * 13, "Enter the postcode."),
    ("city", " ", "Enter the town."),
    ("country", "Atlantis", "Choose a country."),
    ("delivery", "drone", "Choose how we deliver."),
    ("payment", "", "Choose how to pay."),
    ("message", "x" * 501, "Use at most 500 characters."),
]


@pytest.mark.parametrize(("field", "value", "message"), LACKING)
def test_an_order_that_lacks_something_says_what_and_keeps_the_cart(web, field, value, message):
    fill(web, mug=1)
    answer = web.post("shop.test/checkout", **ADDRESS | {field: value}, gift="yes")
    assert answer.status_code == 422
    assert "Please correct 1 field below." in answer.text
    assert [text for *_, text in LACKING if f'">{text}</span>' in answer.text] == [message]
    assert 'name="gift" value="yes" checked' in answer.text
    assert web.state.read("shop") == {"cart": {"mug": 1}}


def test_orders_are_numbered_and_shown_as_they_were_placed(web):
    for number, (delivery, cents) in enumerate((("pickup", 0), ("express", 1290)), 20418):
        fill(web, mug=2, lantern=1)
        placed = web.post("shop.test/checkout", **ADDRESS | {"delivery": delivery})
        assert placed.headers["location"] == f"/order/AP-{number}"
        order = web.state.read("shop")["orders"][-1]
        assert order["total_cents"] == 2 * 1650 + 4450 + cents
        assert order["gift"] is False
    value = web.text("shop.test/order/AP-20419")
    assert "2 x Dipped stoneware mug $33.00 1 x Camp lantern $44.50" in value
    assert "Express, next working day $12.90 Cash on delivery Total $90.40" in value


# Registrations


REGISTRATION = {
    "name": "Zoë",
    "email": "zoe@mail.test",
    "birth_date": "1990-05-17",
    "country": "Norway",
    "course": "chess",
    "level": "some",
    "notes": "",
    "agree": "yes",
}


@pytest.mark.parametrize(
    ("text", "taken"),
    [
        ("1900-01-01", True),
        ("2026-03-03", True),
        ("2000-02-29", True),
        ("1899-12-31", False),
        ("2026-03-04", False),
        ("1900-02-29", False),
        ("19900517", False),
        ("1990-W20-4", False),
        ("1990-5-17", False),
        ("", False),
    ],
)
def test_a_date_of_birth_is_a_day_before_today_as_browsers_send_it(web, text, taken):
    answer = web.post("forms.test/register", **REGISTRATION | {"birth_date": text})
    assert answer.status_code == (303 if taken else 422)
    assert ("Please enter your date of birth." in answer.text) == (not taken)
    stored = web.state.read("forms").get("registrations", [])
    assert [entry["birth_date"] for entry in stored] == ([text] if taken else [])


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("a@b.c", True),
        ("zoë.o'neill+x@mail.co.test", True),
        ("a@b", False),
        ("a@b.", False),
        ("a b@c.d", False),
        ("a@b@c.d", False),
        ("@b.c", False),
    ],
)
def test_what_is_an_e_mail_address(text, is_one):
    assert bool(forms.EMAIL.fullmatch(text)) == is_one


def test_a_course_of_the_list_is_chosen_in_the_form_already(web):
    def chosen(course):
        page = web.get("forms.test/register", course=course).text
        select = page.partition('name="course"')[2].partition("</select>")[0]
        return [
            option.partition('"')[0]
            for option in select.split('value="')[1:]
            if "selected" in option
        ]

    assert chosen("pottery") == ["pottery"]
    assert chosen("gold") == []


def test_numbers_go_on_after_a_registration_was_cancelled(web):
    for _ in range(2):
        web.post("forms.test/register", **REGISTRATION)
    web.post("forms.test/registrations/1002/cancel")
    web.post("forms.test/register", **REGISTRATION)
    registrations = web.state.read("forms")["registrations"]
    assert [(entry["number"], entry.get("cancelled")) for entry in registrations] == [
        (1001, None),
        (1002, True),
        (1003, None),
    ]
    assert web.get("forms.test/registrations/1002/change").status_code == 409
    result = web.get("forms.test/find", number=" 1003 ", email="ZOE@mail.test")
    assert result.headers["location"] == "/registrations/1003"
    assert web.get("forms.test/find").status_code == 200
    lacking = web.get("forms.test/find", number="1004")
    assert lacking.status_code == 422
    assert "There is no registration with this number and e-mail." in lacking.text
