"""Order two products in given quantities to an address."""

from online_env.tasks.kit import browser, plan_steps, shop
from online_env.tasks.kit.word_lists import sample


class OrderToAddress(shop.ShopTask):
    """Two products, their quantities, an address, the delivery and the payment."""

    name = "order_to_address"
    phrasings = (
        'Order {n0} of "{p0}" and {n1} of "{p1}" at shop.test. They go to {address}; e-mail'
        ' {email}. Delivery: "{how}". Payment: "{pay}".',
        "Please buy {n0} x {p0} and {n1} x {p1} in the shop that is open in the browser. Send them"
        " to {address}, with the e-mail address {email}. {how}; {pay}.",
        "I need {p0} ({n0} pieces) and {p1} ({n1} pieces) from shop.test. Recipient: {address}."
        " Mail: {email}. Choose the delivery {how} and the payment {pay}.",
    )

    def draw(self, stream):
        first, second = sample(stream, [p for p in shop.goods(stream, 9) if p.stock > 5], 2)
        person = shop.recipient(stream)
        delivery = stream.choice(("standard", "express"))
        payment = stream.choice(("invoice", "transfer", "cash"))
        counts = [stream.integer(2, 5), stream.integer(1, 4)]
        return {
            "person": person,
            "shelves": [shop.categories()[item.category] for item in (first, second)],
            "lines": {first.id: counts[0], second.id: counts[1]},
            "delivery": delivery,
            "payment": payment,
            "address": shop.address_line(person),
            "email": person["email"],
            "how": shop.delivery_label(delivery),
            "pay": shop.payment_label(payment),
            "n0": counts[0],
            "n1": counts[1],
            "p0": first.name,
            "p1": second.name,
        }

    def problems(self, machine):
        yield from machine.unexpected_changes()
        values = self.values
        order = {"lines": values.lines, "delivery": values.delivery, "payment": values.payment}
        yield from shop.problems(machine, cart={}, orders=[{**values.person, **order}])

    def oracle(self, hand):
        values = self.values
        shop.empty_cart(hand)
        goods = ((values.p0, values.n0), (values.p1, values.n1))
        for shelf, (name, count) in zip(values.shelves, goods, strict=True):
            browser.follow(hand, shelf, shelf)
            shop.open_product(hand, name)
            shop.add(hand, count)
        shop.check_out(hand, values.person, delivery=values.delivery, payment=values.payment)

    def plan(self):
        values = self.values
        steps = ['window "Chromium"']
        for ident, count in values.lines.items():
            steps += plan_steps.put_into_cart(shop.product(ident), count)
        return [
            *steps,
            *plan_steps.check_out(values.person, delivery=values.delivery, payment=values.payment),
        ]

    def wrong_results(self):
        values = self.values
        options = {"delivery": values.delivery, "payment": values.payment}
        fewer = {**values.lines, next(iter(values.lines)): 1}
        elsewhere = {**values.person, "street": "Quay Row 12"}
        return {
            "another quantity": lambda m: shop.order(m, fewer, values.person, **options),
            "another street": lambda m: shop.order(m, values.lines, elsewhere, **options),
            "only in the cart": lambda m: shop.fill(m, values.lines),
            "picked up": lambda m: shop.order(
                m, values.lines, values.person, delivery="pickup", payment=values.payment
            ),
            "as a present": lambda m: shop.order(
                m, values.lines, values.person, gift=True, **options
            ),
        }

    def right_result(self, machine):
        values = self.values
        lines = dict(reversed(values.lines.items()))
        options = {"delivery": values.delivery, "payment": values.payment}
        person = {**values.person, "city": values.person["city"].upper()}
        shop.order(machine, lines, person, **options)
