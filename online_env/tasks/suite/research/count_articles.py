"""Count the articles of two subjects, in a newspaper or an encyclopedia."""

from collections import Counter

from online_env.embedded.sites.library import articles
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.notes import take_note, unlike
from online_env.tasks.kit.pages import follow, visit
from online_env.tasks.kit.word_lists import sample


class CountArticles(Task):
    """The sections of a newspaper, or the subjects of an encyclopedia, are counted and added."""

    name = "count_articles"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the site cannot be reached"}
    phrasings = (
        "How many articles are there at {host} under {first} and {second} together? Save just the"
        " number in {path}.",
        'Please count the articles on http://{host} that are filed under "{first}" or "{second}",'
        " and write the sum of both to {path}, just the number.",
        "{host}: number of articles under {first} plus number under {second}. Only the total, in"
        " figures, into {path}.",
    )

    def draw(self, stream):
        is_news = bool(stream.integer(0, 1))
        folder, key = ("news", "section") if is_news else ("wiki", "category")
        counts = Counter(article.head[key] for article in articles(folder).values())
        chosen = sample(stream, sorted(counts), 2)
        return {
            "is_news": is_news,
            "host": f"{folder}.test",
            "first": chosen[0],
            "second": chosen[1],
            "one": counts[chosen[0]],
            "total": sum(counts[name] for name in chosen),
            "all": counts.total(),
            "path": f"Documents/count-{stream.integer(10, 99)}.txt",
        }

    def initial_app(self, machine):
        return "chrome", f"http://{self.values.host}/"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from unlike(machine, self.values.path, [str(self.values.total)])

    def oracle(self, hand):
        visit(
            hand, f"http://{self.values.host}/", "The Morn" if self.values.is_news else "Openfolio"
        )
        for name in (self.values.first, self.values.second):
            if self.values.is_news:
                follow(hand, name, name)
            else:
                hand.find("heading", name, scroll=True)
        take_note(hand, self.values.path, str(self.values.total))

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.take_note(self.values.path, str(self.values.total)),
        ]

    def wrong_results(self):
        path, drawn = self.values.path, self.values
        return {
            "one of the two": lambda m: m.write(path, f"{drawn.one}"),
            "all": lambda m: m.write(path, f"{drawn.all}"),
            "both apart": lambda m: m.write(path, f"{drawn.one}\n{drawn.total - drawn.one}"),
            "in another file": lambda m: m.write("count.txt", f"{drawn.total}"),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f" {self.values.total} \n")
