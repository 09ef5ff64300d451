"""Forward a mail with a line of one's own."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import FIRST_NAMES, TOPICS, sample
from online_env.tasks.plan_words import quoted

LINES = (
    "Can you take this over, please?",
    "For your information.",
    "This concerns you more than me.",
    "Could you have a look at it by Friday?",
)
FACTS = (
    "The room is {number} on the second floor.",
    "The code for the door is {number}.",
    "It comes to ${number} in all.",
    "The reference is PA-{number}.",
)
FRIENDS = {"Tomas": "tomas@mail.test", "Oda": "oda@mail.test", "Maren": "maren@mail.test"}


class ForwardMail(mail.MailTask):
    """One of three mails goes on to somebody else, whole, with a given line."""

    name = "forward_mail"
    phrasings = (
        'Forward the mail "{subject}" to {friend} ({to}) and write above it: {line}',
        'Please pass {who}\'s mail about the {topic} on to {to}. Begin with the words "{line}"',
        'mail.test: send {to} the mail "{subject}" as it is, with this on top: {line}',
    )

    def draw(self, stream):
        names = sample(stream, FIRST_NAMES, 3)
        topics = sample(stream, TOPICS, 3)
        mails = []
        for index, (name, topic) in enumerate(zip(names, topics, strict=True)):
            fact = stream.choice(FACTS).format(number=stream.integer(101, 989))
            body = f"Hi Robin,\n\nthis is about the {topic}.\n{fact}\n\n{name}"
            date = f"2026-03-0{index + 1}T{stream.integer(10, 20)}:15"
            sender = (name, f"office{index}@mail.test")
            mails.append(mail.message(f"r{index}", sender, f"The {topic}", body, date))
        chosen = mails[stream.integer(0, 2)]
        friend = stream.choice(list(FRIENDS))
        return {
            "mails": mails,
            "subject": chosen["subject"],
            "chosen": chosen,
            "body": chosen["body"],
            "who": chosen["from"]["name"],
            "topic": chosen["subject"].removeprefix("The "),
            "friend": friend,
            "to": FRIENDS[friend],
            "line": stream.choice(LINES),
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        letter = mail.Letter(to=[drawn.to], text=drawn.line, passes_on=drawn.chosen)
        yield from mail.problems(machine, sent=[letter])

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, self.values.who, self.values.subject)
        browser.follow(hand, "Forward")
        mail.compose(hand, to=self.values.to, text=self.values.line)
        mail.send(hand)

    def plan(self):
        return [
            'window "Chromium"',
            f"click {quoted(self.values.subject)}",
            'click "Forward"',
            *plan_steps.compose(to=self.values.to, text=self.values.line),
            *plan_steps.SEND,
        ]

    def wrong_results(self):
        to, line, body = self.values.to, self.values.line, self.values.body
        whole = f"{line}\n\n{body}"
        other = next(m["body"] for m in self.values.mails if m["body"] != body)
        return {
            "without the line": lambda m: mail.store(m, [to], "Fwd", body),
            "only the line": lambda m: mail.store(m, [to], "Fwd", line),
            "the line below it": lambda m: mail.store(m, [to], "Fwd", f"{body}\n\n{line}"),
            "taken back": lambda m: mail.store(m, [to], "Fwd", f"{line} No, forget it.\n\n{body}"),
            "taken back at the end": lambda m: mail.store(
                m, [to], "Fwd", f"{whole}\n\nNone of this is true."
            ),
            "another mail": lambda m: mail.store(m, [to], "Fwd", f"{line}\n\n{other}"),
            "to somebody else": lambda m: mail.store(m, ["jun@mail.test"], "Fwd", whole),
            "deleted after that": lambda m: [
                mail.store(m, [to], "Fwd", whole),
                mail.flag(m, "r0", folder="trash"),
            ],
        }

    def right_result(self, machine):
        quoted = "\n".join(f"> {line}" for line in self.values.body.splitlines())
        body = f"{self.values.line}\n\n{quoted}"
        mail.store(machine, [self.values.to], f"Fwd: {self.values.subject}", body)
