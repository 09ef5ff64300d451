"""Write a new article of the wiki."""

from online_env.tasks import Task
from online_env.tasks.kit import articles, plan_steps
from online_env.tasks.kit.pages import enter, follow, visit, wait_for_page
from online_env.tasks.plan_words import quoted

PLACES = ("Gull Rock", "Sorrel Hill", "Weir Street", "Quay Row", "Otter Creek", "Bell Island")
THINGS = ("lighthouse", "foot bridge", "bakery", "observatory", "ferry pier", "water mill")
ENDS = (
    "It is closed on Mondays.",
    "Nobody knows who drew the plans.",
    "A tram stops at the door.",
    "School classes visit it every spring.",
)


class WriteArticle(Task):
    """A title that the wiki does not have, and two paragraphs with a heading between them."""

    name = "write_article"
    domain = "research"
    apps = ("chrome",)
    sites = ("wiki",)
    unsolvable = {"network_error": "the wiki cannot be reached"}
    phrasings = (
        'Write a new article "{title}" in the encyclopedia at wiki.test, with this text:\n\n{text}',
        'wiki.test has no article "{title}" yet. Please make one; it should read:\n\n{text}',
        "Add an article to http://wiki.test. Title: {title}. Text (the line with ## is a"
        " heading):\n\n{text}",
    )

    def draw(self, stream):
        site, building = stream.choice(PLACES), stream.choice(THINGS)
        title = f"{site} {building}"
        year, height = stream.integer(1790, 1990), stream.integer(4, 60)
        text = (
            f"The **{title}** in Port Alder was built in {year} and is {height} metres high.\n\n"
            f"## Visitors\n\n{stream.integer(2, 90)} people came on the first day."
            f" {stream.choice(ENDS)}"
        )
        return {"title": title, "text": text}

    def initial_app(self, machine):
        return "chrome", articles.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes()
        for title in articles.unexpected_article_changes(machine, self.values.title):
            yield f"the article {title} was changed"
        text = articles.text(machine, self.values.title)
        if not articles.same(text, self.values.text):
            yield f"the article {self.values.title} reads {text[:300]!r}"

    def oracle(self, hand):
        title = self.values.title
        visit(hand, "http://wiki.test/all", "All articles")
        visit(hand, articles.address(title), title)
        follow(hand, ("Write it" if hand.see("link", "Write it") else "Edit"), "Editing")
        enter(hand, "Text", self.values.text)
        follow(hand, "Save changes")
        wait_for_page(hand, f"{title} - Openfolio")

    def plan(self):
        title = self.values.title
        return [
            'window "Chromium"',
            *plan_steps.visit(articles.address(title), "Write it"),
            'click "Write it"',
            'wait for "Editing"',
            'click below "Text"',
            "press ctrl+a",
            f"type {quoted(self.values.text)}",
            'scroll down to "Save changes"',
            'click "Save changes"',
            "wait",
        ]

    def wrong_results(self):
        title, text = self.values.title, self.values.text
        return {
            "without a heading": lambda m: articles.store_article(
                m, title, text.replace("## ", "")
            ),
            "all in one line": lambda m: articles.store_article(m, title, " ".join(text.split())),
            "half of it": lambda m: articles.store_article(m, title, text.partition("\n\n")[0]),
            "another title": lambda m: articles.store_article(m, title.partition(" ")[0], text),
            "added to an article": lambda m: articles.store_article(m, "Tide", text),
        }

    def right_result(self, machine):
        articles.store_article(
            machine, self.values.title, self.values.text.replace("\n\n", "\n\n\n") + "\n"
        )
