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
        sender = stream.choice(FIRST_NAMES)
        question, title, fact = stream.choice(FACTS)
        body = f"Dear Robin,\n\nat the quiz somebody asked {question}. Do you know?\n\n{sender}"
        other_facts = [other_fact for _, _, other_fact in FACTS if other_fact != fact]
        return {
            "who": sender,
            "title": title,
            "fact": fact,
            "body": body,
            "subject": f"Quiz question {stream.integer(2, 30)}",
            "other": stream.choice(other_facts),
        }

    def prepare(self, machine):
        sender = (self.values.who, "quiz@mail.test")
        body, subject = self.values.body, self.values.subject
        mail.receive(machine, mail.message("r1", sender, subject, body, "2026-03-04T10:20"))

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    def problems(self, machine):
        yield from machine.unexpected_changes()
        values = self.values
        answer = mail.MailAnswer(
            value=values.fact,
            about=f"{values.body} {sentences_with_fact(values.title, values.fact)}",
        )
        letter = mail.Letter(to=["quiz@mail.test"], subject=f"Re: {values.subject}", answer=answer)
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        values = self.values
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, values.who, values.subject)
        page = values.title.replace(" ", "_")
        browser.visit(hand, f"http://wiki.test/wiki/{page}", values.title)
        browser.visit(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, values.who, values.subject)
        browser.follow(hand, "Reply")
        mail.compose(hand, text=f"Yes: {values.fact}.")
        mail.send(hand)

    def plan(self):
        values = self.values
        return [
            'window "Chromium"',
            *plan_steps.visit(
                f"http://wiki.test/wiki/{values.title.replace(' ', '_')}", values.title
            ),
            *plan_steps.visit(mail.INBOX, values.subject),
            f"click {quoted(values.subject)}",
            'click "Reply"',
            *plan_steps.compose(text=f"Yes: {values.fact}."),
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
        sentence = sentences_with_fact(self.values.title, self.values.fact)
        body = f"Dear {self.values.who},\n{sentence.upper()}\nBest regards,\nRobin\n> Dear Robin"
        mail.store(machine, ["quiz@mail.test"], f"Re: {self.values.subject}", body)


def sentences_with_fact(title, fact):
    """Return what an article says of a fact, the first sentence or line that has it."""
    article = articles("wiki")[title.replace(" ", "_")]
    facts = (f"{key}: {value}." for key, value in article.head["facts"].items())
    sentences = [*re.split(r"(?<=[.!])\s", plain(article.body)), *facts]
    return next(sentence for sentence in sentences if fact in sentence)


def edit(machine, title):
    """Change an article, as the site does."""
    with machine.sites.update("wiki") as state:
        state["pages"] = {title: {"text": "Quiz", "revisions": []}}
