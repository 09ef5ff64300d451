"""Delete the old issues of a newsletter, and keep the newest."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import CITIES, sample
from online_env.tasks.plan_words import quoted

NAMES = ("The {city} Gardener", "Sails of {city}", "{city} by Train", "Cooking in {city}")


class DeleteNewsletter(mail.MailTask):
    """Four issues, of which the three older ones go to the trash; another letter stays."""

    name = "delete_newsletter"
    phrasings = (
        'Delete the newsletter "{title}" from my inbox at mail.test, but keep the newest issue.',
        "I only need the latest {title}. Please put the older issues of it into the trash.",
        "mail.test inbox: trash every issue of {title} except the most recent one.",
    )

    def draw(self, stream):
        first, second = sample(stream, NAMES, 2)
        cities = sample(stream, CITIES, 2)
        titles = [first.format(city=cities[0]), second.format(city=cities[1])]
        number = stream.integer(30, 200)
        days = sample(stream, range(10, 27), 6)
        mails = []
        for index, day in enumerate(sorted(days)):
            title = titles[index in (1, 3)]
            sender = (title, f"letter{index in (1, 3):d}@news.test")
            subject = f"{title}, no. {number + index}"
            body = f"Dear reader,\n\nthis is issue {number + index}.\n\nThe editors"
            mails.append(mail.message(f"r{index}", sender, subject, body, f"2026-02-{day}T07:00"))
        return {
            "mails": mails,
            "title": titles[0],
            "subjects": [mails[index]["subject"] for index in (0, 2, 4)],
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        flags = {ident: {"folder": "trash"} for ident in ("r0", "r2", "r4")}
        yield from mail.problems(machine, flags=flags)

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        for subject in self.values.subjects:
            if mail.lists(hand, self.values.title, subject):
                mail.open_mail(hand, self.values.title, subject)
                browser.push(hand, "Delete", "Inbox")

    def plan(self):
        steps = ['window "Chromium"']
        for subject in self.values.subjects:
            number = subject.rpartition(" ")[2]
            steps += [
                *plan_steps.search_mail(subject),
                f"click {quoted(f'this is issue {number}')}",
                'click "Delete" near "Back"',
                "wait",
            ]
        return steps

    def wrong_results(self):
        return {
            "the newest as well": lambda m: mail.flag(m, "r0", "r2", "r4", "r5", folder="trash"),
            "one too few": lambda m: mail.flag(m, "r0", "r2", folder="trash"),
            "the oldest was kept": lambda m: mail.flag(m, "r2", "r4", "r5", folder="trash"),
            "archived": lambda m: mail.flag(m, "r0", "r2", "r4", folder="archive"),
            "another newsletter": lambda m: mail.flag(
                m, "r0", "r1", "r2", "r3", "r4", folder="trash"
            ),
        }

    def right_result(self, machine):
        mail.flag(machine, "r4", "r2", "r0", folder="trash", read=True)
