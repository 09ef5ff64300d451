"""Register the person whose details are in a text file on the desktop."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, registrations
from online_env.tasks.kit.notes import read_file
from online_env.tasks.kit.pages import visit
from online_env.tasks.kit.word_lists import shuffled

ADDRESS = f"{registrations.SITE}/register"


class RegisterFromFile(Task):
    """The details are in a file that has to be read first, in an order that is not the form's."""

    name = "register_from_file"
    domain = "forms"
    apps = ("chrome", "mousepad")
    sites = ("forms",)
    unsolvable = {"network_error": "the form's site cannot be reached"}
    phrasings = (
        "Fill in the course registration at {address} with what {file} on my desktop says, accept"
        " the house rules and send it.",
        "On the desktop there is a text file, {file}, with somebody's details. Please register"
        " that person at {address}. The house rules are accepted.",
        "Register the person described in Desktop/{file} for the course named there:"
        " {address}. (House rules: yes.)",
    )

    def draw(self, stream):
        wanted = registrations.people(stream, 1)[0]
        lines = shuffled(
            stream,
            [
                f"Name: {wanted['name']}",
                f"E-mail: {wanted['email']}",
                f"Born: {registrations.day(wanted['birth_date'])}",
                f"Country: {wanted['country']}",
                f"Course: {registrations.course(wanted['course'])}",
                f"Level: {registrations.level(wanted['level'])}",
                f"To tick under Also: {registrations.boxes(wanted)}",
                f"Notes for the teacher: {wanted['notes']}",
            ],
        )
        file = f"{stream.choice(('course', 'registration', 'form'))}-{stream.integer(10, 99)}.txt"
        return {"wanted": wanted, "lines": lines, "file": file, "address": ADDRESS}

    def prepare(self, machine):
        machine.write(f"Desktop/{self.values.file}", "\n".join(self.values.lines) + "\n")

    def initial_app(self, machine):
        return "chrome", ADDRESS

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from registrations.unlike(machine, self.values.wanted)

    def oracle(self, hand):
        read_file(hand, f"Desktop/{self.values.file}")
        visit(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, self.values.wanted)

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(
                f"file:///home/user/Desktop/{self.values.file}", self.values.lines[0]
            ),
            *plan_steps.visit(ADDRESS, "Full name"),
            *plan_steps.register(self.values.wanted),
        ]

    def wrong_results(self):
        wanted, store = self.values.wanted, registrations.store
        extra = sorted({"newsletter", "volunteer", "carpool"} ^ set(wanted["interests"]))
        return {
            "other boxes": lambda m: store(m, {**wanted, "interests": extra}),
            "no notes": lambda m: store(m, {**wanted, "notes": ""}),
            "another day of birth": lambda m: store(m, {**wanted, "birth_date": "2001-01-01"}),
            "sent twice": lambda m: store(m, wanted, wanted),
        }

    def right_result(self, machine):
        registrations.store(machine, dict(reversed(self.values.wanted.items())))
