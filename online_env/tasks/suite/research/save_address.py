"""Find a page with the search page and save its address."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.notes import plain, take_note, unlike
from online_env.tasks.kit.pages import arrived, enter, follow, visit
from online_env.tasks.plan_words import quoted

# What somebody looks for, words to search for, the title of the page, and its address.
PAGES = (
    (
        "the news about the aurora over the town",
        "aurora lights",
        "Green lights",
        "news.test/article/aurora-seen",
    ),
    (
        "the news about the girl who won at chess",
        "chess open",
        "Fourteen",
        "news.test/article/chess-open",
    ),
    (
        "the news about the new harbour bridge",
        "harbour bridge opens",
        "New harbour",
        "news.test/article/harbour-bridge-opens",
    ),
    (
        "the news about the library that lends tools",
        "library tuba",
        "The library that",
        "news.test/article/library-of-things",
    ),
    (
        "the news about the fish on the reef",
        "divers reef survey",
        "Divers count",
        "news.test/article/reef-survey",
    ),
    ("the handbook page about exit codes", "exit codes", "Exit codes", "docs.test/exit-codes"),
    (
        "the handbook page about retention rules",
        "retention rules",
        "Retention rules",
        "docs.test/retention-rules",
    ),
    ("the encyclopedia's article on paper", "paper fibres", "Paper", "wiki.test/wiki/Paper"),
    ("the encyclopedia's article on tides", "tide moon", "Tide", "wiki.test/wiki/Tide"),
    (
        "the course registration of the community centre",
        "course registration",
        "Course registration",
        "forms.test/register",
    ),
)


class SaveAddress(Task):
    """The right one of several results, and its address in a text file."""

    name = "save_address"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the search page cannot be reached"}
    phrasings = (
        "Find {what} with the search page, search.test, and save its address in {path}.",
        "Please search for {what} on http://search.test and put the address of the page into a"
        " text file {path}, nothing else.",
        "I need the link to {what}. Use search.test, and write the page's address to {path}.",
    )

    def draw(self, stream):
        what, words, title, address = stream.choice(PAGES)
        folder = stream.choice(("Documents", "Desktop"))
        path = f"{folder}/link-{stream.integer(10, 99)}.txt"
        return {"what": what, "words": words, "title": title, "address": address, "path": path}

    def initial_app(self, machine):
        return "chrome", "http://search.test/"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        text = machine.text(self.values.path) or ""
        if plain(text).rstrip("/") != self.values.address.casefold():
            whole = f"http://{self.values.address}"
            yield from unlike(machine, self.values.path, [whole])

    def oracle(self, hand):
        visit(hand, "http://search.test/", "Lumen")
        enter(hand, re.compile("Search"), self.values.words, ("entry", "combo-box"))
        hand.press("enter")
        arrived(hand, self.values.words)
        title = re.compile(re.escape(self.values.title))
        follow(hand, title, self.values.title)
        take_note(hand, self.values.path, f"http://{self.values.address}")

    def plan(self):
        return [
            'window "Chromium"',
            f"type {quoted(self.values.words)}",
            "press enter",
            f"click {quoted(self.values.title)}",
            f"wait for {quoted(self.values.address)}",
            *plan_steps.take_note(self.values.path, f"http://{self.values.address}"),
        ]

    def wrong_results(self):
        path, address = self.values.path, self.values.address
        return {
            "only the site": lambda m: m.write(path, f"http://{address.partition('/')[0]}/"),
            "the title": lambda m: m.write(path, self.values.title),
            "the search": lambda m: m.write(path, "http://search.test/search?q=it"),
            "in another file": lambda m: m.write("link.txt", f"http://{address}"),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f"{self.values.address}\n")
