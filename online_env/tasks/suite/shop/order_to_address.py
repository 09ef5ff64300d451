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
            "shelves": [shop.categories()[known.category] for known in (first, second)],
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
        drawn = self.values
        order = {"lines": drawn.lines, "delivery": drawn.delivery, "payment": drawn.payment}
        yield from shop.problems(machine, cart={}, orders=[{**drawn.person, **order}])

    def oracle(self, hand):
        drawn = self.values
        shop.empty_cart(hand)
        goods = ((drawn.p0, drawn.n0), (drawn.p1, drawn.n1))
        for shelf, (name, count) in zip(drawn.shelves, goods, strict=True):
            browser.follow(hand, shelf, shelf)
            shop.open_product(hand, name)
            shop.add(hand, count)
        shop.check_out(hand, drawn.person, delivery=drawn.delivery, payment=drawn.payment)

    def plan(self):
        drawn = self.values
        steps = ['window "Chromium"']
        for ident, count in drawn.lines.items():
            steps += plan_steps.put_into_cart(shop.product(ident), count)
        return [
            *steps,
            *plan_steps.check_out(drawn.person, delivery=drawn.delivery, payment=drawn.payment),
        ]

    def wrong_results(self):
        drawn = self.values
        how = {"delivery": drawn.delivery, "payment": drawn.payment}
        fewer = {**drawn.lines, next(iter(drawn.lines)): 1}
        elsewhere = {**drawn.person, "street": "Quay Row 12"}
        return {
            "another quantity": lambda m: shop.order(m, fewer, drawn.person, **how),
            "another street": lambda m: shop.order(m, drawn.lines, elsewhere, **how),
            "only in the cart": lambda m: shop.fill(m, drawn.lines),
            "picked up": lambda m: shop.order(
                m, drawn.lines, drawn.person, delivery="pickup", payment=drawn.payment
            ),
            "as a present": lambda m: shop.order(m, drawn.lines, drawn.person, gift=True, **how),
        }

    def right_result(self, machine):
        drawn = self.values
        lines = dict(reversed(drawn.lines.items()))
        how = {"delivery": drawn.delivery, "payment": drawn.payment}
        person = {**drawn.person, "city": drawn.person["city"].upper()}
        shop.order(machine, lines, person, **how)
