"""Write the prices of a mail and their sum into a text file."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import browser, mail, notes, plan_steps
from online_env.tasks.kit.word_lists import FIRST_NAMES, GOODS, TOPICS, sample
from online_env.tasks.plan_words import quoted


class SumMailedPrices(Task):
    """Three to five things with prices; a line for each in a new file, and the sum below."""

    name = "sum_mailed_prices"
    domain = "workflows"
    apps = ("chrome", "mousepad")
    sites = ("mail",)
    unsolvable = {"network_error": "the mailbox cannot be reached"}
    phrasings = (
        "{who} has sent me prices by mail (mail.test). Put them into a text file {file} in my"
        " Documents: one line for each thing with its name and price, and in the last line"
        " the word Total and the sum.",
        "Please make the file Documents/{file} from {who}'s mail about prices: a line an item (name"
        ' and price), then one last line "Total" with the sum of all prices.',
        "List what {who} offers in the mail, one item and its price a line, in Documents/{file},"
        " and finish with a line that says Total and what it all comes to.",
    )

    def draw(self, stream):
        sender = stream.choice(FIRST_NAMES)
        goods = sample(stream, GOODS, stream.integer(3, 5))
        cents = [stream.integer(150, 9999) for _ in goods]
        listed = [f"{item}: ${c / 100:.2f}" for item, c in zip(goods, cents, strict=True)]
        body = "Hello Robin,\n\nhere is what you asked for:\n\n  {}\n\n{}"
        return {
            "who": sender,
            "file": f"{stream.choice(TOPICS)}-{stream.integer(10, 99)}.txt",
            "listed": listed,
            "prices": dict(zip(goods, (f"{c / 100:.2f}" for c in cents), strict=True)),
            "total": f"{sum(cents) / 100:.2f}",
            "body": body.format("\n  ".join(listed), sender),
        }

    def prepare(self, machine):
        sender = (self.values.who, "stall@mail.test")
        new = mail.message("r1", sender, "Prices", self.values.body, "2026-03-04T08:05")
        mail.receive(machine, new)

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    @property
    def path(self):
        """Where the list goes."""
        return f"Documents/{self.values.file}"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.path)
        yield from mail.problems(machine)
        text = (machine.text(self.path) or "").lower()
        lines = [line for line in text.splitlines() if line.strip()]
        expected = [*self.values.prices.items(), ("total", self.values.total)]
        if len(lines) != len(expected):
            yield f"{self.path} has {len(lines)} lines, not {len(expected)}"
            return
        for name, price in expected:
            if not any(is_line(line, name, price) for line in lines):
                yield f"no line of {self.path} has {name} and {price}, and nothing else"
        if not is_line(lines[-1], "total", self.values.total):
            yield "the total is not in the last line"

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, self.values.who, "Prices")
        notes.take_note(hand, self.path, self.text(self.values.total))

    def text(self, total):
        """The file with a total."""
        return "\n".join([*self.values.listed, f"Total: ${total}"])

    def plan(self):
        return [
            'window "Chromium"',
            f"click {quoted(self.values.who)}",
            f"wait for {quoted(self.values.listed[0])}",
            *plan_steps.take_note(self.path, self.text(self.values.total)),
        ]

    def wrong_results(self):
        total = self.values.total
        listed = self.values.listed
        return {
            "another sum": lambda m: m.write(self.path, self.text("1.00")),
            "no sum": lambda m: m.write(self.path, "\n".join(listed)),
            "only the sum": lambda m: m.write(self.path, f"Total: ${total}"),
            "denied": lambda m: m.write(
                self.path, self.text(total).replace("Total", "Not the total")
            ),
            "things for nothing": lambda m: m.write(
                self.path, "\n".join([*(f"no {line}" for line in listed), f"Total: ${total}"])
            ),
            "in the home folder": lambda m: m.write(self.values.file, self.text(total)),
            "the sum first": lambda m: m.write(self.path, f"Total {total}\n" + "\n".join(listed)),
        }

    def right_result(self, machine):
        rows = [f"{item.upper()}\t{price}" for item, price in self.values.prices.items()]
        rows.reverse()
        machine.write(self.path, "\n".join([*rows, "", f"total = {self.values.total} $"]) + "\n")


def is_line(line, name, price):
    """Return whether a line has a name and a price, and nothing more but marks or the currency."""
    amount = re.escape(price).replace(r"\.", "[.,]") + ("?" if price.endswith("0") else "")
    between = r"[\s:;,.=|$-]*((costs?|is|at|for)\s)?[\s$]*"
    words = " ".join(line.split()).lstrip("-*\u2022 ")
    pattern = rf"{re.escape(name)}{between}{amount}\s*(\$|usd|dollars?)?\s*[.,;|]?"
    return re.fullmatch(pattern, words) is not None
