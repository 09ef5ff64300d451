"""Find an old mail by its words, and mark it as unread."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import CITIES, FIRST_NAMES, GOODS, MONTHS, sample
from online_env.tasks.plan_words import quoted


class MarkFoundUnread(mail.MailTask):
    """Six read mails in the archive with the same subject; only the text tells them apart."""

    name = "mark_found_unread"
    phrasings = (
        "Somewhere in my mail (mail.test) somebody wrote about a {thing} from {city}. Find that"
        " mail, and mark it as unread.",
        "Please search my mailbox for the mail that mentions the {thing} from {city} and set it to"
        " unread, so that I see it tomorrow.",
        "Mark the mail about the {thing} from {city} as unread.",
    )

    def draw(self, stream):
        goods = sample(stream, GOODS, 6)
        cities = sample(stream, CITIES, 6)
        names = sample(stream, FIRST_NAMES, 6)
        mails = [
            mail.message(
                f"r{index}",
                (name, f"market{index}@mail.test"),
                "From the market",
                f"Hi Robin,\n\nI have found it in {stream.choice(MONTHS)}: a {item} from {city}."
                f" Do you want it?\n\n{name}",
                f"2026-02-{10 + index}T11:{stream.integer(10, 59)}",
                read=True,
                folder="archive",
            )
            for index, (name, item, city) in enumerate(zip(names, goods, cities, strict=True))
        ]
        index = stream.integer(0, 5)
        return {
            "mails": mails,
            "ident": f"r{index}",
            "other": f"r{(index + 1) % 6}",
            "who": names[index],
            "thing": goods[index],
            "city": cities[index],
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from mail.problems(machine, flags={self.values.ident: {"read": False}})

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.search(hand, f"{self.values.thing} from {self.values.city}")
        mail.open_mail(hand, self.values.who, "From the market")
        browser.push(hand, "Mark as unread", "Inbox")

    def plan(self):
        values = self.values
        return [
            'window "Chromium"',
            *plan_steps.search_mail(f"{values.thing} from {values.city}"),
            f"click {quoted(values.who)}",
            'click "Mark as unread"',
            'wait for "Inbox"',
        ]

    def wrong_results(self):
        ident, other_ident = self.values.ident, self.values.other
        return {
            "another one": lambda m: mail.flag(m, other_ident, read=False),
            "one more": lambda m: mail.flag(m, ident, other_ident, read=False),
            "only read": lambda m: mail.flag(m, ident, read=True),
            "moved to the inbox": lambda m: mail.flag(m, ident, read=False, folder="inbox"),
            "starred": lambda m: mail.flag(m, ident, starred=True),
        }

    def right_result(self, machine):
        mail.flag(machine, self.values.other, read=True)
        mail.flag(machine, self.values.ident, read=False)
