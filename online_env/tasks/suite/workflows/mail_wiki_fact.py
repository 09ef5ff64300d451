"""Answer a question in a mail with a fact from the encyclopedia."""

import re

from online_env.embedded.sites.library import articles, plain
from online_env.tasks import Task
from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import FIRST_NAMES
from online_env.tasks.plan_words import quoted

FACTS = (
    ("in which town the printing press was invented", "Printing press", "Mainz"),
    ("what the tea plant is called in Latin", "Tea", "Camellia sinensis"),
    ("which family the honey bee belongs to", "Honey bee", "Apidae"),
    ("which coral reef is the largest", "Coral reef", "Great Barrier Reef"),
    ("who had the first patent for a telescope", "Telescope", "Lippershey"),
    ("where the tides are highest", "Tide", "Bay of Fundy"),
    ("where the first known lighthouse stood", "Lighthouse", "Alexandria"),
    ("in which year the safety bicycle came", "Bicycle", "1885"),
    ("where sourdough was used first", "Sourdough", "Egypt"),
    ("which country chess comes from", "Chess", "India"),
)


class MailWikiFact(Task):
    """A friend asks something; wiki.test knows it."""

    name = "mail_wiki_fact"
    domain = "workflows"
    apps = ("chrome",)
    sites = ("mail",)
    unsolvable = {"network_error": "neither site can be reached"}
    phrasings = (
        "{who} wants to know something, see the mail at mail.test. Look it up at wiki.test, and"
        " reply with the answer, and nothing else.",
        "Please answer the question in {who}'s mail (mail.test). The encyclopedia at wiki.test"
        " should know. Write just the answer.",
        "Find the answer to {who}'s mail in the article {title} at wiki.test, and send it as a"
        " reply, with nothing more in it.",
    )

    def draw(self, stream):
        who = stream.choice(FIRST_NAMES)
        question, title, fact = stream.choice(FACTS)
        body = f"Dear Robin,\n\nat the quiz somebody asked {question}. Do you know?\n\n{who}"
        others = [other for _, _, other in FACTS if other != fact]
        return {
            "who": who,
            "title": title,
            "fact": fact,
            "body": body,
            "subject": f"Quiz question {stream.integer(2, 30)}",
            "other": stream.choice(others),
        }

    def prepare(self, machine):
        sender = (self.values.who, "quiz@mail.test")
        body, subject = self.values.body, self.values.subject
        mail.receive(machine, mail.message("r1", sender, subject, body, "2026-03-04T10:20"))

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        answer = mail.MailAnswer(
            value=drawn.fact, about=f"{drawn.body} {told_by(drawn.title, drawn.fact)}"
        )
        letter = mail.Letter(to=["quiz@mail.test"], subject=f"Re: {drawn.subject}", answer=answer)
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        drawn = self.values
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, drawn.who, drawn.subject)
        page = drawn.title.replace(" ", "_")
        browser.visit(hand, f"http://wiki.test/wiki/{page}", drawn.title)
        browser.visit(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, drawn.who, drawn.subject)
        browser.follow(hand, "Reply")
        mail.compose(hand, text=f"Yes: {drawn.fact}.")
        mail.send(hand)

    def plan(self):
        drawn = self.values
        return [
            'window "Chromium"',
            *plan_steps.visit(
                f"http://wiki.test/wiki/{drawn.title.replace(' ', '_')}", drawn.title
            ),
            *plan_steps.visit(mail.INBOX, drawn.subject),
            f"click {quoted(drawn.subject)}",
            'click "Reply"',
            *plan_steps.compose(text=f"Yes: {drawn.fact}."),
            *plan_steps.SEND,
        ]

    def wrong_results(self):
        to, subject, fact = ["quiz@mail.test"], f"Re: {self.values.subject}", self.values.fact
        return {
            "another answer": lambda m: mail.store(m, to, subject, self.values.other),
            "denied": lambda m: mail.store(m, to, subject, f"It is certainly not {fact}."),
            "denied afterwards": lambda m: mail.store(m, to, subject, f"{fact}. That is wrong."),
            "asked back": lambda m: mail.store(m, to, subject, f"Is it {fact}?"),
            "all answers": lambda m: mail.store(
                m, to, subject, "\n".join(answer for _, _, answer in FACTS)
            ),
            "to somebody else": lambda m: mail.store(m, ["oda@mail.test"], subject, fact),
            "only a draft": lambda m: mail.store(m, to, subject, fact, folder="drafts"),
            "the article was changed": lambda m: [
                mail.store(m, to, subject, fact),
                edit(m, self.values.title),
            ],
        }

    def right_result(self, machine):
        said = told_by(self.values.title, self.values.fact)
        body = f"Dear {self.values.who},\n{said.upper()}\nBest regards,\nRobin\n> Dear Robin"
        mail.store(machine, ["quiz@mail.test"], f"Re: {self.values.subject}", body)


def told_by(title, fact):
    """Return what an article says of a fact, the first sentence or line that has it."""
    article = articles("wiki")[title.replace(" ", "_")]
    facts = (f"{key}: {value}." for key, value in article.head["facts"].items())
    said = [*re.split(r"(?<=[.!])\s", plain(article.body)), *facts]
    return next(sentence for sentence in said if fact in sentence)


def edit(machine, title):
    """Change an article, as the site does."""
    with machine.sites.update("wiki") as state:
        state["pages"] = {title: {"text": "Quiz", "revisions": []}}
