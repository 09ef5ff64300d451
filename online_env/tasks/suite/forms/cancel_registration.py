"""Cancel one of several registrations."""

from online_env.embedded.sites.hosts.forms import FIRST_NUMBER
from online_env.tasks import Task
from online_env.tasks.kit import registrations, told
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
        registrations.store(machine, *self.drawn.everybody)

    def opens(self, machine):
        return "chrome", registrations.SITE

    def problems(self, machine):
        yield from machine.untouched()
        kept = [entry for n, entry in enumerate(self.drawn.everybody) if n != self.drawn.which]
        yield from registrations.unlike(machine, *kept)
        gone = registrations.cancelled(machine)
        if gone != [self.drawn.number]:
            yield f"registrations {gone} were cancelled"

    def oracle(self, hand):
        visit(hand, f"{registrations.SITE}/find", "Your registration")
        enter(hand, "Registration number", str(self.drawn.number))
        enter(hand, "E-mail", self.drawn.email)
        follow(hand, "Find it", f"Registration {self.drawn.number}")
        if hand.see("heading", "Registration cancelled"):
            return
        follow(hand, "Cancel it", f"Cancel registration {self.drawn.number}")
        follow(hand, "Cancel the registration", f"Registration {self.drawn.number}")
        hand.find("heading", "Registration cancelled")

    def plan(self):
        number = self.drawn.number
        return [
            'window "Chromium"',
            *told.find_registration(number, self.drawn.email),
            'scroll down to "Cancel it"',
            'click "Cancel it"',
            f"wait for {quoted(f'Cancel registration {number}')}",
            'click "Cancel the registration"',
            'wait for "Registration cancelled"',
        ]

    def wrong(self):
        def cancel(machine, *numbers):
            entries = enumerate(self.drawn.everybody)
            kept = [{**e, "cancelled": True} if n in numbers else e for n, e in entries]
            registrations.store(machine, *kept)

        return {
            "the other course": lambda m: cancel(m, 2 - self.drawn.which),
            "all of the person": lambda m: cancel(m, 0, 2),
            "somebody else": lambda m: cancel(m, 1),
            "removed": lambda m: registrations.store(m, *self.drawn.everybody[:2]),
        }

    def right(self, machine):
        kept = [
            {"cancelled": number == self.drawn.which, **entry}
            for number, entry in enumerate(self.drawn.everybody)
        ]
        registrations.store(machine, *kept)
