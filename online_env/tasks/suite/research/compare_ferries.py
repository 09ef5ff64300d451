"""Compare two articles of the wiki and save the difference."""

from online_env.tasks import Task
from online_env.tasks.kit import articles, plan_steps
from online_env.tasks.kit.notes import take_note, unlike
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
        chosen = stream.integer(0, len(MEASURES) - 1)
        figures = {name: [stream.integer(*limits) for *_, limits in MEASURES] for name in names}
        one, two = names[:2]
        if figures[one][chosen] == figures[two][chosen]:
            figures[one][chosen] += 1
        larger = max((one, two), key=lambda name: figures[name][chosen])
        return {
            "figures": figures,
            "one": one,
            "two": two,
            "what": MEASURES[chosen][0],
            "larger": larger,
            "smaller": two if larger == one else one,
            "difference": abs(figures[one][chosen] - figures[two][chosen]),
            "path": f"Documents/ferries-{stream.integer(10, 99)}.txt",
        }

    def prepare(self, machine):
        for name, figures in self.values.figures.items():
            said = [text.format(n) for (_, text, _), n in zip(MEASURES, figures, strict=True)]
            lead = f"The **{name}** is a ferry in the harbour of Port Alder."
            articles.put(machine, f"Ferry {name}", "\n\n".join([lead, *said]))

    def initial_app(self, machine):
        return "chrome", articles.SITE

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        found = list(unlike(machine, self.values.path, self.lines()))
        whole = [f"Ferry {self.values.larger}", str(self.values.difference)]
        if found and list(unlike(machine, self.values.path, whole)):
            yield from found

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
        chosen = [what for what, *_ in MEASURES].index(self.values.what)
        steps = ['window "Chromium"']
        for name in (self.values.one, self.values.two):
            figure = str(self.values.figures[name][chosen])
            steps += plan_steps.visit(articles.address(f"Ferry {name}"), f"Ferry {name}")
            steps.append(f"wait for {quoted(figure)}")
        return [*steps, *plan_steps.take_note(self.values.path, "\n".join(self.lines()))]

    def wrong_results(self):
        path, drawn = self.values.path, self.values
        return {
            "the other ferry": lambda m: m.write(path, f"{drawn.smaller}\n{drawn.difference}"),
            "only the name": lambda m: m.write(path, drawn.larger),
            "another difference": lambda m: m.write(
                path, f"{drawn.larger}\n{drawn.difference + 1}"
            ),
            "the lines changed round": lambda m: m.write(
                path, f"{drawn.difference}\n{drawn.larger}"
            ),
        }

    def right_result(self, machine):
        machine.write(self.values.path, f"Ferry {self.values.larger}\n\n{self.values.difference}\n")
