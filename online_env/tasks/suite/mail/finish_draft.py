"""Complete a draft, and send it."""

import re

from online_env.tasks.kit import browser, mail
from online_env.tasks.kit.word_lists import CITIES, MONTHS, TOPICS, sample
from online_env.tasks.plan_words import quoted

PEOPLE = ("ilse@mail.test", "piet@mail.test", "jun@mail.test", "adaeze@mail.test")
LAST_LINES = (
    "Please answer by {day} {month}.",
    "I can be there on {day} {month}.",
    "Shall we say {day} {month}?",
)


class FinishDraft(mail.MailTask):
    """Two drafts, of which one gets a recipient and a last line, and is sent."""

    name = "finish_draft"
    phrasings = (
        'Among my drafts at mail.test is one called "{subject}". Add the line "{line}" at its end,'
        " and send it to {to}.",
        "Please finish the draft {subject}: its last line should be: {line} Then send it to {to}."
        " The other draft stays a draft.",
        'mail.test, drafts, "{subject}": append the line "{line}", recipient {to}, send.',
    )

    def draw(self, stream):
        topics = sample(stream, TOPICS, 2)
        city = stream.choice(CITIES)
        subjects = [f"{topic.capitalize()} from {city}" for topic in topics]
        line = stream.choice(LAST_LINES)
        return {
            "subjects": subjects,
            "subject": subjects[0],
            "texts": [f"Hello,\n\nthe {topic} from {city} is ready." for topic in topics],
            "line": line.format(day=stream.integer(2, 28), month=stream.choice(MONTHS)),
            "to": stream.choice(PEOPLE),
            "first": stream.integer(0, 1),
        }

    def prepare(self, machine):
        drafts = list(zip(self.values.subjects, self.values.texts, strict=True))
        for subject, text in drafts if self.values.first else reversed(drafts):
            mail.store(machine, [], subject, text, folder="drafts")

    @property
    def ident(self):
        """The id of the draft that is sent."""
        return "s01" if self.values.first else "s02"

    @property
    def full_text(self):
        """The text of the mail."""
        return f"{self.values.texts[0]}\n{self.values.line}"

    def problems(self, machine):
        yield from machine.unexpected_changes()
        letter = mail.Letter(
            to=[self.values.to],
            subject=self.values.subject,
            text=self.full_text,
            last=self.values.line,
        )
        yield from mail.problems(machine, sent=[letter], finished=[self.ident])

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        browser.follow(hand, browser.starting("Drafts"), "Drafts")
        # a draft that was saved on the way has its recipient there
        browser.follow(hand, re.compile(rf"To: *\S* *{self.values.subject}"), "New message")
        mail.compose(hand, to=self.values.to)
        hand.replace(self.full_text)
        mail.send(hand)

    def plan(self):
        return [
            'window "Chromium"',
            'click "Drafts"',
            f"click {quoted(self.values.subject)}",
            'wait for "New message"',
            'click "To"',
            f"type {quoted(self.values.to)}",
            "press tab 3 times",
            "press ctrl+end",
            f"type {quoted(chr(10) + self.values.line)}",
            'click "Send"',
            f"wait for {quoted(self.values.subject)}",
        ]

    def finish(self, machine, to, text):
        """Send the draft, as the site does."""
        with machine.sites.update("mail") as state:
            state["drafts"] = [draft for draft in state["drafts"] if draft["id"] != self.ident]
        mail.store(machine, [to], self.values.subject, text)

    def wrong_results(self):
        to, subject, texts = self.values.to, self.values.subject, self.values.texts
        return {
            "without the line": lambda m: self.finish(m, to, texts[0]),
            "in the line before": lambda m: self.finish(m, to, f"{texts[0]} {self.values.line}"),
            "to somebody else": lambda m: self.finish(m, "oda@mail.test", self.full_text),
            "the other text": lambda m: self.finish(m, to, f"{texts[1]}\n{self.values.line}"),
            "the draft is left": lambda m: mail.store(m, [to], subject, self.full_text),
            "not sent": lambda m: mail.store(m, [to], subject, self.full_text, folder="drafts"),
        }

    def right_result(self, machine):
        self.finish(machine, self.values.to, f"{self.values.texts[0]}\n\n{self.values.line}\n")
