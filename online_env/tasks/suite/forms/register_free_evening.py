"""Register for the first of some courses for which there is time, as a calendar in a file says."""

from online_env.embedded.sites.hosts.forms import content
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, registrations
from online_env.tasks.kit.notes import read_file
from online_env.tasks.kit.pages import visit
from online_env.tasks.kit.word_lists import sample, shuffled

ADDRESS = f"{registrations.SITE}/register"
BUSY = ("Choir", "Night shift", "Football practice", "Visit to my parents", "Council meeting")


class RegisterFreeEvening(Task):
    """Days of courses are on the site, busy days in a file; the first course that fits is right."""

    name = "register_free_evening"
    domain = "forms"
    apps = ("chrome", "mousepad")
    sites = ("forms",)
    unsolvable = {"network_error": "the form's site cannot be reached"}
    phrasings = (
        "I would like to take a course at forms.test: best {first}, else {second}, else {third}."
        " Take the first of them that is on a day when I am free; {path} says when I am not. My"
        " details: {told}. No boxes, no notes; the house rules are fine.",
        "Look into {path} for the days when I am busy, then register me at {address} for one"
        " course: {first}; if I am busy on that day, {second}; if that does not work either,"
        " {third}. {told}. Tick nothing under Also, leave the notes empty, accept the rules.",
        "Register me ({told}) at {address} for the first course of this list that is not on one"
        " of my busy days in {path}: 1. {first}, 2. {second}, 3. {third}. Nothing under Also, no"
        " notes, rules accepted.",
    )

    def draw(self, stream):
        courses = sample(stream, list(content()["courses"]), 3)
        fits = stream.integer(1, 2)
        busy = [content()["courses"][key]["when"].split(",")[0] for key in courses[:fits]]
        lines = [
            f"{day}: {what}" for day, what in zip(busy, sample(stream, BUSY, fits), strict=True)
        ]
        entry = registrations.people(stream, 1)[0]
        wanted = {**entry, "course": courses[fits], "interests": [], "notes": ""}
        names = [f'"{registrations.course(key)}"' for key in courses]
        told = (
            f"{wanted['name']}, {wanted['email']}, born on"
            f" {registrations.day(wanted['birth_date'])}, country {wanted['country']}, level"
            f" {registrations.level(wanted['level'])}"
        )
        return {
            "wanted": wanted,
            "courses": courses,
            "lines": shuffled(stream, [*lines, "Fridays: Cinema"]),
            "path": f"Documents/busy-{stream.integer(10, 99)}.txt",
            "first": names[0],
            "second": names[1],
            "third": names[2],
            "told": told,
            "address": ADDRESS,
        }

    def prepare(self, machine):
        machine.write(self.values.path, "\n".join(self.values.lines) + "\n")

    def initial_app(self, machine):
        return "chrome", registrations.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from registrations.unlike(machine, self.values.wanted)

    def oracle(self, hand):
        read_file(hand, self.values.path)
        visit(hand, registrations.SITE, "Northgate")
        hand.find("heading", "Courses this spring")
        visit(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, self.values.wanted)

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(f"file:///home/user/{self.values.path}", self.values.lines[0]),
            *plan_steps.visit(ADDRESS, "Full name"),
            *plan_steps.register(self.values.wanted),
        ]

    def wrong_results(self):
        wanted, store = self.values.wanted, registrations.store
        first = {**wanted, "course": self.values.courses[0]}
        return {
            "the first, though busy": lambda m: store(m, first),
            "both": lambda m: store(m, first, wanted),
            "another level": lambda m: store(m, {**wanted, "level": "none"}),
            "cancelled after that": lambda m: store(m, {**wanted, "cancelled": True}),
        }

    def right_result(self, machine):
        registrations.store(machine, dict(reversed(self.values.wanted.items())))
