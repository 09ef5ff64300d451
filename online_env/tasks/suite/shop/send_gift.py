"""Send a wrapped present with a card."""

from online_env.tasks.kit import browser, plan_steps, shop

CARDS = (
    "Happy birthday, {first}! See you in {month}.",
    "Congratulations on the new flat, {first}. Your neighbours from number {number}",
    "For {number} years of patience: thank you! R.",
    "Get well soon, {first}. We all miss you in {month}.",
)
MONTHS = ("April", "May", "June", "July")


class SendGift(shop.ShopTask):
    """One product, wrapped, with a message, to somebody's address by express."""

    name = "send_gift"
    phrasings = (
        'Send "{product}" from shop.test as a present to {address} (e-mail {email}). Have it'
        ' wrapped, with this message on the card: "{card}" Express delivery; I pay by invoice.',
        "Please order one {product} at shop.test as a gift for {address}, e-mail {email}. It should"
        " be wrapped, come by express, and be paid by invoice. The card says: {card}",
        "Gift order at shop.test, wrapped: 1 x {product}. To: {address}, {email}. Express, invoice."
        " Message on the card: {card}",
    )

    def draw(self, stream):
        product = shop.goods(stream, 1)[0]
        person = shop.recipient(stream)
        card = stream.choice(CARDS).format(
            first=person["name"].split()[0],
            month=stream.choice(MONTHS),
            number=stream.integer(2, 40),
        )
        return {
            "id": product.id,
            "product": product.name,
            "label": shop.categories()[product.category],
            "person": person,
            "address": shop.address_line(person),
            "email": person["email"],
            "card": card,
        }

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        how = {"delivery": "express", "payment": "invoice", "gift": True, "message": drawn.card}
        wanted = {"lines": {drawn.id: 1}, **drawn.person, **how}
        yield from shop.problems(machine, cart={}, orders=[wanted])

    def oracle(self, hand):
        drawn = self.values
        shop.empty_cart(hand)
        browser.follow(hand, drawn.label, drawn.label)
        shop.open_product(hand, drawn.product)
        shop.add(hand)
        shop.check_out(hand, drawn.person, delivery="express", message=drawn.card)

    def order(self, machine, **changed):
        """Store the order, with changes."""
        how = {"delivery": "express", "gift": True, "message": self.values.card, **changed}
        shop.order(machine, {self.values.id: how.pop("count", 1)}, self.values.person, **how)

    def plan(self):
        drawn = self.values
        return [
            'window "Chromium"',
            *plan_steps.put_into_cart(shop.product(drawn.id), 1),
            *plan_steps.check_out(drawn.person, delivery="express", message=drawn.card),
        ]

    def wrong_results(self):
        return {
            "not wrapped": lambda m: self.order(m, gift=False),
            "no message": lambda m: self.order(m, message=""),
            "by standard delivery": lambda m: self.order(m, delivery="standard"),
            "two pieces": lambda m: self.order(m, count=2),
            "only in the cart": lambda m: shop.fill(m, {self.values.id: 1}),
        }

    def right_result(self, machine):
        self.order(machine, message=self.values.card + "\n")
