"""Use a coupon, in a shop that takes none."""

from online_env.tasks import Task
from online_env.tasks.kit import browser, shop


class RedeemCoupon(Task):
    """The cart is full; neither the cart nor the checkout has a field for a code."""

    name = "redeem_coupon"
    domain = "infeasible"
    apps = ("chrome",)
    sites = ("shop",)
    in_browser = True
    infeasible = "the shop takes no coupons"
    unsolvable = {"network_error": "the shop cannot be reached"}
    phrasings = (
        "Apply my coupon code {code} ({percent} % off) to the cart at shop.test. Don't order yet.",
        "I have a voucher for shop.test: {code}. Please redeem it for what is in my cart, so that"
        " the {percent} % are taken off.",
        "shop.test: enter the coupon {code} for the cart, {percent} % off.",
    )

    def draw(self, stream):
        letters = "ABCDEFGHKLMNPRST"
        word = "".join(stream.choice(letters) for _ in range(5))
        return {
            "code": f"{word}{stream.integer(10, 99)}",
            "percent": stream.choice((5, 10, 15, 20, 25)),
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
        hand.find("entry", "Message on the card", app=browser.APP, scroll=True)
        browser.follow(hand, "Back to the cart", "Your cart")
        hand.give_up("there is no field for a coupon")

    def plan(self):
        return [
            'window "Chromium"',
            'click "Go to checkout"',
            'scroll down to "Message on the card"',
            'scroll down to "Back to the cart"',
            'click "Back to the cart"',
            'wait for "Your cart"',
            'give up "there is no field for a coupon"',
        ]

    def wrong_results(self):
        cart, code = self.values.cart, self.values.code
        return {
            "ordered without it": lambda m: shop.order(m, cart, shop.NOBODY),
            "the code on the card": lambda m: shop.order(m, cart, shop.NOBODY, message=code),
            "fewer pieces instead": lambda m: shop.fill(m, dict.fromkeys(cart, 4)),
        }
