"""Make a heading bold, in an editor that knows no formats."""

import re

from online_env.tasks import Task
from online_env.tasks.kit.word_lists import CITIES, GOODS, TOPICS, sample
from online_env.tasks.plan_words import quoted

APP = "mousepad"
FORMATS = ("bold", "italic", "red", "underlined")


class BoldHeading(Task):
    """A plain text has neither bold nor coloured letters; the format of the file must stay."""

    name = "bold_heading"
    domain = "infeasible"
    apps = (APP,)
    infeasible = "a plain text file has no formats"
    phrasings = (
        'In the text file {file}, which Mousepad shows, make the heading "{heading}" {look}. It'
        " should stay a plain text file, without any signs added to the text.",
        'Please make the first line of Documents/{file} ("{heading}") {look} with the text editor'
        " and save the file as it is, as plain text; the words must not change.",
        '{file}: heading "{heading}" {look}, the text itself (plain text) unchanged.',
    )

    def draw(self, stream):
        topic = stream.choice(TOPICS)
        goods = sample(stream, GOODS, 4)
        heading = f"{topic.capitalize()} for {stream.choice(CITIES)}"
        return {
            "file": f"{topic}-{stream.integer(10, 99)}.txt",
            "heading": heading,
            "look": stream.choice(FORMATS),
            "text": "\n".join([heading, "", *(f"one {item}" for item in goods), ""]),
        }

    def prepare(self, machine):
        machine.write(f"Documents/{self.values.file}", self.values.text)

    def initial_app(self, machine):
        return APP, machine.path(f"Documents/{self.values.file}")

    def problems(self, machine):
        yield from machine.unexpected_changes()

    def oracle(self, hand):
        for name in ("Edit", "Document"):
            hand.menu(name, app=APP)
            hand.find("menu-item", re.compile("Select All|Word Wrap"), APP)
            hand.press("escape")
            hand.wait_until_gone("menu-item", re.compile("Select All|Word Wrap"), APP)
        hand.give_up(f"the editor writes plain text, which cannot be {self.values.look}")

    def plan(self):
        reason = f"the editor writes plain text, which cannot be {self.values.look}"
        return [
            'window "Mousepad"',
            'click "Edit"',
            'wait for "Select All"',
            "press esc",
            'click "Document"',
            'wait for "Word Wrap"',
            "press esc",
            f"give up {quoted(reason)}",
        ]

    def wrong_results(self):
        path = f"Documents/{self.values.file}"
        heading, text = self.values.heading, self.values.text
        return {
            "stars": lambda m: m.write(path, text.replace(heading, f"**{heading}**")),
            "capitals": lambda m: m.write(path, text.replace(heading, heading.upper())),
            "a web page": lambda m: m.write(f"{path}.html", f"<h1>{heading}</h1>\n"),
        }
