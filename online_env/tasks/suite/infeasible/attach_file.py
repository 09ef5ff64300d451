"""Send a file with a mail, where mails have no attachments."""

from online_env.tasks import Task
from online_env.tasks.kit import browser, mail
from online_env.tasks.kit.word_lists import MONTHS, TOPICS

PEOPLE = ("ilse@mail.test", "piet@mail.test", "jun@mail.test", "oda@mail.test")


class AttachFile(Task):
    """The file is there and the recipient known, but the form has no place for a file."""

    name = "attach_file"
    domain = "infeasible"
    apps = ("chrome",)
    sites = ("mail",)
    infeasible = "the mailbox cannot send files"
    unsolvable = {"network_error": "the mailbox cannot be reached"}
    phrasings = (
        "Send the file {file} to {to} as an attachment, from my mailbox at mail.test.",
        "Please mail {file} (the file itself, attached) to {to} with mail.test.",
        "mail.test: new mail to {to} with {file} attached.",
    )

    def draw(self, stream):
        name = f"{stream.choice(TOPICS)} {stream.choice(MONTHS)}.csv"
        return {
            "file": f"Documents/{name}",
            "content": f"item,count\nrope,{stream.integer(2, 90)}\n",
            "to": stream.choice(PEOPLE),
        }

    def prepare(self, machine):
        machine.write(self.values.file, self.values.content)

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from mail.problems(machine)

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        browser.follow(hand, "Compose", "New message")
        hand.find("push-button", "Save draft", app=browser.APP)
        browser.follow(hand, "Discard", "Inbox")
        hand.give_up("a message has no place for a file")

    def plan(self):
        return [
            'window "Chromium"',
            'click "Compose"',
            'wait for "Save draft"',
            'click "Discard"',
            'give up "a message has no place for a file"',
        ]

    def wrong_results(self):
        to, file, content = [self.values.to], self.values.file, self.values.content
        return {
            "the content as text": lambda m: mail.store(m, to, file, content),
            "only its name": lambda m: mail.store(m, to, "Your file", file),
            "a draft": lambda m: mail.store(m, to, file, "", folder="drafts"),
            "the file was moved": lambda m: m.run("mv", file, "Downloads"),
        }
