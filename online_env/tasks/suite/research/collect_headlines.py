"""Collect the headlines of a section or a day in a text file."""

from datetime import date

from online_env.embedded.sites.hosts.news import SECTIONS
from online_env.embedded.sites.hosts_and_dates import long_date
from online_env.embedded.sites.library import articles
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.notes import take_note, unlike
from online_env.tasks.kit.pages import arrived, follow, visit
from online_env.tasks.plan_words import quoted

DAYS = ("2026-03-02", "2026-03-03", "2026-03-04")


class CollectHeadlines(Task):
    """Two or three headlines, word by word, one a line."""

    name = "collect_headlines"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the newspaper cannot be reached"}
    phrasings = (
        "Collect the headlines of all articles at news.test {which} in the text file {path}, one"
        " a line.",
        "Please go through http://news.test and make a list of the headlines of the articles"
        " {which}: {path}, each in a line of its own, in any order.",
        "news.test: headlines {which}, one per line, into {path}.",
    )

    def draw(self, stream):
        wanted = stream.choice([*DAYS, "Local", "Science", "Culture"])
        by_section = wanted in SECTIONS
        found = [
            article.title
            for article in articles("news").values()
            if wanted in (article.head["section"], str(article.head["date"]))
        ]
        which = f"in the section {wanted}"
        if not by_section:
            which = f"of {long_date(date.fromisoformat(wanted))}"
        return {
            "section": wanted if by_section else "",
            "titles": found,
            "which": which,
            "path": f"Documents/headlines-{stream.integer(10, 99)}.txt",
        }

    def initial_app(self, machine):
        return "chrome", "http://news.test/"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from unlike(machine, self.values.path, self.values.titles, in_any_order=True)

    def oracle(self, hand):
        visit(hand, "http://news.test/", "The Morning Ledger")
        if self.values.section:
            follow(hand, self.values.section, self.values.section)
            for title in self.values.titles:
                hand.find("heading", title, scroll=True)
        else:
            for section in SECTIONS:  # the front page does not have the day of every article
                follow(hand, section)
                arrived(hand, section)
        take_note(hand, self.values.path, "\n".join(self.values.titles))

    def plan(self):
        steps = ['window "Chromium"']
        for section in [self.values.section] if self.values.section else SECTIONS:
            steps += [f"click {quoted(section)}", "wait"]
        return [*steps, *plan_steps.take_note(self.values.path, "\n".join(self.values.titles))]

    def wrong_results(self):
        path, titles = self.values.path, self.values.titles
        more = [a.title for a in articles("news").values() if a.title not in titles][:1]
        return {
            "one is missing": lambda m: m.write(path, "\n".join(titles[1:])),
            "one too many": lambda m: m.write(path, "\n".join([*titles, *more])),
            "all in one line": lambda m: m.write(path, "; ".join(titles)),
            "in another file": lambda m: m.write("headlines.txt", "\n".join(titles)),
        }

    def right_result(self, machine):
        lines = [f"- {title}\n" for title in reversed(self.values.titles)]
        machine.write(self.values.path, "\n".join(lines))
