"""Compare two articles of the wiki and save the difference."""

from online_env.tasks import Task
from online_env.tasks.kit import articles, plan_steps
from online_env.tasks.kit.notes import line_problems, take_note
from online_env.tasks.kit.pages import visit
from online_env.tasks.kit.word_lists import sample
from online_env.tasks.plan_words import quoted

FERRIES = ("Heron", "Puffin", "Cormorant", "Avocet", "Plover", "Sandpiper", "Tern", "Curlew")
# What is compared, and how an article puts it.
MEASURES = (
    ("carries more passengers", "It carries {} passengers.", (80, 900)),
    ("is longer, in metres", "It is {} metres long.", (22, 160)),
    ("has made more crossings", "It has made {} crossings so far.", (400, 9000)),
    ("carries more bicycles", "There is room for {} bicycles.", (5, 95)),
)


class CompareFerries(Task):
    """Two figures in two long articles; the name of the larger and the difference are wanted."""

    name = "compare_ferries"
    domain = "research"
    apps = ("chrome", "mousepad")
    unsolvable = {"network_error": "the wiki cannot be reached"}
    phrasings = (
        "At wiki.test there are articles about the ferries {one} and {two}. Which of them {what},"
        " and by how much? Save two lines in {path}: the name of that ferry, then the difference"
        " as a number.",
        "Compare the wiki.test articles Ferry {one} and Ferry {two}: which ferry {what}? Write its"
        " name in the first line of {path} and the difference (just the number) in the second.",
        "I want to know which ferry {what}, {one} or {two} (see wiki.test). Put the name and, on"
        " the next line, the difference (only its figure) into {path}.",
    )

    def draw(self, stream):
        names = sample(stream, FERRIES, 3)
        index = stream.integer(0, len(MEASURES) - 1)
        figures = {name: [stream.integer(*limits) for *_, limits in MEASURES] for name in names}
        first_name, two = names[:2]
        if figures[first_name][index] == figures[two][index]:
            figures[first_name][index] += 1
        larger = max((first_name, two), key=lambda name: figures[name][index])
        return {
            "figures": figures,
            "one": first_name,
            "two": two,
            "what": MEASURES[index][0],
            "larger": larger,
            "smaller": two if larger == first_name else first_name,
            "difference": abs(figures[first_name][index] - figures[two][index]),
            "path": f"Documents/ferries-{stream.integer(10, 99)}.txt",
        }

    def prepare(self, machine):
        for name, figures in self.values.figures.items():
            sentences = [text.format(n) for (_, text, _), n in zip(MEASURES, figures, strict=True)]
            lead = f"The **{name}** is a ferry in the harbour of Port Alder."
            articles.store_article(machine, f"Ferry {name}", "\n\n".join([lead, *sentences]))

    def initial_app(self, machine):
        return "chrome", articles.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        line_problems_found = list(line_problems(machine, self.values.path, self.lines()))
        accepted_words = [f"Ferry {self.values.larger}", str(self.values.difference)]
        if line_problems_found and list(line_problems(machine, self.values.path, accepted_words)):
            yield from line_problems_found

    def lines(self):
        return [self.values.larger, str(self.values.difference)]

    def oracle(self, hand):
        visit(hand, "http://wiki.test/all", "All articles")
        for name in (self.values.one, self.values.two):
            title = f"Ferry {name}"
            visit(hand, articles.address(title), title)
            hand.find("heading", title)
        take_note(hand, self.values.path, "\n".join(self.lines()))

    def plan(self):
        index = [measure for measure, *_ in MEASURES].index(self.values.what)
        steps = ['window "Chromium"']
        for name in (self.values.one, self.values.two):
            figure = str(self.values.figures[name][index])
            steps += plan_steps.visit(articles.address(f"Ferry {name}"), f"Ferry {name}")
            steps.append(f"wait for {quoted(figure)}")
        return [*steps, *plan_steps.take_note(self.values.path, "\n".join(self.lines()))]

    def wrong_results(self):
        path, values = self.values.path, self.values
        return {
            "the other ferry": lambda m: m.write(path, f"{values.smaller}\n{values.difference}"),
            "only the name": lambda m: m.write(path, values.larger),
            "another difference": lambda m: m.write(
                path, f"{values.larger}\n{values.difference + 1}"
            ),
            "the lines changed round": lambda m: m.write(
                path, f"{values.difference}\n{values.larger}"
            ),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f"Ferry {self.values.larger}\n\n{self.values.difference}\n")
