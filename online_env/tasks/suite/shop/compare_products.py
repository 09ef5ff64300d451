"""Compare two products, and put the better one into the cart."""

from online_env.tasks.kit import browser, shop
from online_env.tasks.kit.word_lists import sample
from online_env.tasks.plan_words import quoted

ASPECTS = {
    "weighs less": shop.grams,
    "costs less": lambda p: p.cents,
    "has the better rating": lambda p: -p.rating,
    "has more reviews": lambda p: -p.reviews,
}


class CompareProducts(shop.ShopTask):
    """Weight, price, rating or number of reviews decides; one piece goes into the cart."""

    name = "compare_products"
    phrasings = (
        'Compare "{a}" and "{b}" at shop.test, and put the one that {aspect} into the cart: one'
        " piece.",
        "I can't decide between {a} and {b} (both at shop.test). Please add the one that {aspect}"
        " to my cart, just one.",
        "shop.test: {a} or {b}? Whichever {aspect} goes into the cart, once.",
    )

    def draw(self, stream):
        aspect = stream.choice(list(ASPECTS))
        value = ASPECTS[aspect]
        pair = sample(stream, [p for p in shop.goods(stream, 18) if shop.grams(p)], 2)
        while value(pair[0]) == value(pair[1]):
            pair = sample(stream, [p for p in shop.goods(stream, 18) if shop.grams(p)], 2)
        best, other = sorted(pair, key=value)
        return {
            "a": pair[0].name,
            "b": pair[1].name,
            "aspect": aspect,
            "best": best,
            "other": other,
        }

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine, cart={self.values.best.id: 1})

    def oracle(self, hand):
        shop.empty_cart(hand)
        for product in (self.values.other, self.values.best):
            shop.search(hand, product.name)
            shop.open_product(hand, product.name)
            hand.find("heading", "Details", app=browser.APP)
        shop.add(hand)

    def plan(self):
        steps = ['window "Chromium"']
        for product in (self.values.other, self.values.best):
            steps += [
                'click "Search products"',
                "press ctrl+a",
                f"type {quoted(product.name)}",
                "press enter",
                'wait for "Results for"',
                f"click {quoted(product.name)} near {quoted(product.blurb[:24])}",
                'wait for "Quantity"',
            ]
        return [
            *steps,
            'scroll down to "Add to cart"',
            'click "Add to cart"',
            'wait for "Your cart"',
        ]

    def wrong_results(self):
        best, other = self.values.best.id, self.values.other.id
        return {
            "the other one": lambda m: shop.fill(m, {other: 1}),
            "both": lambda m: shop.fill(m, {other: 1, best: 1}),
            "two pieces": lambda m: shop.fill(m, {best: 2}),
            "ordered": lambda m: shop.order(m, {best: 1}, shop.NOBODY),
        }

    def right_result(self, machine):
        shop.fill(machine, {self.values.best.id: 1})
