"""Pay in a way that the shop does not offer."""

from online_env.tasks import Task
from online_env.tasks.kit import browser, shop
from online_env.tasks.plan_words import quoted

WAYS = ("credit card", "direct debit", "a gift voucher", "instalments", "cryptocurrency")


class PayByMethod(Task):
    """The cart is full, the address known, but the checkout has three other ways to pay."""

    name = "pay_by_method"
    domain = "infeasible"
    apps = ("chrome",)
    sites = ("shop",)
    in_browser = True
    infeasible = "the shop has only invoice, bank transfer and cash on delivery"
    unsolvable = {"network_error": "the shop cannot be reached"}
    phrasings = (
        "Order what is in my cart at shop.test and pay by {way}, no other way. Send it to"
        " {address}, e-mail {email}.",
        "Please check out my cart at shop.test. Recipient: {address}, {email}. It has to be paid by"
        " {way}.",
        "shop.test: place the order for my cart, {way} as the payment. To {address} ({email}).",
    )

    def draw(self, stream):
        person = shop.recipient(stream)
        return {
            "way": stream.choice(WAYS),
            "person": person,
            "address": shop.address_line(person),
            "email": person["email"],
            "cart": {p.id: stream.integer(1, 3) for p in shop.goods(stream, 2)},
        }

    def prepare(self, machine):
        shop.fill(machine, self.values.cart)

    def initial_app(self, machine):
        return "chrome", shop.CART

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine)

    def oracle(self, hand):
        browser.begin(hand, shop.CART, "Your cart")
        browser.follow(hand, "Go to checkout", "Checkout")
        hand.find("radio-button", "Cash on delivery", app=browser.APP, scroll=True)
        hand.give_up(f"the shop does not take {self.values.way}")

    def plan(self):
        return [
            'window "Chromium"',
            'click "Go to checkout"',
            'scroll down to "Cash on delivery"',
            f"give up {quoted(f'the shop does not take {self.values.way}')}",
        ]

    def wrong_results(self):
        cart, person = self.values.cart, self.values.person
        return {
            "by invoice": lambda m: shop.order(m, cart, person),
            "in cash": lambda m: shop.order(m, cart, person, payment="cash"),
            "the wish on the card": lambda m: shop.order(m, cart, person, message=self.values.way),
            "the cart was emptied": lambda m: shop.fill(m, {}),
        }
