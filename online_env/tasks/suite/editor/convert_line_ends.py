"""Save a text with the line ends of another system, in Mousepad."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import text_editor
from online_env.tasks.kit.word_lists import CITIES, GOODS, LAST_NAMES, sample
from online_env.tasks.plan_words import quoted

APP = "mousepad"
KINDS = ("export", "stock", "list", "orders")
ENDS = {"Windows": "\r\n", "Unix": "\n"}
ITEMS = {"Windows": re.compile("DOS / Windows"), "Unix": re.compile("Unix")}


class ConvertLineEnds(Task):
    """A list for Unix becomes one for Windows, or the other way round; its text stays."""

    name = "convert_line_ends"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        "The text editor shows {file}. Save it with the line ends of {system} ({signs}); the text"
        " itself stays as it is.",
        "{file} in my Documents has the wrong line endings for {system}: they should be {signs}."
        " Please convert the file; I need it under the same name.",
        "Convert the line endings of Documents/{file} to {system} ({signs}) and save.",
    )

    def draw(self, stream):
        system = stream.choice(list(ENDS))
        lines = [
            f"{stream.integer(1000, 9999)};{item};{name};{stream.choice(CITIES)}"
            for item, name in zip(
                sample(stream, GOODS, 7), sample(stream, LAST_NAMES, 7), strict=True
            )
        ]
        name = f"{stream.choice(KINDS)}-{stream.integer(10, 99)}.csv"
        return {
            "file": name,
            "path": f"Documents/{name}",
            "system": system,
            "signs": {"Windows": "CR LF", "Unix": "LF"}[system],
            "lines": lines,
        }

    def prepare(self, machine):
        for system, end in ENDS.items():
            if system != self.values.system:
                machine.write(self.values.path, with_line_ends(self.values.lines, end))

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from text_editor.text_problems(
            machine, self.values.path, with_line_ends(self.values.lines, "\n")
        )
        data = machine.read(self.values.path) or b""
        expected = ENDS[self.values.system].encode()
        wrong_ends = {end for end in re.findall(rb"\r\n|\n|\r", data) if end != expected}
        if wrong_ends:
            yield f"{self.values.path} has lines that end with {sorted(wrong_ends)}"

    def oracle(self, hand):
        text_editor.bring(hand, self.values.path, APP)
        hand.menu("Document", re.compile("Line Ending"), ITEMS[self.values.system], app=APP)
        hand.wait_until_gone("menu-item", re.compile("Unix"), APP)
        text_editor.save(hand, self.values.path, APP)

    def plan(self):
        item = {"Windows": "DOS / Windows", "Unix": "Unix (LF)"}[self.values.system]
        return [
            'window "Mousepad"',
            'click "Document"',
            'click "Line Ending"',
            f"click {quoted(item)}",
            "press ctrl+s",
            "wait",
        ]

    def wrong_results(self):
        path, lines = self.values.path, self.values.lines
        end = ENDS[self.values.system]
        return {
            "in a copy": lambda m: m.write(f"{path}.txt", with_line_ends(lines, end)),
            "as on old Macs": lambda m: m.write(path, with_line_ends(lines, "\r")),
            "both one after the other": lambda m: m.write(path, with_line_ends(lines, "\n\r\n")),
            "a line is gone": lambda m: m.write(path, with_line_ends(lines[1:], end)),
        }

    def right_result(self, machine):
        end = ENDS[self.values.system]
        machine.write(self.values.path, end.join(self.values.lines))


def with_line_ends(lines, end) -> str:
    """Return a text whose lines all have an end."""
    return "".join(f"{line}{end}" for line in lines)
