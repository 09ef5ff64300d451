"""Find out from the history of an article who made a change, and when."""

from online_env.embedded.sites.library import articles as shipped
from online_env.tasks import Task
from online_env.tasks.kit import articles, plan_steps
from online_env.tasks.kit.notes import take_note, unlike
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES, sample
from online_env.tasks.plan_words import quoted

COMMENTS = (
    "Spelling",
    "Added a source",
    "Shorter sentences",
    "Removed an advertisement",
    "Checked the dates",
    "Better order",
    "Units",
)


class NameEditor(Task):
    """One of several edits is told by its comment; its author and its day go into a file."""

    name = "name_editor"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the wiki cannot be reached"}
    phrasings = (
        'Who edited the wiki.test article "{title}" with the comment "{comment}", and when? Save'
        " the name in the first line of {path}, and the date with the time, as the site writes it,"
        " in the second.",
        'Look at the history of "{title}" on http://wiki.test and find the edit "{comment}". Write'
        " who made it and, on a second line, its date and time as shown there, to {path}.",
        'wiki.test, article {title}: I need the author of the edit commented "{comment}", and its'
        " date and time. Two lines in {path}, name first, both as they are on the page.",
    )

    def draw(self, stream):
        title = stream.choice(list(shipped("wiki").values())).title
        count = stream.integer(4, 6)
        firsts, lasts = sample(stream, FIRST_NAMES, count), sample(stream, LAST_NAMES, count)
        edits = [
            {"summary": comment, "by": f"{first} {last}", "when": moment(slot, minute)}
            for comment, first, last, slot, minute in zip(
                sample(stream, COMMENTS, count),
                firsts,
                lasts,
                sorted(sample(stream, range(40), count)),
                sample(stream, range(10, 60), count),
                strict=True,
            )
        ]
        which = stream.integer(0, count - 2)
        return {
            "title": title,
            "edits": edits,
            "comment": edits[which]["summary"],
            "by": edits[which]["by"],
            "when": edits[which]["when"],
            "last": edits[-1],
            "path": f"Documents/edit-{stream.integer(10, 99)}.txt",
        }

    def prepare(self, machine):
        title = self.values.title
        articles.put(machine, title, articles.shipped(title), self.values.edits)

    def initial_app(self, machine):
        return "chrome", articles.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from unlike(machine, self.values.path, [self.values.by, self.values.when])

    def oracle(self, hand):
        articles.open_history(hand, self.values.title)
        hand.find(("static", "section", "list-item"), self.values.comment, scroll=True)
        take_note(hand, self.values.path, f"{self.values.by}\n{self.values.when}")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit(articles.address(self.values.title, "history"), "First version"),
            f"wait for {quoted(self.values.comment)}",
            *plan_steps.take_note(self.values.path, f"{self.values.by}\n{self.values.when}"),
        ]

    def wrong_results(self):
        path, by, when, last = self.values.path, self.values.by, self.values.when, self.values.last
        return {
            "the latest edit": lambda m: m.write(path, f"{last['by']}\n{last['when']}"),
            "no date": lambda m: m.write(path, by),
            "another date": lambda m: m.write(path, f"{by}\n{last['when']}"),
            "turned round": lambda m: m.write(path, f"{when}\n{by}"),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f"{self.values.by} \n\n{self.values.when}.\n")


def moment(slot, minute):
    """Return a time, from 7 in the morning of 2 March on; a day has 16 slots of an hour."""
    return f"{2 + slot // 16} March 2026, {7 + slot % 16}:{minute}"
