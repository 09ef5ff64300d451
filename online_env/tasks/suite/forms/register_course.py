"""Fill in the registration form of forms.test in the browser."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, registrations
from online_env.tasks.kit.pages import visit

ADDRESS = f"{registrations.SITE}/register"


class RegisterCourse(Task):
    """Text, e-mail, date, two selections, radio buttons and check boxes, then the send button."""

    name = "register_course"
    domain = "forms"
    apps = ("chrome",)
    sites = ("forms",)
    unsolvable = {"network_error": "the form's site cannot be reached"}
    phrasings = (
        "Register for a course with the form that is open in the browser ({address}). Name: {name}."
        " E-mail: {email}. Date of birth: {born}. Country: {country}. Course: {course}. Level:"
        " {level}. Tick only {boxes} under Also. Notes: {notes} Accept the house rules and send"
        " the form.",
        'Please sign {name} up for the course "{course}" ({level}) with the form at {address}. Born'
        " on {born}, from {country}, mail to {email}. Under Also, tick {boxes} and nothing more."
        " In the notes, write: {notes} The house rules are accepted.",
        "Send the course registration at {address} with these details: {name}, {email}, born"
        " {born}, country {country}; course {course}, level {level}; also {boxes} (only that);"
        " notes: {notes} Agree to the house rules.",
    )

    def draw(self, stream):
        wanted = registrations.people(stream, 1)[0]
        wanted["interests"] = wanted["interests"] or ["newsletter"]
        return {
            **wanted,
            "wanted": wanted,
            "address": ADDRESS,
            "born": registrations.day(wanted["birth_date"]),
            "course": registrations.course(wanted["course"]),
            "level": registrations.level(wanted["level"]),
            "boxes": registrations.boxes(wanted),
        }

    def initial_app(self, machine):
        return "chrome", ADDRESS

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from registrations.unlike(machine, self.values.wanted)

    def oracle(self, hand):
        visit(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, self.values.wanted)

    def plan(self):
        return ['window "Chromium"', *plan_steps.register(self.values.wanted)]

    def wrong_results(self):
        wanted, store = self.values.wanted, registrations.store
        return {
            "another name": lambda m: store(m, {**wanted, "name": "Somebody Else"}),
            "no notes": lambda m: store(m, {**wanted, "notes": ""}),
            "sent twice": lambda m: store(m, wanted, wanted),
            "cancelled after that": lambda m: store(m, {**wanted, "cancelled": True}),
            "another course": lambda m: store(m, {**wanted, "course": "none"}),
        }

    def right_result(self, machine):
        wrong = {**self.values.wanted, "notes": "", "cancelled": True}
        right = {**self.values.wanted, "email": self.values.email.upper()}
        registrations.store(machine, wrong, right)
