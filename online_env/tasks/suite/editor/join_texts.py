"""Join two text files into a third, in Mousepad."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, text_editor
from online_env.tasks.kit.word_lists import CITIES, LAST_NAMES, sample
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
        first_side, two = sample(stream, ("east", "north", "south", "west"), 2)
        names = sample(stream, LAST_NAMES, 10)
        lines = [f"{name}, {stream.choice(CITIES)}" for name in names]
        cut = stream.integer(3, 7)
        folder = stream.choice(PLACES)
        return {
            "first": f"{kind}-{first_side}.txt",
            "second": f"{kind}-{two}.txt",
            "new": f"all {kind}.txt",
            "place": folder,
            "path": f"{folder}/all {kind}.txt",
            "texts": ("\n".join(lines[:cut]) + "\n", "\n".join(lines[cut:]) + "\n"),
        }

    def prepare(self, machine):
        for name, text in zip(
            (self.values.first, self.values.second), self.values.texts, strict=True
        ):
            machine.write(f"Documents/{name}", text)

    def initial_app(self, machine):
        return APP, machine.path(f"Documents/{self.values.first}")

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        text = machine.text(self.values.path)
        if text is None:
            yield f"there is no file {self.values.path}"
        elif lines(text) != lines("".join(self.values.texts)):
            yield f"{self.values.path} holds {text[:300]!r}"

    def oracle(self, hand):
        first, second = self.values.texts
        text_editor.bring(hand, f"Documents/{self.values.second}", APP)
        text_editor.wait_for_text(hand, second, APP)
        hand.press("ctrl", "a")
        hand.press("ctrl", "c")
        text_editor.begin(hand, f"Documents/{self.values.first}", first, APP)
        hand.press("ctrl", "end")
        hand.press("ctrl", "v")
        text_editor.wait_for_text(hand, first + second, APP)
        hand.press("ctrl", "shift", "s")
        hand.choose_file(self.values.path, "Save", APP)
        hand.find("frame", text_editor.title(self.values.path, saved=True), APP)

    def plan(self):
        first, second = self.values.texts
        return [
            'window "Mousepad"',
            *plan_steps.open_in_editor(f"Documents/{self.values.second}"),
            f"wait for {quoted(second.splitlines()[0])}",
            "press ctrl+a",
            "press ctrl+c",
            *plan_steps.open_in_editor(f"Documents/{self.values.first}"),
            f"wait for {quoted(first.splitlines()[0])}",
            "press ctrl+end",
            "press ctrl+v",
            "press ctrl+shift+s",
            *plan_steps.name_file(self.values.path),
            "wait",
        ]

    def wrong_results(self):
        path = self.values.path
        first, second = self.values.texts
        old = f"Documents/{self.values.first}"
        return {
            "the wrong order": lambda m: m.write(path, second + first),
            "only the first": lambda m: m.write(path, first),
            "added to the first": lambda m: m.write(old, first + second),
            "in the home folder": lambda m: m.write(self.values.new, first + second),
        }

    def right_result(self, machine):
        machine.write(self.values.path, "\n".join(self.values.texts))


def lines(text: str) -> list[str]:
    """Return the lines that are not blank, without blanks at their ends."""
    return [line.rstrip() for line in text.splitlines() if line.strip()]
