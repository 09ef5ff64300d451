"""Answer a mail that nobody has sent."""

from online_env.tasks import Task
from online_env.tasks.kit import browser, mail
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES, TOPICS, sample
from online_env.tasks.plan_words import quoted


class AnswerMissingMail(Task):
    """A namesake has written about it; the person who is named has written nothing at all."""

    name = "answer_missing_mail"
    domain = "infeasible"
    apps = ("chrome",)
    sites = ("mail",)
    in_browser = True
    infeasible = "there is no mail of that person"
    unsolvable = {"network_error": "the mailbox cannot be reached"}
    phrasings = (
        "Reply to the mail that {who} sent me about the {topic}: I agree.",
        'Please answer {who}\'s mail about the {topic} at mail.test with "I agree."',
        "{who} has mailed me about the {topic}. Find that mail, and reply that I agree.",
    )

    def draw(self, stream):
        first, second_name = sample(stream, FIRST_NAMES, 2)
        last, second = sample(stream, LAST_NAMES, 2)
        topic, unlike = sample(stream, TOPICS, 2)
        senders = [
            (f"{first} {second}", "first@mail.test"),
            (f"{second_name} {last}", "o@mail.test"),
        ]
        return {
            "who": f"{first} {last}",
            "topic": topic,
            "mails": [
                mail.message(
                    f"r{index}",
                    sender,
                    f"The {about}",
                    f"Hi Robin,\n\nwhat do you say to the {about}?\n\n{sender[0]}",
                    f"2026-03-03T1{index}:{stream.integer(10, 59)}",
                )
                for index, (sender, about) in enumerate(zip(senders, (topic, unlike), strict=True))
            ],
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from mail.problems(machine)

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.search(hand, self.values.who)
        hand.find("static", "Nothing here.", app=browser.APP)
        hand.give_up(f"{self.values.who} has written no mail")

    def plan(self):
        return [
            'window "Chromium"',
            'click "Search mail"',
            f"type {quoted(self.values.who)}",
            "press enter",
            'wait for "Nothing here."',
            f"give up {quoted(f'{self.values.who} has written no mail')}",
        ]

    def wrong_results(self):
        subject = f"Re: The {self.values.topic}"
        return {
            "to the namesake": lambda m: mail.store(m, ["first@mail.test"], subject, "I agree."),
            "to the other one": lambda m: mail.store(m, ["o@mail.test"], subject, "I agree."),
            "a draft": lambda m: mail.store(m, [], subject, "I agree.", folder="drafts"),
        }
