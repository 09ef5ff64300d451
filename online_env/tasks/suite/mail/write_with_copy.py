"""Write to somebody, with copies to two others."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import MONTHS, TOPICS, sample

PEOPLE = {
    "Maren": "maren@mail.test",
    "Tomas": "tomas@mail.test",
    "Oda": "oda@mail.test",
    "Piet": "piet@mail.test",
    "Ilse": "ilse@mail.test",
    "Jun": "jun@mail.test",
}


class WriteWithCopy(mail.MailTask):
    """One recipient, two in Cc, a subject and a text."""

    name = "write_with_copy"
    phrasings = (
        'Send a mail to {a} ({to}), copies to {b} ({cc0}) and {c} ({cc1}). Subject: "{subject}".'
        " Text: {text}",
        'Please write to {to} with {cc0} and {cc1} in Cc. The subject is "{subject}", and the mail'
        ' says: "{text}"',
        'mail.test: new mail, to {to}, cc {cc0} and {cc1}, subject "{subject}", text "{text}"',
    )

    def draw(self, stream):
        people = sample(stream, list(PEOPLE), 3)
        addresses = [PEOPLE[name] for name in people]
        topic, month = stream.choice(TOPICS), stream.choice(MONTHS)
        day = stream.integer(2, 28)
        return {
            "a": people[0],
            "b": people[1],
            "c": people[2],
            "to": addresses[0],
            "cc0": addresses[1],
            "cc1": addresses[2],
            "subject": f"{topic.capitalize()} for {month}",
            "text": f"The {topic} is due on {day} {month}. Who can bring it?",
        }

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        letter = mail.Letter(
            to=[drawn.to], cc=[drawn.cc0, drawn.cc1], subject=drawn.subject, text=drawn.text
        )
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        drawn = self.values
        browser.begin(hand, mail.INBOX, "Inbox")
        browser.follow(hand, "Compose")
        copies = f"{drawn.cc0}, {drawn.cc1}"
        mail.compose(hand, to=drawn.to, cc=copies, subject=drawn.subject, text=drawn.text)
        mail.send(hand)

    def plan(self):
        drawn = self.values
        return [
            'window "Chromium"',
            'click "Compose"',
            *plan_steps.compose(
                to=drawn.to, cc=f"{drawn.cc0}, {drawn.cc1}", subject=drawn.subject, text=drawn.text
            ),
            *plan_steps.SEND,
        ]

    def wrong_results(self):
        d = self.values
        everybody = [d.to, d.cc0, d.cc1]
        return {
            "all as recipients": lambda m: mail.store(m, everybody, d.subject, d.text),
            "one copy": lambda m: mail.store(m, [d.to], d.subject, d.text, cc=[d.cc0]),
            "no subject": lambda m: mail.store(m, [d.to], "", d.text, cc=[d.cc0, d.cc1]),
            "one mail each": lambda m: [
                mail.store(m, [who], d.subject, d.text) for who in everybody
            ],
        }

    def right_result(self, machine):
        d = self.values
        mail.store(machine, [d.to], d.subject.upper(), d.text + "\n", cc=[d.cc1, d.cc0])
