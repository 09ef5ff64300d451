"""Write a text in Mousepad and save it under a given name."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import told
from online_env.tasks.kit.words import sample
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
        yield from machine.untouched(self.drawn.path)
        found = machine.text(self.drawn.path)
        if found is None:
            yield f"there is no file {self.drawn.path}"
        elif found.removesuffix("\n") != self.drawn.text:
            yield f"{self.drawn.path} holds {found[:200]!r}"

    def oracle(self, hand):
        hand.click_on("text", app="mousepad")
        hand.replace(self.drawn.text)
        hand.press("ctrl", "s")
        hand.choose_file(self.drawn.path, "Save", app="mousepad")
        hand.find("frame", re.compile(f"[^*]*{self.drawn.file}"))

    def plan(self):
        return [
            'window "Mousepad"',
            f"type {quoted(self.drawn.text)}",
            *told.save_as(self.drawn.path),
        ]

    def wrong(self):
        path, text = self.drawn.path, self.drawn.text
        return {
            "a line is missing": lambda m: m.write(path, text.rpartition("\n")[0]),
            "in the home folder": lambda m: m.write(self.drawn.file, text),
            "two line feeds at the end": lambda m: m.write(path, text + "\n\n"),
            "in another encoding": lambda m: m.write(path, text.encode("utf-16")),
        }

    def right(self, machine):
        machine.write(self.drawn.path, self.drawn.text + "\n")
