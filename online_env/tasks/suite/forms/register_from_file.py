"""Register the person whose details are in a text file on the desktop."""

from online_env.tasks import Task
from online_env.tasks.kit import registrations, told
from online_env.tasks.kit.notes import read_file
from online_env.tasks.kit.pages import visit
from online_env.tasks.kit.words import shuffled

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
        machine.write(f"Desktop/{self.drawn.file}", "\n".join(self.drawn.lines) + "\n")

    def opens(self, machine):
        return "chrome", ADDRESS

    def problems(self, machine):
        yield from machine.untouched()
        yield from registrations.unlike(machine, self.drawn.wanted)

    def oracle(self, hand):
        read_file(hand, f"Desktop/{self.drawn.file}")
        visit(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, self.drawn.wanted)

    def plan(self):
        return [
            'window "Chromium"',
            *told.visit(f"file:///home/user/Desktop/{self.drawn.file}", self.drawn.lines[0]),
            *told.visit(ADDRESS, "Full name"),
            *told.register(self.drawn.wanted),
        ]

    def wrong(self):
        wanted, store = self.drawn.wanted, registrations.store
        extra = sorted({"newsletter", "volunteer", "carpool"} ^ set(wanted["interests"]))
        return {
            "other boxes": lambda m: store(m, {**wanted, "interests": extra}),
            "no notes": lambda m: store(m, {**wanted, "notes": ""}),
            "another day of birth": lambda m: store(m, {**wanted, "birth_date": "2001-01-01"}),
            "sent twice": lambda m: store(m, wanted, wanted),
        }

    def right(self, machine):
        registrations.store(machine, dict(reversed(self.drawn.wanted.items())))
