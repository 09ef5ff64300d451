"""Write a mail, and keep it as a draft."""

from online_env.tasks.kit import browser, mail, plan_steps
from online_env.tasks.kit.word_lists import CITIES, MONTHS, TOPICS

PEOPLE = ("ilse@mail.test", "piet@mail.test", "jun@mail.test", "adaeze@mail.test")
TEXTS = (
    "I shall be in {city} in {month}. Could you look after the {topic}?",
    "The {topic} from {city} arrives in {month}, so we should meet before.",
    "What do you think of {city} in {month}? The {topic} would be ready by then.",
)


class SaveDraft(mail.MailTask):
    """Recipient, subject and text; the mail is not sent."""

    name = "save_draft"
    phrasings = (
        'Write a mail to {to} with the subject "{subject}" and the text "{text}" at mail.test, but'
        " only save it as a draft. I want to sleep on it.",
        "Please draft a mail, don't send it. To: {to}. Subject: {subject}. Text: {text}",
        'A draft for mail.test: {to}, subject "{subject}", "{text}" Not to be sent yet.',
    )

    def draw(self, stream):
        city, month = stream.choice(CITIES), stream.choice(MONTHS)
        topic = stream.choice(TOPICS)
        text = stream.choice(TEXTS).format(city=city, month=month, topic=topic)
        return {"to": stream.choice(PEOPLE), "subject": f"{city} in {month}", "text": text}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        drawn = self.values
        letter = mail.Letter(to=[drawn.to], subject=drawn.subject, text=drawn.text)
        yield from mail.problems(machine, drafts=[letter])

    def oracle(self, hand):
        browser.begin(hand, mail.INBOX, "Inbox")
        browser.follow(hand, "Compose")
        drawn = self.values
        mail.compose(hand, to=drawn.to, subject=drawn.subject, text=drawn.text)
        mail.save_draft(hand)

    def plan(self):
        drawn = self.values
        return [
            'window "Chromium"',
            'click "Compose"',
            *plan_steps.compose(to=drawn.to, subject=drawn.subject, text=drawn.text),
            'click "Save draft"',
            "wait",
        ]

    def wrong_results(self):
        to, subject, text = self.values.to, self.values.subject, self.values.text
        return {
            "sent": lambda m: mail.store(m, [to], subject, text),
            "no recipient": lambda m: mail.store(m, [], subject, text, folder="drafts"),
            "no subject": lambda m: mail.store(m, [to], "", text, folder="drafts"),
            "half the text": lambda m: mail.store(m, [to], subject, text[:20], folder="drafts"),
            "two drafts": lambda m: [
                mail.store(m, [to], subject, text, folder="drafts") for _ in range(2)
            ],
        }

    def right_result(self, machine):
        drawn = self.values
        mail.store(machine, [drawn.to], drawn.subject, drawn.text + "\n", folder="drafts")
