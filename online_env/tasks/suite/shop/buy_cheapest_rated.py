"""Find the cheapest product of a category with a minimum rating, and put some into the cart."""

from online_env.tasks.kit import browser, plan_steps, shop


class BuyCheapestRated(shop.ShopTask):
    """The cheapest product of all is not the one: its rating is too low, or it is there already."""

    name = "buy_cheapest_rated"
    phrasings = (
        "At shop.test, put {count} of the cheapest product in the category {label} into the cart"
        ' that is rated {rating} stars or better. Not "{owned}", though: we have that.',
        "Which {label} article at shop.test is the cheapest with at least {rating} stars, apart"
        " from {owned}? Please put {count} of it into my cart. No order yet.",
        "Put into the cart at shop.test, without ordering: {count} x the cheapest thing from"
        " {label} with a rating of {rating} or more ({owned} does not count, we own it).",
    )

    def draw(self, stream):
        category = stream.choice(list(shop.categories()))
        everything = [shop.product(ident) for ident in shop.in_category(category)]
        rating = stream.choice(sorted({p.rating for p in everything})[:2])
        fitting = sorted((p for p in everything if p.rating >= rating), key=lambda p: p.cents)
        owned = fitting.pop(stream.integer(0, 1))
        chosen = fitting[0]
        others = [p.id for p in everything if p.id not in (chosen.id, owned.id)]
        return {
            "category": category,
            "label": shop.categories()[category],
            "rating": rating,
            "owned": owned.name,
            "chosen": chosen,
            "others": others,
            "count": stream.integer(2, 5),
        }

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine, cart={self.values.chosen.id: self.values.count})

    def oracle(self, hand):
        shop.empty_cart(hand)
        browser.follow(hand, self.values.label, self.values.label)
        browser.select(hand, "Sort by", "Price: low")
        browser.push(hand, "Apply", self.values.label)
        shop.open_product(hand, self.values.chosen.name)
        shop.add(hand, self.values.count)

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.put_into_cart(self.values.chosen, self.values.count),
        ]

    def wrong_results(self):
        chosen, count = self.values.chosen.id, self.values.count
        return {
            "another product": lambda m: shop.fill(m, {self.values.others[0]: count}),
            "only one": lambda m: shop.fill(m, {chosen: 1}),
            "another one as well": lambda m: shop.fill(
                m, {chosen: count, self.values.others[0]: 1}
            ),
            "ordered": lambda m: shop.order(m, {chosen: count}, shop.NOBODY),
        }

    def right_result(self, machine):
        shop.fill(machine, {self.values.chosen.id: self.values.count})
