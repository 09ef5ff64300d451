"""Star one mail, and take the star from another."""

from online_env.tasks.kit import browser, mail
from online_env.tasks.kit.word_lists import FIRST_NAMES, TOPICS, sample
from online_env.tasks.plan_words import quoted


class SwapStars(mail.MailTask):
    """Four mails, two with a star; one more gets it, one of the two loses it."""

    name = "swap_stars"
    phrasings = (
        'Put a star on the mail "{new}" at mail.test, and take the star off "{old}".',
        "{who_old}'s mail about the {topic_old} is settled, so remove its star. Star the one from"
        " {who_new} about the {topic_new} instead.",
        'mail.test, please: "{old}" unstarred, "{new}" starred, nothing else changed.',
    )

    def draw(self, stream):
        names = sample(stream, FIRST_NAMES, 4)
        topics = sample(stream, TOPICS, 4)
        mails = [
            mail.message(
                f"r{index}",
                (name, f"desk{index}@mail.test"),
                f"About the {topic}",
                f"Dear Robin,\n\nwe have to talk about the {topic}.\n\n{name}",
                f"2026-03-0{stream.integer(1, 3)}T{stream.integer(10, 19)}:3{index}",
                starred=index < 2,
            )
            for index, (name, topic) in enumerate(zip(names, topics, strict=True))
        ]
        return {
            "mails": mails,
            "old": mails[0]["subject"],
            "new": mails[2]["subject"],
            "who_old": names[0],
            "who_new": names[2],
            "topic_old": topics[0],
            "topic_new": topics[2],
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        flags = {"r0": {"starred": False}, "r2": {"starred": True}}
        yield from mail.problems(machine, flags=flags)

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        star = f"Star {self.values.new}"
        if hand.see("push-button", f"Remove star from {self.values.new}") is None:
            browser.push(hand, star)
            hand.wait_until_gone("push-button", star, app=browser.APP)
        star = f"Remove star from {self.values.old}"
        if hand.see("push-button", f"Star {self.values.old}") is None:
            browser.push(hand, star)
            hand.wait_until_gone("push-button", star, app=browser.APP)

    def plan(self):
        steps = ['window "Chromium"']
        for subject in (self.values.new, self.values.old):
            steps += [f"click {quoted(subject)}", 'click "star" near "Mark as unread"']
            steps += ["wait", 'click "Inbox"', 'wait for "messages"']
        return steps

    def wrong_results(self):
        return {
            "only starred": lambda m: mail.flag(m, "r2", starred=True),
            "only unstarred": lambda m: mail.flag(m, "r0", starred=False),
            "the other way round": lambda m: mail.flag(m, "r1", starred=False),
            "both lost it": lambda m: [
                mail.flag(m, "r0", "r1", starred=False),
                mail.flag(m, "r2", starred=True),
            ],
        }

    def right_result(self, machine):
        mail.flag(machine, "r2", read=True, starred=True)
        mail.flag(machine, "r0", starred=False)
