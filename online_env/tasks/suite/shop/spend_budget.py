"""Buy as many pieces of a product as a budget allows."""

from online_env.tasks.kit import browser, plan_steps, shop
from online_env.tasks.kit.word_lists import sample


class SpendBudget(shop.ShopTask):
    """The price is on the page; how many pieces fit into the budget is to be worked out."""

    name = "spend_budget"
    phrasings = (
        'I have ${budget} for "{product}" from shop.test. Put as many of them into the cart as'
        " that pays for, not counting delivery.",
        "How many pieces of {product} can we get at shop.test for ${budget} (goods only, without"
        " delivery)? Please put that many into the cart.",
        "Fill the cart at shop.test with {product}, as many as possible for at most ${budget}"
        " before delivery. Don't order.",
    )

    def draw(self, stream):
        plenty = [p for p in shop.goods(stream, 18) if p.stock >= 9]
        product = sample(stream, plenty, 1)[0]
        count = stream.integer(2, 8)
        dollars = product.cents // 100
        budget = count * product.cents // 100 + stream.integer(1, dollars - 1)
        return {"chosen": product, "product": product.name, "count": count, "budget": budget}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine, cart={self.values.chosen.id: self.values.count})

    def oracle(self, hand):
        shop.empty_cart(hand)
        label = shop.categories()[self.values.chosen.category]
        browser.follow(hand, label, label)
        shop.open_product(hand, self.values.product)
        shop.add(hand, self.values.count)

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.put_into_cart(self.values.chosen, self.values.count),
        ]

    def wrong_results(self):
        ident, count = self.values.chosen.id, self.values.count
        other = next(p for p in shop.in_category(self.values.chosen.category) if p != ident)
        return {
            "one too many": lambda m: shop.fill(m, {ident: count + 1}),
            "one too few": lambda m: shop.fill(m, {ident: count - 1}),
            "the rest for another": lambda m: shop.fill(m, {ident: count, other: 1}),
            "ordered": lambda m: shop.order(m, {ident: count}, shop.NOBODY),
        }

    def right_result(self, machine):
        shop.fill(machine, {self.values.chosen.id: self.values.count})
