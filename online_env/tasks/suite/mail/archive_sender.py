"""Archive all mails of one sender."""

from online_env.tasks.kit import browser, mail
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES, TOPICS, sample, shuffled
from online_env.tasks.plan_words import quoted


class ArchiveSender(mail.MailTask):
    """Three or four mails of one sender; a namesake has written, too."""

    name = "archive_sender"
    phrasings = (
        "Archive all mails from {who} that are in my inbox at mail.test.",
        "Please move every mail that {who} has sent me to the archive. Nobody else's.",
        "Inbox at mail.test: everything from {who} belongs in the archive.",
    )

    def draw(self, stream):
        first, other = sample(stream, FIRST_NAMES, 2)
        last, second = sample(stream, LAST_NAMES, 2)
        count = stream.integer(3, 4)
        senders = [(f"{first} {last}", "first@mail.test")] * count
        senders += [(f"{first} {second}", "second@mail.test"), (f"{other} {last}", "o@mail.test")]
        topics = sample(stream, TOPICS, len(senders))
        mails = []
        for index, sender in enumerate(shuffled(stream, senders)):
            body = f"Robin,\n\nthe {topics[index]} is done. Have a look.\n\n{sender[0]}"
            date = f"2026-03-0{stream.integer(1, 3)}T1{index}:{stream.integer(10, 59)}"
            subject = f"{topics[index].capitalize()} {stream.integer(2, 40)}"
            mails.append(mail.message(f"r{index}", sender, subject, body, date))
        chosen = [m for m in mails if m["from"]["address"] == "first@mail.test"]
        return {
            "mails": mails,
            "who": f"{first} {last}",
            "chosen": [m["id"] for m in chosen],
            "subjects": [m["subject"] for m in chosen],
            "others": [m["id"] for m in mails if m not in chosen],
        }

    def prepare(self, machine):
        mail.receive(machine, *self.values.mails)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        flags = {ident: {"folder": "archive"} for ident in self.values.chosen}
        yield from mail.problems(machine, flags=flags)

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        for subject in self.values.subjects:
            if mail.lists(hand, self.values.who, subject):
                mail.open_mail(hand, self.values.who, subject)
                browser.push(hand, "Archive", "Inbox")

    def plan(self):
        steps = ['window "Chromium"']
        for subject in self.values.subjects:
            steps += [f"click {quoted(subject)}", 'click "Archive" near "Back"', 'wait for "Inbox"']
        return steps

    def wrong_results(self):
        chosen, others = self.values.chosen, self.values.others
        return {
            "one is left": lambda m: mail.flag(m, *chosen[1:], folder="archive"),
            "deleted": lambda m: mail.flag(m, *chosen, folder="trash"),
            "the namesake's": lambda m: mail.flag(m, *others, folder="archive"),
            "all": lambda m: mail.flag(m, *chosen, *others, folder="archive"),
        }

    def right_result(self, machine):
        mail.flag(machine, *reversed(self.values.chosen), folder="archive", read=True)
