"""Answer a question with a fact that stands in another mail."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import FIRST_NAMES, sample
from online_env.tasks.plan_words import quoted

QUESTIONS = (
    ("the code of the bicycle shed", "The code of the bicycle shed", 4000, 9999),
    ("the room for the rehearsal", "The room for the rehearsal", 100, 499),
    ("Piet's telephone extension", "The extension of Piet", 200, 899),
    ("the locker at the swimming club", "Our locker at the swimming club", 10, 99),
    ("the number of the parcel", "The number of the parcel", 10000, 99999),
)


class AnswerFromMail(mail.MailTask):
    """The fact has changed since an older mail; the newer one counts, and stands in the archive."""

    name = "answer_from_mail"
    phrasings = (
        "{asker} asks in a mail for {thing}. Look for the number in my other mails, the latest"
        " one counts, and reply with it and nothing else.",
        "Please answer {asker}'s mail at mail.test. What they want to know, {thing}, is in my"
        " archive; it has changed, so take the newest. Write just the number.",
        "Reply to {asker} with {thing}. You'll find it in my mail (mind the date: only the most"
        " recent one is right). Nothing else should be in the reply.",
    )

    def draw(self, stream):
        asker, teller, third = sample(stream, FIRST_NAMES, 3)
        topic, subject, low, high = stream.choice(QUESTIONS)
        old, new = sample(stream, range(low, high), 2)
        day = stream.integer(12, 20)
        mails_with_facts = (
            (third, old, f"2026-02-{day}T10:05"),
            (teller, new, f"2026-02-{day + 4}T16:20"),
        )
        mails = [
            mail.message(
                f"r{index}",
                (name, f"house{index}@mail.test"),
                subject,
                f"Dear all,\n\nfrom now on it is {number}.\n\n{name}",
                date,
                read=True,
                folder="archive",
            )
            for index, (name, number, date) in enumerate(mails_with_facts)
        ]
        question = f"Hello Robin,\n\ncould you tell me {topic}? I have lost it.\n\n{asker}"
        sender = (asker, "asker@mail.test")
        question_mail = mail.message("q", sender, "A question", question, "2026-03-04T08:50")
        return {
            "mails": [*mails, question_mail],
            "asker": asker,
            "question": question,
            "teller": teller,
            "thing": topic,
            "subject": subject,
            "old": str(old),
            "new": str(new),
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        values = self.values
        letter = mail.Letter(
            to=["asker@mail.test"],
            subject="Re: A question",
            answer=mail.MailAnswer(value=values.new, about=f"{values.question} {values.subject}"),
        )
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.search(hand, self.values.subject)
        mail.open_mail(hand, self.values.teller, self.values.subject)
        browser.follow(hand, browser.starting("Inbox"), "Inbox")
        mail.open_mail(hand, self.values.asker, "A question")
        browser.follow(hand, "Reply")
        mail.compose(hand, text=f"It is {self.values.new}. Robin")
        mail.send(hand)

    def plan(self):
        values = self.values
        return [
            'window "Chromium"',
            *plan_steps.search_mail(values.subject),
            f"click {quoted(values.teller)} near {quoted(values.subject)}",
            f"wait for {quoted(f'it is {values.new}')}",
            'click "Inbox"',
            'click "A question"',
            'click "Reply"',
            *plan_steps.compose(text=f"It is {values.new}. Robin"),
            *plan_steps.SEND,
        ]

    def wrong_results(self):
        to, subject, old, new = (
            ["asker@mail.test"],
            "Re: A question",
            self.values.old,
            self.values.new,
        )
        return {
            "the old number": lambda m: mail.store(m, to, subject, f"It is {old}."),
            "both numbers": lambda m: mail.store(m, to, subject, f"It is {old} or {new}."),
            "denied": lambda m: mail.store(m, to, subject, f"It is not {new}."),
            "denied afterwards": lambda m: mail.store(m, to, subject, f"{new}. Or was it another?"),
            "with other numbers": lambda m: mail.store(m, to, subject, f"{new}, 17 or 12345."),
            "within the question": lambda m: mail.store(
                m, to, subject, f"> could you {new} tell me"
            ),
            "to who told it": lambda m: mail.store(m, ["house1@mail.test"], subject, new),
            "only a draft": lambda m: mail.store(m, to, subject, new, folder="drafts"),
        }

    def right_result(self, machine):
        body = (
            f"Dear {self.values.asker},\n{self.values.thing} is {self.values.new}.\n\n> Hello Robin"
        )
        mail.store(machine, ["asker@mail.test"], "RE: A question", body)
