"""Put the same things into the cart again as in an earlier order."""

from online_env.tasks.kit import browser, plan_steps, shop


class RepeatOrder(shop.ShopTask):
    """One of several orders is to be repeated, with its quantities; the page of it is open."""

    name = "repeat_order"
    phrasings = (
        "The browser shows my order {number} at shop.test. Put the same things into the cart again,"
        " as many of each as then. I will check out myself.",
        "I want to order the same again as in {number} (see {address}). Please fill the cart with"
        " the same products and quantities, but don't place the order.",
        "Same again please: everything from order {number} at shop.test into the cart.",
    )

    def draw(self, stream):
        chosen = shop.goods(stream, 5)
        orders = [
            {p.id: stream.integer(1, 4) for p in chosen[:3]},
            {p.id: stream.integer(1, 4) for p in chosen[2:]},
        ]
        index = stream.integer(0, 1)
        earlier = [{p.id: 1} for p in shop.goods(stream, stream.integer(0, 12))]
        number = f"AP-{20418 + len(earlier) + index}"
        return {
            "orders": [*earlier, *orders],
            "person": shop.recipient(stream),
            "number": number,
            "address": f"http://shop.test/order/{number}",
            "wanted": orders[index],
            "names": [shop.product(ident).name for ident in orders[index]],
            "other": orders[1 - index],
        }

    def prepare(self, machine):
        for lines in self.values.orders:
            shop.order(machine, lines, self.values.person)

    def initial_app(self, machine):
        return "chrome", self.values.address

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from shop.problems(machine, cart=self.values.wanted)

    def oracle(self, hand):
        browser.begin(hand, self.values.address, browser.starting("Thank you"))
        shop.empty_cart(hand)
        for name, count in zip(self.values.names, self.values.wanted.values(), strict=True):
            browser.follow(hand, "All", "All products")
            shop.open_product(hand, name)
            shop.add(hand, count)

    def plan(self):
        steps = ['window "Chromium"']
        for ident, count in self.values.wanted.items():
            steps += plan_steps.put_into_cart(shop.product(ident), count)
        return steps

    def wrong_results(self):
        wanted = self.values.wanted
        first = next(iter(wanted))
        return {
            "the other order": lambda m: shop.fill(m, self.values.other),
            "one too many": lambda m: shop.fill(m, {**wanted, first: wanted[first] + 1}),
            "one is missing": lambda m: shop.fill(m, {first: wanted[first]}),
            "ordered": lambda m: shop.order(m, wanted, self.values.person),
        }

    def right_result(self, machine):
        shop.fill(machine, dict(reversed(self.values.wanted.items())))
