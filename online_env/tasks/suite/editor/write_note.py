"""Write a text in Mousepad and save it under a given name."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.word_lists import sample
from online_env.tasks.plan_words import quoted

TOPICS = ("shopping", "meeting", "travel", "garden", "reading", "repairs")
LINES = (
    "Tel. Zoë Müller: +49 (0)351 4711",
    "50 % off: 12 < 15 & 15 > 12",
    "Crème brûlée, naïve café, jalapeño",
    'Meet at 7:30, "Blue Door", 2nd floor',
    "Σύνολο: 42,50 € (paid)",
    "Поезд в 18:45, вагон 7",
    "Åse & Łukasz bring the #2 box",
    "path = ~/notes/[draft]_{v2}.txt",
    "Søren's list: milk; tea; 3 × bread",
)


class WriteNote(Task):
    """Two or three lines, with characters that no key has, into a file in `Documents`."""

    name = "write_note"
    domain = "editor"
    apps = ("mousepad",)
    phrasings = (
        "In the text editor Mousepad, which is open, write exactly the following text and save it"
        " as {file} in the folder Documents of your home:\n\n{text}",
        "Please make a note for me: a text file {file} in Documents, with just these lines:"
        "\n\n{text}",
        "Save these lines, as they are, in a new file named {file} in my Documents folder:"
        "\n\n{text}",
    )

    def draw(self, stream):
        name = f"{stream.choice(TOPICS)}-{stream.integer(10, 99)}.txt"
        text = "\n".join(sample(stream, LINES, stream.integer(2, 3)))
        return {"file": name, "text": text, "path": f"Documents/{name}"}

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        found = machine.text(self.values.path)
        if found is None:
            yield f"there is no file {self.values.path}"
        elif found.removesuffix("\n") != self.values.text:
            yield f"{self.values.path} holds {found[:200]!r}"

    def oracle(self, hand):
        hand.click_on("text", app="mousepad")
        hand.replace(self.values.text)
        hand.press("ctrl", "s")
        hand.choose_file(self.values.path, "Save", app="mousepad")
        hand.find("frame", re.compile(f"[^*]*{self.values.file}"))

    def plan(self):
        return [
            'window "Mousepad"',
            f"type {quoted(self.values.text)}",
            *plan_steps.save_as(self.values.path),
        ]

    def wrong_results(self):
        path, text = self.values.path, self.values.text
        return {
            "a line is missing": lambda m: m.write(path, text.rpartition("\n")[0]),
            "in the home folder": lambda m: m.write(self.values.file, text),
            "two line feeds at the end": lambda m: m.write(path, text + "\n\n"),
            "in another encoding": lambda m: m.write(path, text.encode("utf-16")),
        }

    def right_result(self, machine):
        machine.write(self.values.path, self.values.text + "\n")
