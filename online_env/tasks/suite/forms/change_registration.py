"""Change the course and the level of somebody's registration."""

from online_env.embedded.sites.hosts.forms import FIRST_NUMBER, content
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, registrations
from online_env.tasks.kit.browser import select
from online_env.tasks.kit.pages import enter, follow, tick, visit
from online_env.tasks.kit.word_lists import sample
from online_env.tasks.plan_words import quoted


class ChangeRegistration(Task):
    """One of three registrations gets another course and level; all else stays as it was."""

    name = "change_registration"
    domain = "forms"
    apps = ("chrome",)
    sites = ("forms",)
    unsolvable = {"network_error": "the site with the registration cannot be reached"}
    phrasings = (
        "{name} is registered at forms.test (registration number {number}, e-mail {email}), but"
        ' for the wrong course. Change it to "{course}", level "{level}", and leave the rest.',
        'Please move {name} to the course "{course}" ({level}). The registration at'
        " http://forms.test has the number {number} and the e-mail address {email}.",
        'Change registration {number} ({email}) on forms.test: course "{course}", level'
        ' "{level}". Everything else stays.',
    )

    def draw(self, stream):
        everybody = registrations.people(stream, 3)
        which = stream.integer(0, 2)
        courses = [key for key in content()["courses"] if key != everybody[which]["course"]]
        levels = [key for key in content()["levels"] if key != everybody[which]["level"]]
        new = {"course": sample(stream, courses, 1)[0], "level": sample(stream, levels, 1)[0]}
        wanted = [{**entry, **new} if n == which else entry for n, entry in enumerate(everybody)]
        return {
            "everybody": everybody,
            "wanted": wanted,
            "which": which,
            "number": FIRST_NUMBER + which,
            "name": everybody[which]["name"],
            "email": everybody[which]["email"],
            "course": registrations.course(new["course"]),
            "level": registrations.level(new["level"]),
        }

    def prepare(self, machine):
        registrations.store(machine, *self.values.everybody)

    def initial_app(self, machine):
        return "chrome", registrations.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from registrations.unlike(machine, *self.values.wanted)
        if registrations.cancelled(machine):
            yield "a registration was cancelled"

    def oracle(self, hand):
        visit(hand, f"{registrations.SITE}/find", "Your registration")
        enter(hand, "Registration number", str(self.values.number))
        enter(hand, "E-mail", self.values.email)
        follow(hand, "Find it", f"Registration {self.values.number}")
        follow(hand, "Change it")
        hand.find("heading", f"Change registration {self.values.number}")
        select(hand, "Course", self.values.course)
        tick(hand, "radio-button", self.values.level)
        follow(hand, "Save changes")
        hand.find("heading", "You are registered")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.find_registration(self.values.number, self.values.email),
            'scroll down to "Cancel it"',
            'click "Change it" near "Cancel it"',
            f"wait for {quoted(f'Change registration {self.values.number}')}",
            'click "Course"',
            f"type {quoted(self.values.course)}",
            f"click {quoted(self.values.level)}",
            'scroll down to "Save changes"',
            'click "Save changes"',
            'wait for "You are registered"',
        ]

    def wrong_results(self):
        drawn, store = self.values, registrations.store
        old, new = drawn.everybody[drawn.which], drawn.wanted[drawn.which]
        other = (drawn.which + 1) % 3
        spoilt = [new if n == other else entry for n, entry in enumerate(drawn.everybody)]
        half = [
            {**entry, "level": old["level"]} if entry is new else entry for entry in drawn.wanted
        ]
        again = [{**entry, "cancelled": entry is old} for entry in drawn.everybody]
        return {
            "registered once more": lambda m: store(m, *drawn.everybody, new),
            "cancelled, and registered once more": lambda m: store(m, *again, new),
            "the level is as before": lambda m: store(m, *half),
            "somebody else": lambda m: store(m, *spoilt),
            "cancelled": lambda m: store(
                m, *[{**entry, "cancelled": entry is new} for entry in drawn.wanted]
            ),
        }

    def right_result(self, machine):
        registrations.store(machine, *[dict(reversed(e.items())) for e in self.values.wanted])
