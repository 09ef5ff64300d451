"""Insert a line at a place of a text, in Mousepad."""

from online_env.tasks import Task
from online_env.tasks.kit import text_editor
from online_env.tasks.kit.word_lists import FIRST_NAMES, GOODS, sample
from online_env.tasks.plan_words import quoted

APP = "mousepad"
PLACES = ("Kitchen", "Workshop", "Cellar", "Attic", "Garage", "Office")
KEEPERS = 4


class InsertLine(Task):
    """A line goes below another one, which is once in the text, in a list with three parts."""

    name = "insert_line"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        'The text editor shows {file}. Insert a new line "{line}" directly below the line'
        ' "{above}" and save the file.',
        "{line}\n\nPlease add this to {file} in my Documents, on a line of its own right after"
        ' "{above}". Do not change anything else.',
        'In {file} (in Documents), the line "{above}" should be followed by a new line "{line}".'
        " Add it, then save.",
    )

    def draw(self, stream):
        lines = []
        names = sample(stream, FIRST_NAMES, 3 * KEEPERS)
        for part, heading in enumerate(sample(stream, PLACES, 3)):
            lines.append(f"== {heading} ==")
            keepers = names[part * KEEPERS : (part + 1) * KEEPERS]
            lines += [f"{stream.choice(GOODS)}: {keeper}" for keeper in keepers]
            lines.append("")
        lines.pop()
        at = stream.choice([i for i, line in enumerate(lines) if ":" in line])
        line = f"{stream.choice(GOODS)}: nobody (ask for room {stream.integer(10, 99)})"
        name = f"keepers-{stream.integer(2019, 2025)}.txt"
        return {
            "file": name,
            "path": f"Documents/{name}",
            "line": line,
            "above": lines[at],
            "number": at + 1,
            "text": join_lines(lines),
            "wanted": join_lines([*lines[: at + 1], line, *lines[at + 1 :]]),
        }

    def prepare(self, machine):
        machine.write(self.values.path, self.values.text)

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from text_editor.text_problems(machine, self.values.path, self.values.wanted)

    def oracle(self, hand):
        values = self.values
        text_editor.begin(hand, values.path, values.text, APP)
        text_editor.go_to_line(hand, values.path, values.number, APP)
        hand.press("end")
        hand.type(f"\n{values.line}")
        text_editor.wait_for_text(hand, values.wanted, APP)
        text_editor.save(hand, values.path, APP)

    def plan(self):
        return [
            'window "Mousepad"',
            "press ctrl+home",
            f"press down {self.values.number - 1} times",
            "press end",
            f"type {quoted(chr(10) + self.values.line)}",
            "press ctrl+s",
            "wait",
        ]

    def wrong_results(self):
        path, text = self.values.path, self.values.text
        line, above = self.values.line, self.values.above
        return {
            "above": lambda m: m.write(path, text.replace(above, f"{line}\n{above}")),
            "at the start": lambda m: m.write(path, f"{line}\n{text}"),
            "in its place": lambda m: m.write(path, text.replace(above, line)),
            "with an empty line": lambda m: m.write(
                path, text.replace(above, f"{above}\n\n{line}")
            ),
        }

    def right_result(self, machine):
        machine.write(self.values.path, self.values.wanted.rstrip("\n"))


def join_lines(lines) -> str:
    """Return the text of a file."""
    return "\n".join(lines) + "\n"
