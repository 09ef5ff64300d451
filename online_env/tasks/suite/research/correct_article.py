"""Correct a mistake in an article of the wiki."""

from online_env.tasks import Task
from online_env.tasks.kit import articles, plan_steps
from online_env.tasks.kit.pages import arrived, enter, follow, visit
from online_env.tasks.kit.word_lists import even
from online_env.tasks.plan_words import quoted

MISTAKES = (
    ("Chess", "64 squares", ("46 squares", "81 squares", "100 squares")),
    ("Chess", "fifteenth century", ("sixteenth century", "tenth century")),
    ("Bicycle", "in 1817", ("in 1871", "in 1718", "in 1917")),
    ("Lighthouse", "In 1822", ("In 1922", "In 1282", "In 1872")),
    ("Telescope", "in 1608", ("in 1806", "in 1680", "in 1508")),
    ("Paper", "eighth century", ("eighteenth century", "sixth century")),
    ("Sourdough", "300 g water", ("30 g water", "3000 g water", "500 g water")),
    ("Tea", "three minutes", ("thirteen minutes", "thirty minutes")),
    ("Honey bee", "in 1973", ("in 1937", "in 1793")),
    ("Suspension bridge", "In 1940", ("In 1904", "In 1840", "In 2040")),
    ("Aurora", "110 kilometres", ("11 kilometres", "1100 kilometres")),
)
SUMMARIES = ("Corrected a figure", "Slip of the pen", "Fixed a typo", "Checked with a book")


class CorrectArticle(Task):
    """A few words of a long text change, and the comment says why; nothing else does."""

    name = "correct_article"
    domain = "research"
    apps = ("chrome",)
    sites = ("wiki",)
    unsolvable = {"network_error": "the wiki cannot be reached"}
    phrasings = (
        'In the wiki.test article "{title}", somebody wrote "{wrong}"; it should be "{right_}".'
        ' Correct that, and put "{summary}" into the field for what you changed.',
        'Please edit "{title}" on http://wiki.test: replace "{wrong}" by "{right_}", leave the'
        ' rest of the text alone, and describe the change as "{summary}".',
        'wiki.test, article "{title}": "{wrong}" is a mistake for "{right_}". Fix it, with the'
        ' comment "{summary}".',
    )

    def draw(self, stream):
        title, right, wrongs = stream.choice(MISTAKES)
        wrong = stream.choice(wrongs)
        body = articles.shipped(title)
        return {
            "title": title,
            "right_": right,
            "wrong": wrong,
            "summary": stream.choice(SUMMARIES),
            "wanted": body,
            "spoilt": body.replace(right, wrong),
        }

    def prepare(self, machine):
        articles.put(machine, self.values.title, self.values.spoilt)

    def initial_app(self, machine):
        return "chrome", articles.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes()
        for title in articles.others(machine, self.values.title):
            yield f"the article {title} was changed"
        if not articles.same(articles.text(machine, self.values.title), self.values.wanted):
            yield f"the article {self.values.title} is not as it should be"
        comment = articles.comment(machine, self.values.title)
        if even(comment) != even(self.values.summary):
            yield f"the comment is {comment!r}"

    def oracle(self, hand):
        visit(hand, articles.address(self.values.title), self.values.title)
        follow(hand, "Edit", "Editing")
        enter(hand, "Text", self.values.wanted)
        enter(hand, "What did you change?", self.values.summary)
        follow(hand, "Save changes")
        arrived(hand, f"{self.values.title} - Openfolio")

    def plan(self):
        title = self.values.title
        return [
            'window "Chromium"',
            *plan_steps.visit(articles.address(title), title),
            'click "Edit" near "Read"',
            'wait for "Editing"',
            'click below "Text"',
            "press ctrl+a",
            f"type {quoted(self.values.wanted)}",
            "press tab",
            f"type {quoted(self.values.summary)}",
            "press enter",
            "wait",
        ]

    def wrong_results(self):
        def save(title, body, summary):
            changes = ({"summary": ""}, {"summary": summary})
            return lambda m: articles.put(m, title, body, changes)

        title, wanted, summary = self.values.title, self.values.wanted, self.values.summary
        short = f"The figure is {self.values.right_}."
        return {
            "no comment": save(title, wanted, ""),
            "only the comment": save(title, self.values.spoilt, summary),
            "the rest is gone": save(title, short, summary),
            "the headings are gone": save(title, " ".join(wanted.split()), summary),
            "another article": save("Tide", wanted, summary),
        }

    def right_result(self, machine):
        changes = ({"summary": ""}, {"summary": ""}, {"summary": self.values.summary})
        articles.put(machine, self.values.title, self.values.wanted + "\n", changes)
