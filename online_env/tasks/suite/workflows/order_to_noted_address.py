"""Order the cart to an address that stands in a text file."""

from online_env.tasks import Task
from online_env.tasks.kit import browser, panel, plan_steps, shop
from online_env.tasks.kit.word_lists import TOPICS
from online_env.tasks.plan_words import quoted


class OrderToNotedAddress(Task):
    """Three addresses in a file that is open; the full cart goes to one of them."""

    name = "order_to_noted_address"
    domain = "workflows"
    apps = ("mousepad", "chrome")
    sites = ("shop",)
    unsolvable = {"network_error": "the shop cannot be reached"}
    phrasings = (
        "Order what is in my cart at shop.test for {who}, whose address is in the file that is"
        " open. Delivery: {how}. Payment: {pay}.",
        "The text editor shows some addresses. Please have the things in my cart at shop.test sent"
        ' to {who}: "{how}", "{pay}".',
        "Check out my shop.test cart: to {who} (address in {file}), {how}, {pay}.",
    )

    def draw(self, stream):
        people = [shop.recipient(stream) for _ in range(3)]
        while len({person["name"] for person in people}) < 3:
            people = [shop.recipient(stream) for _ in range(3)]
        person = people[stream.integer(0, 2)]
        delivery = stream.choice(("standard", "express"))
        payment = stream.choice(("invoice", "transfer"))
        return {
            "people": people,
            "person": person,
            "who": person["name"],
            "file": f"Documents/{stream.choice(TOPICS)}-addresses.txt",
            "cart": {p.id: stream.integer(1, 3) for p in shop.goods(stream, 2)},
            "delivery": delivery,
            "payment": payment,
            "how": shop.delivery_label(delivery),
            "pay": shop.payment_label(payment),
        }

    def prepare(self, machine):
        machine.write(self.values.file, "\n\n".join(map(entry, self.values.people)) + "\n")
        shop.fill(machine, self.values.cart)

    def initial_app(self, machine):
        return "mousepad", machine.path(self.values.file)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        how = {"delivery": drawn.delivery, "payment": drawn.payment}
        wanted = {"lines": drawn.cart, **drawn.person, **how}
        yield from shop.problems(machine, cart={}, orders=[wanted])

    def oracle(self, hand):
        drawn = self.values
        panel.bring(hand, "chrom")
        browser.visit(hand, shop.CART, "Your cart")
        shop.check_out(hand, drawn.person, delivery=drawn.delivery, payment=drawn.payment)

    def order(self, machine, person, **changed):
        """Store an order for somebody, with changes."""
        how = {"delivery": self.values.delivery, "payment": self.values.payment, **changed}
        shop.order(machine, how.pop("cart", self.values.cart), person, **how)

    def plan(self):
        drawn = self.values
        return [
            'window "Mousepad"',
            f"wait for {quoted(drawn.who)}",
            "press alt+f2",
            "wait",
            'type "chromium"',
            "press enter",
            'window "Chromium"',
            *plan_steps.visit(shop.CART, "Your cart"),
            *plan_steps.check_out(drawn.person, delivery=drawn.delivery, payment=drawn.payment),
        ]

    def wrong_results(self):
        person = self.values.person
        other = next(p for p in self.values.people if p is not person)
        fewer = dict.fromkeys(self.values.cart, 9)
        return {
            "to another one": lambda m: self.order(m, other),
            "another street": lambda m: self.order(m, {**person, "street": other["name"]}),
            "another quantity": lambda m: self.order(m, person, cart=fewer),
            "picked up": lambda m: self.order(m, person, delivery="pickup"),
            "the file was changed": lambda m: [
                self.order(m, person),
                m.write(self.values.file, entry(person)),
            ],
        }

    def right_result(self, machine):
        self.order(machine, {**self.values.person, "name": self.values.who.upper()})


def entry(person):
    """Return what the file has of somebody."""
    town = f"{person['postcode']} {person['city']}"
    lines = (person["name"], person["street"], town, person["country"], person["email"])
    return "\n".join(lines)
