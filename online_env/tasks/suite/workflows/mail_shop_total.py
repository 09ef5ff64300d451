"""Look up two prices in the shop, and mail what it comes to."""

from online_env.tasks import Task
from online_env.tasks.kit import browser, mail, plan_steps, shop
from online_env.tasks.kit.word_lists import FIRST_NAMES


class MailShopTotal(Task):
    """A mail asks what some products cost together; the answer is worked out from shop.test."""

    name = "mail_shop_total"
    domain = "workflows"
    apps = ("chrome",)
    sites = ("mail",)
    unsolvable = {"network_error": "neither site can be reached"}
    phrasings = (
        "{who} asks by mail what some things from shop.test would cost. Look the prices up, and"
        " reply with the total for all of them, without delivery, and nothing else.",
        "Please answer {who}'s mail at mail.test: work out the total from the prices at shop.test"
        " (no delivery) and send just that as a reply. Don't put anything into the"
        " cart.",
        "Reply to {who} with what the things in the mail cost altogether at shop.test, delivery not"
        " counted; write only the sum.",
    )

    def draw(self, stream):
        first, second = shop.goods(stream, 2)
        counts = [stream.integer(2, 3), stream.integer(1, 3)]
        who = stream.choice(FIRST_NAMES)
        total = first.cents * counts[0] + second.cents * counts[1]
        return {
            "who": who,
            "names": [first.name, second.name],
            "total": f"{total / 100:.2f}",
            "single": f"{(first.cents + second.cents) / 100:.2f}",
            "body": f"Hi Robin,\n\nwhat would {counts[0]} x {first.name} and {counts[1]} x"
            f" {second.name} cost at shop.test, all together?\n\n{who}",
        }

    def prepare(self, machine):
        sender = (self.values.who, "asker@mail.test")
        new = mail.message("r1", sender, "What does it cost?", self.values.body, "2026-03-04T07:40")
        mail.receive(machine, new)

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    def problems(self, machine):
        yield from machine.unexpected_changes()
        letter = mail.Letter(
            to=["asker@mail.test"],
            subject="Re: What does it cost?",
            answer=mail.MailAnswer(value=float(self.values.total), about="altogether in all"),
        )
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, self.values.who, "What does it cost?")
        browser.visit(hand, shop.HOME, "Things that last.", in_new_tab=True)
        for name in self.values.names:
            shop.search(hand, name)
            hand.find("link", shop.card(name), app=browser.APP)
        hand.press("ctrl", "w")
        browser.follow(hand, "Reply")
        mail.compose(hand, text=f"That would be ${self.values.total}.")
        mail.send(hand)

    def plan(self):
        return [
            'window "Chromium"',
            'click "What does it cost?"',
            'click "Reply"',
            *plan_steps.compose(text=f"That would be ${self.values.total}."),
            *plan_steps.SEND,
        ]

    def wrong_results(self):
        to, subject = ["asker@mail.test"], "Re: What does it cost?"
        total = f"It is ${self.values.total}."
        return {
            "one of each": lambda m: mail.store(m, to, subject, f"It is ${self.values.single}."),
            "to somebody else": lambda m: mail.store(m, ["oda@mail.test"], subject, total),
            "denied": lambda m: mail.store(m, to, subject, f"It is not ${self.values.total}."),
            "both sums": lambda m: mail.store(
                m, to, subject, f"${self.values.single} or ${self.values.total}"
            ),
            "only a draft": lambda m: mail.store(m, to, subject, total, folder="drafts"),
            "into the cart as well": lambda m: [
                mail.store(m, to, subject, total),
                shop.fill(m, {"mug": 1}),
            ],
        }

    def right_result(self, machine):
        shop.fill(machine, {})  # what was put into it is out again
        total = self.values.total.removesuffix("0").replace(".", ",")
        body = f"Hello,\n{total} dollars altogether.\n\n> Hi Robin"
        mail.store(machine, ["asker@mail.test"], "Re: What does it cost?", body)
