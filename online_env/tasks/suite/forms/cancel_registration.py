"""Cancel one of several registrations."""

from online_env.embedded.sites.hosts.forms import FIRST_NUMBER
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, registrations
from online_env.tasks.kit.pages import enter, follow, visit
from online_env.tasks.plan_words import quoted


class CancelRegistration(Task):
    """One person has two registrations and gives up one of them; another person has the third."""

    name = "cancel_registration"
    domain = "forms"
    apps = ("chrome",)
    sites = ("forms",)
    unsolvable = {"network_error": "the site with the registration cannot be reached"}
    phrasings = (
        "{name} cannot come to the course after all. Cancel registration {number} at forms.test;"
        " the e-mail address that was given is {email}. The other registrations stay.",
        "Please cancel the registration number {number} of {name} ({email}) on http://forms.test,"
        " and only this one.",
        "Cancel {name}'s course registration {number} at forms.test ({email}).",
    )

    def draw(self, stream):
        first, second = registrations.people(stream, 2)
        again = {**first, "course": "chess" if first["course"] != "chess" else "pottery"}
        everybody = [first, second, again]
        which = stream.choice((0, 2))
        return {
            "everybody": everybody,
            "which": which,
            "number": FIRST_NUMBER + which,
            "name": first["name"],
            "email": first["email"],
        }

    def prepare(self, machine):
        registrations.store(machine, *self.values.everybody)

    def initial_app(self, machine):
        return "chrome", registrations.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes()
        kept = [entry for n, entry in enumerate(self.values.everybody) if n != self.values.which]
        yield from registrations.unlike(machine, *kept)
        gone = registrations.cancelled(machine)
        if gone != [self.values.number]:
            yield f"registrations {gone} were cancelled"

    def oracle(self, hand):
        visit(hand, f"{registrations.SITE}/find", "Your registration")
        enter(hand, "Registration number", str(self.values.number))
        enter(hand, "E-mail", self.values.email)
        follow(hand, "Find it", f"Registration {self.values.number}")
        if hand.see("heading", "Registration cancelled"):
            return
        follow(hand, "Cancel it", f"Cancel registration {self.values.number}")
        follow(hand, "Cancel the registration", f"Registration {self.values.number}")
        hand.find("heading", "Registration cancelled")

    def plan(self):
        number = self.values.number
        return [
            'window "Chromium"',
            *plan_steps.find_registration(number, self.values.email),
            'scroll down to "Cancel it"',
            'click "Cancel it"',
            f"wait for {quoted(f'Cancel registration {number}')}",
            'click "Cancel the registration"',
            'wait for "Registration cancelled"',
        ]

    def wrong_results(self):
        def cancel(machine, *numbers):
            entries = enumerate(self.values.everybody)
            kept = [{**e, "cancelled": True} if n in numbers else e for n, e in entries]
            registrations.store(machine, *kept)

        return {
            "the other course": lambda m: cancel(m, 2 - self.values.which),
            "all of the person": lambda m: cancel(m, 0, 2),
            "somebody else": lambda m: cancel(m, 1),
            "removed": lambda m: registrations.store(m, *self.values.everybody[:2]),
        }

    def right_result(self, machine):
        kept = [
            {"cancelled": number == self.values.which, **entry}
            for number, entry in enumerate(self.values.everybody)
        ]
        registrations.store(machine, *kept)
