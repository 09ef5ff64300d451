"""Join two text files into a third, in Mousepad."""

from online_env.tasks import Task
from online_env.tasks.kit import text_editor, told
from online_env.tasks.kit.words import CITIES, LAST_NAMES, sample
from online_env.tasks.plan_words import quoted

APP = "mousepad"
KINDS = ("guests", "members", "readers", "drivers", "helpers")
PLACES = ("Documents", "Downloads", "Desktop")


class JoinTexts(Task):
    """The lines of one file and then those of another, in a new file; both files stay."""

    name = "join_texts"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        "There are two lists in Documents: {first} and {second}. Make a third file {new} in the"
        " folder {place} of your home, which holds the lines of {first} and below them those of"
        " {second}. The two lists stay as they are.",
        "Please put {first} and {second} (both in Documents) together in one file, in this order,"
        " and save it as {place}/{new}. I still need the two old files.",
        "Join Documents/{first} and Documents/{second}: first the lines of the one, then those of"
        " the other, and nothing else. The result goes to {new} in {place}.",
    )

    def draw(self, stream):
        kind = stream.choice(KINDS)
        one, two = sample(stream, ("east", "north", "south", "west"), 2)
        names = sample(stream, LAST_NAMES, 10)
        lines = [f"{name}, {stream.choice(CITIES)}" for name in names]
        cut = stream.integer(3, 7)
        place = stream.choice(PLACES)
        return {
            "first": f"{kind}-{one}.txt",
            "second": f"{kind}-{two}.txt",
            "new": f"all {kind}.txt",
            "place": place,
            "path": f"{place}/all {kind}.txt",
            "texts": ("\n".join(lines[:cut]) + "\n", "\n".join(lines[cut:]) + "\n"),
        }

    def prepare(self, machine):
        for name, text in zip((self.drawn.first, self.drawn.second), self.drawn.texts, strict=True):
            machine.write(f"Documents/{name}", text)

    def opens(self, machine):
        return APP, machine.path(f"Documents/{self.drawn.first}")

    def problems(self, machine):
        yield from machine.untouched(self.drawn.path)
        found = machine.text(self.drawn.path)
        if found is None:
            yield f"there is no file {self.drawn.path}"
        elif lines(found) != lines("".join(self.drawn.texts)):
            yield f"{self.drawn.path} holds {found[:300]!r}"

    def oracle(self, hand):
        first, second = self.drawn.texts
        text_editor.bring(hand, f"Documents/{self.drawn.second}", APP)
        text_editor.wait_for_text(hand, second, APP)
        hand.press("ctrl", "a")
        hand.press("ctrl", "c")
        text_editor.begin(hand, f"Documents/{self.drawn.first}", first, APP)
        hand.press("ctrl", "end")
        hand.press("ctrl", "v")
        text_editor.wait_for_text(hand, first + second, APP)
        hand.press("ctrl", "shift", "s")
        hand.choose_file(self.drawn.path, "Save", APP)
        hand.find("frame", text_editor.title(self.drawn.path, saved=True), APP)

    def plan(self):
        first, second = self.drawn.texts
        return [
            'window "Mousepad"',
            *told.open_in_editor(f"Documents/{self.drawn.second}"),
            f"wait for {quoted(second.splitlines()[0])}",
            "press ctrl+a",
            "press ctrl+c",
            *told.open_in_editor(f"Documents/{self.drawn.first}"),
            f"wait for {quoted(first.splitlines()[0])}",
            "press ctrl+end",
            "press ctrl+v",
            "press ctrl+shift+s",
            *told.name_file(self.drawn.path),
            "wait",
        ]

    def wrong(self):
        path = self.drawn.path
        first, second = self.drawn.texts
        old = f"Documents/{self.drawn.first}"
        return {
            "the wrong order": lambda m: m.write(path, second + first),
            "only the first": lambda m: m.write(path, first),
            "added to the first": lambda m: m.write(old, first + second),
            "in the home folder": lambda m: m.write(self.drawn.new, first + second),
        }

    def right(self, machine):
        machine.write(self.drawn.path, "\n".join(self.drawn.texts))


def lines(text: str) -> list[str]:
    """Return the lines that are not blank, without blanks at their ends."""
    return [line.rstrip() for line in text.splitlines() if line.strip()]
