"""Look a fact up in the encyclopedia and save it."""

from online_env.embedded.sites.library import articles
from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.articles import address
from online_env.tasks.kit.notes import take_note, unlike
from online_env.tasks.kit.pages import arrived, enter, visit
from online_env.tasks.plan_words import quoted


class LookUpFact(Task):
    """One line of the box of facts of one article goes into a text file."""

    name = "look_up_fact"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the encyclopedia cannot be reached"}
    phrasings = (
        'Look up "{title}" in the encyclopedia at wiki.test. What does the box with the facts say'
        ' under "{key}"? Save just that, as it is there, in {path}.',
        'In the wiki.test article "{title}" there is a table of facts. Please put what stands'
        ' beside "{key}" into a text file {path}, and nothing else.',
        'What does the fact box of wiki.test\'s article on {title} have beside "{key}"? Write only'
        " that to {path}.",
    )

    def draw(self, stream):
        article = stream.choice(list(articles("wiki").values()))
        key, value = stream.choice(list(article.head["facts"].items()))
        path = f"Documents/{article.slug.lower()}-{stream.integer(10, 99)}.txt"
        return {"title": article.title, "key": key, "answer": str(value), "path": path}

    def initial_app(self, machine):
        return "chrome", "http://wiki.test/"

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from unlike(machine, self.values.path, [self.values.answer])

    def oracle(self, hand):
        visit(hand, "http://wiki.test/", "Openfolio")
        enter(hand, "Search Openfolio", self.values.title)
        hand.press("enter")
        arrived(hand, f"{self.values.title} - Openfolio")
        hand.find("static", self.values.answer, scroll=True)
        take_note(hand, self.values.path, self.values.answer)

    def plan(self):
        return [
            'window "Chromium"',
            'click "Search Openfolio"',
            f"type {quoted(self.values.title)}",
            "press enter",
            f"scroll down to {quoted(self.values.answer)}",
            *plan_steps.take_note(self.values.path, self.values.answer),
        ]

    def wrong_results(self):
        path, answer = self.values.path, self.values.answer
        return {
            "in another file": lambda m: m.write("Documents/fact.txt", answer),
            "with its name": lambda m: m.write(path, f"{self.values.key}: {answer}"),
            "the address instead": lambda m: m.write(path, address(self.values.title)),
            "an empty file": lambda m: m.write(path, ""),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f"{self.values.answer}\n")
