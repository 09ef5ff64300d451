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
        entry = registrations.people(stream, 1)[0]
        entry["interests"] = entry["interests"] or ["newsletter"]
        return {
            **entry,
            "wanted": entry,
            "address": ADDRESS,
            "born": registrations.day(entry["birth_date"]),
            "course": registrations.course(entry["course"]),
            "level": registrations.level(entry["level"]),
            "boxes": registrations.boxes(entry),
        }

    def initial_app(self, machine):
        return "chrome", ADDRESS

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from registrations.registration_problems(machine, self.values.wanted)

    def oracle(self, hand):
        visit(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, self.values.wanted)

    def plan(self):
        return ['window "Chromium"', *plan_steps.register(self.values.wanted)]

    def wrong_results(self):
        entry, store = self.values.wanted, registrations.store
        return {
            "another name": lambda m: store(m, {**entry, "name": "Somebody Else"}),
            "no notes": lambda m: store(m, {**entry, "notes": ""}),
            "sent twice": lambda m: store(m, entry, entry),
            "cancelled after that": lambda m: store(m, {**entry, "cancelled": True}),
            "another course": lambda m: store(m, {**entry, "course": "none"}),
        }

    def right_result(self, machine):
        cancelled_entry = {**self.values.wanted, "notes": "", "cancelled": True}
        valid_entry = {**self.values.wanted, "email": self.values.email.upper()}
        registrations.store(machine, cancelled_entry, valid_entry)
