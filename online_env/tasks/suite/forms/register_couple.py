"""Register two people for the same course."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, registrations
from online_env.tasks.kit.browser import begin
from online_env.tasks.kit.pages import visit

ADDRESS = f"{registrations.SITE}/register"


class RegisterCouple(Task):
    """The same form twice: course, level and country in common, names and dates apart."""

    name = "register_couple"
    domain = "forms"
    apps = ("chrome",)
    sites = ("forms",)
    unsolvable = {"network_error": "the form's site cannot be reached"}
    phrasings = (
        'Register two people for "{course}" ({level}) at {address}: {one} and {two}. Both live in'
        " {country}. Leave the boxes under Also and the notes empty, and accept the house rules.",
        "At {address}, sign these two up, each with a form of their own: {one}; {two}. Course:"
        ' "{course}", level: {level}, country: {country}. No extras, no notes; the house rules are'
        " fine.",
        'My friends want to take the course "{course}" together (level: {level}). Please register'
        " them at {address}: {one}, and {two}. They are from {country}. Tick nothing under Also,"
        " write no notes, agree to the rules.",
    )

    def draw(self, stream):
        first, second = registrations.people(stream, 2)
        shared = {key: first[key] for key in ("course", "level", "country")}
        wanted = [{**entry, **shared, "interests": [], "notes": ""} for entry in (first, second)]
        told = [
            f"{entry['name']}, born on {registrations.day(entry['birth_date'])}, {entry['email']}"
            for entry in wanted
        ]
        return {
            "wanted": wanted,
            "one": told[0],
            "two": told[1],
            "address": ADDRESS,
            "country": shared["country"],
            "course": registrations.course(shared["course"]),
            "level": registrations.level(shared["level"]),
        }

    def initial_app(self, machine):
        return "chrome", ADDRESS

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from registrations.unlike(machine, *self.values.wanted)

    def oracle(self, hand):
        first, second = self.values.wanted
        begin(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, first)
        visit(hand, ADDRESS, "Course registration")
        registrations.fill_in(hand, second)

    def plan(self):
        first, second = self.values.wanted
        return [
            'window "Chromium"',
            *plan_steps.register(first),
            *plan_steps.visit(ADDRESS, "Full name"),
            *plan_steps.register(second),
        ]

    def wrong_results(self):
        store, (first, second) = registrations.store, self.values.wanted
        mixed = {**first, "birth_date": second["birth_date"]}
        return {
            "one of them": lambda m: store(m, first),
            "one of them twice": lambda m: store(m, first, first),
            "one birthday for both": lambda m: store(m, mixed, second),
            "one too many": lambda m: store(m, first, second, second),
        }

    def right_result(self, machine):
        registrations.store(machine, *reversed(self.values.wanted))
