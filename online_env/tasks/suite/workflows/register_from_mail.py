"""Register a friend for a course, with the details of a mail."""

from datetime import date, timedelta

from online_env.embedded.sites.hosts import forms
from online_env.embedded.sites.hosts import mail as mailbox
from online_env.tasks import Task
from online_env.tasks.kit import browser, mail, plan_steps, registrations, shop
from online_env.tasks.plan_words import quoted

REGISTER = "http://forms.test/register"


class RegisterFromMail(Task):
    """All details stand in a mail; the form is on another site."""

    name = "register_from_mail"
    domain = "workflows"
    apps = ("chrome",)
    sites = ("mail", "forms")
    unsolvable = {"network_error": "neither site can be reached"}
    phrasings = (
        "{who} has written to me about a course. Register them for it at {address}, with the"
        " details in the mail (mail.test). Tick nothing under Also; no notes.",
        "Please sign {who} up for the course they want: what the form at {address} needs is in"
        " their mail. Nothing under Also, nothing in the notes.",
        "Course registration at {address} for {who}, as in the mail at mail.test. Leave Also and"
        " the notes empty.",
    )

    def draw(self, stream):
        choices = forms.content()
        person = shop.recipient(stream)
        born = date(1950, 1, 1) + timedelta(days=stream.integer(0, 20_000))
        course = stream.choice(list(choices["courses"]))
        level = stream.choice(list(choices["levels"]))
        wanted = {
            "name": person["name"],
            "email": person["email"],
            "birth_date": born.isoformat(),
            "country": person["country"],
            "course": course,
            "level": level,
            "interests": [],
            "notes": "",
        }
        title, label = choices["courses"][course]["name"], choices["levels"][level]
        return {
            "wanted": wanted,
            "who": person["name"],
            "address": REGISTER,
            "title": title,
            "level": label,
            "body": f"Hello Robin,\n\nmy computer is broken. Could you register me for"
            f' "{title}"? {label}, that is my level. I was born on {born.day} {born:%B %Y}, I live'
            f" in {person['country']}, and my e-mail is {person['email']}.\n\n{person['name']}",
        }

    def prepare(self, machine):
        sender = (self.values.who, self.values.wanted["email"])
        body = self.values.body
        mail.receive(machine, mail.message("r1", sender, "A course", body, "2026-03-04T09:40"))

    def initial_app(self, machine):
        return "chrome", mail.INBOX

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from mail.problems(machine)
        yield from registrations.unlike(machine, self.values.wanted)

    def oracle(self, hand):
        wanted = self.values.wanted
        year, month, day = wanted["birth_date"].split("-")
        browser.begin(hand, mail.INBOX, "Inbox")
        mail.open_mail(hand, self.values.who, "A course")
        browser.visit(hand, REGISTER, "Course registration")
        browser.enter(hand, "Full name", wanted["name"])
        browser.enter(hand, "E-mail", wanted["email"])
        hand.click_on("spin-button", "Month Date of birth", app=browser.APP)
        hand.type(f"{month}{day}{year}")
        browser.select(hand, "Country", wanted["country"])
        browser.select(hand, "Course", self.values.title)
        browser.tick(hand, self.values.level)
        browser.tick(hand, "I accept the house rules")
        browser.push(hand, "Send registration", "You are registered")

    def plan(self):
        wanted = self.values.wanted
        return [
            'window "Chromium"',
            f"click {quoted(self.values.who)}",
            f"wait for {quoted(wanted['email'])}",
            *plan_steps.visit(REGISTER, "Full name"),
            *plan_steps.register(wanted),
        ]

    def wrong_results(self):
        wanted, store = self.values.wanted, registrations.store
        return {
            "born another day": lambda m: store(m, {**wanted, "birth_date": "1940-01-01"}),
            "for Robin": lambda m: store(m, {**wanted, "email": owner()}),
            "sent twice": lambda m: store(m, wanted, wanted),
            "with a newsletter": lambda m: store(m, {**wanted, "interests": ["newsletter"]}),
            "cancelled": lambda m: store(m, {**wanted, "cancelled": True}),
        }

    def right_result(self, machine):
        wanted = self.values.wanted
        mistaken = {**wanted, "birth_date": "1940-01-01", "cancelled": True}
        registrations.store(machine, mistaken, dict(reversed(wanted.items())))


def owner():
    """Return the address of the mailbox's owner."""
    return mailbox.content()["owner"]["address"]
