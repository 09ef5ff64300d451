"""Answer a mail with a sentence that is given."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import FIRST_NAMES, sample
from online_env.tasks.plan_words import quoted

EVENTS = ("Supper", "A walk on the dunes", "Cards", "Rehearsal", "The quiz night", "A film")
DAYS = ("Monday", "Tuesday", "Wednesday", "Friday", "Saturday", "Sunday")
HOURS = ("six", "half past six", "seven", "eight")
ANSWERS = (
    "Gladly! I will be there and bring {thing}.",
    "I would love to, but I am away that day.",
    "Yes, but I may be a little late. Shall I bring {thing}?",
    "Count me in! I will see to {thing}.",
)
THINGS = ("bread", "olives", "lemonade", "a cake", "the big kettle", "cheese")


class AnswerInvitation(mail.MailTask):
    """Three similar invitations; one of them is answered to its sender, with the given text."""

    name = "answer_invitation"
    phrasings = (
        'Reply to the mail from {who} in my mailbox (mail.test, open in the browser): "{answer}"',
        "{who} has invited me by mail. Answer with exactly this and nothing else: {answer}",
        'Please send {who} a reply to the invitation at mail.test. It should say: "{answer}"',
    )

    def draw(self, stream):
        names = sample(stream, FIRST_NAMES, 3)
        events = sample(stream, EVENTS, 3)
        days = sample(stream, DAYS, 3)
        mails = [
            mail.message(
                f"r{number}",
                (name, f"guest{number}@mail.test"),
                f"{event} on {day}?",
                f"Hi Robin,\n\n{event.lower()} at mine on {day} at {stream.choice(HOURS)},"
                f" will you come?\n\n{name}",
                f"2026-03-03T1{number}:{stream.integer(10, 59)}",
            )
            for number, (name, event, day) in enumerate(zip(names, events, days, strict=True))
        ]
        chosen = mails[stream.integer(0, 2)]
        answer = stream.choice(ANSWERS).format(thing=stream.choice(THINGS))
        return {
            "mails": mails,
            "chosen": chosen,
            "who": chosen["from"]["name"],
            "to": chosen["from"]["address"],
            "subject": f"Re: {chosen['subject']}",
            "answer": answer,
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        letter = mail.Letter(to=[drawn.to], subject=drawn.subject, text=drawn.answer)
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, self.values.who, self.values.chosen["subject"])
        browser.follow(hand, "Reply")
        mail.compose(hand, text=self.values.answer)
        mail.send(hand)

    def plan(self):
        return [
            'window "Chromium"',
            f"click {quoted(self.values.chosen['subject'])}",
            'click "Reply"',
            *plan_steps.compose(text=self.values.answer),
            *plan_steps.SEND,
        ]

    def wrong_results(self):
        to, subject, answer = self.values.to, self.values.subject, self.values.answer
        return {
            "another text": lambda m: mail.store(m, [to], subject, "Yes."),
            "to somebody else": lambda m: mail.store(m, ["oda@mail.test"], subject, answer),
            "only a draft": lambda m: mail.store(m, [to], subject, answer, folder="drafts"),
            "a new mail": lambda m: mail.store(m, [to], "Invitation", answer),
            "twice": lambda m: [mail.store(m, [to], subject, answer) for _ in range(2)],
        }

    def right_result(self, machine):
        quoted = "\n".join(f"> {line}" for line in self.values.chosen["body"].splitlines())
        body = f"{self.values.answer}\n\n{quoted}"
        mail.store(machine, [self.values.to.upper()], self.values.subject, body)
