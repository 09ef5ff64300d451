"""Change how many of two products are in the cart."""

from online_env.tasks.kit import browser, shop
from online_env.tasks.plan_words import quoted


class ChangeQuantities(shop.ShopTask):
    """Two of three products in the cart get another quantity; nothing is ordered."""

    name = "change_quantities"
    phrasings = (
        'My cart at shop.test is open. Make it {n0} of "{p0}" and {n1} of "{p1}". Leave the rest,'
        " and don't order yet.",
        "Please change two quantities in the cart at shop.test: {p0} to {n0}, {p1} to {n1}. I will"
        " check out later myself.",
        "shop.test cart: {n0} x {p0}, {n1} x {p1}; the third product stays as it is. No order.",
    )

    def draw(self, stream):
        chosen = [p for p in shop.goods(stream, 6) if p.stock >= 9][:3]
        had = [stream.integer(1, 3) for _ in chosen]
        new = [stream.integer(4, 8), stream.integer(4, 8), had[2]]
        ids = [p.id for p in chosen]
        return {
            "names": [p.name for p in chosen],
            "had": dict(zip(ids, had, strict=True)),
            "wanted": dict(zip(ids, new, strict=True)),
            "ids": ids,
            "p0": chosen[0].name,
            "p1": chosen[1].name,
            "n0": new[0],
            "n1": new[1],
        }

    def prepare(self, machine):
        shop.fill(machine, self.values.had)

    def initial_app(self, machine):
        return "chrome", shop.CART

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine, cart=self.values.wanted)

    def oracle(self, hand):
        browser.begin(hand, shop.CART, "Your cart")
        for ident, name in zip(self.values.ids[:2], self.values.names, strict=False):
            shop.change(hand, name, self.values.wanted[ident])

    def plan(self):
        steps = ['window "Chromium"']
        for ident, name in zip(self.values.ids[:2], self.values.names, strict=False):
            steps += [
                f'click "Quantity" near {quoted(name)}',
                f"type {quoted(str(self.values.wanted[ident]))}",
                f'click "Update" near {quoted(name)}',
                "wait",
            ]
        return steps

    def wrong_results(self):
        a, b, c = self.values.ids
        wanted, had = self.values.wanted, self.values.had
        return {
            "only one": lambda m: shop.fill(m, {**had, a: wanted[a]}),
            "all three": lambda m: shop.fill(m, {**wanted, c: 9}),
            "the other way round": lambda m: shop.fill(m, {**wanted, a: 1, b: had[b]}),
            "ordered as well": lambda m: shop.order(m, wanted, shop.NOBODY),
        }

    def right_result(self, machine):
        shop.fill(machine, dict(reversed(self.values.wanted.items())))
