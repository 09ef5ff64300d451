"""Take what costs more than a limit out of the cart."""

from online_env.tasks.kit import browser, shop
from online_env.tasks.plan_words import quoted


class RemoveExpensive(shop.ShopTask):
    """Five products in the cart, of which two are too expensive; the quantities mislead."""

    name = "remove_expensive"
    phrasings = (
        "Take everything out of my cart at shop.test that costs more than ${limit} apiece, and"
        " leave the rest as it is.",
        "My cart (shop.test, open in the browser) has become too expensive. Please remove each"
        " product with a price above ${limit} a piece; the others stay.",
        "shop.test cart: remove what costs over ${limit} each.",
    )

    def draw(self, stream):
        chosen = shop.goods(stream, 5)
        by_price = sorted(chosen, key=lambda p: p.cents)
        limit = -(-by_price[2].cents // 100)
        return {
            "had": {p.id: stream.integer(1, 3) for p in chosen},
            "dear": by_price[3:],
            "limit": limit,
        }

    def prepare(self, machine):
        shop.fill(machine, self.values.had)

    def initial_app(self, machine):
        return "chrome", shop.CART

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine, cart=self.without(*self.values.dear))

    def oracle(self, hand):
        browser.begin(hand, shop.CART, "Your cart")
        for product in self.values.dear:
            shop.remove(hand, product.name)

    def without(self, *products):
        """What the cart holds without some products."""
        gone = {p.id for p in products}
        return {ident: n for ident, n in self.values.had.items() if ident not in gone}

    def plan(self):
        steps = ['window "Chromium"']
        for product in self.values.dear:
            steps += [f'click "Remove" near {quoted(product.name)}', "wait"]
        return steps

    def wrong_results(self):
        first, second = self.values.dear
        cheap = next(iter(self.without(first, second)))
        return {
            "only one": lambda m: shop.fill(m, self.without(second)),
            "the cart is empty": lambda m: shop.fill(m, {}),
            "one of each left": lambda m: shop.fill(m, {**self.without(second), first.id: 1}),
            "another quantity": lambda m: shop.fill(m, {**self.without(first, second), cheap: 4}),
        }

    def right_result(self, machine):
        shop.fill(machine, dict(reversed(self.without(*self.values.dear).items())))
