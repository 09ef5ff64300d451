"""Comment out a function of a program, in Geany."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import text_editor
from online_env.tasks.kit.word_lists import GOODS, sample

APP = "geany"
NAMES = ("count", "price", "weigh", "order", "pack", "label", "store", "check")


class CommentOutFunction(Task):
    """Each line of one of four functions begins with a number sign; the others work on."""

    name = "comment_out_function"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        "In the Python file {file}, which Geany shows, comment out the whole function {function}"
        " (put # before each of its lines) and save the file. Do not delete anything.",
        "Please switch off {function} in Documents/{file} by making all of its lines comments."
        " Nothing else changes. Save the file.",
        "Comment out {function} in {file}, all lines of the function and no other line, then save.",
    )

    def draw(self, stream):
        goods = sample(stream, GOODS, 4)
        verbs = sample(stream, NAMES, 4)
        functions = [f"{verb}_{item}" for verb, item in zip(verbs, goods, strict=True)]
        bodies = [source(stream, function) for function in functions]
        index = stream.integer(0, 3)
        lines = ["import math", "", ""]
        start = 0
        for number, body in enumerate(bodies):
            if number == index:
                start = len(lines)
            lines += [*body, "", ""]
        name = f"{stream.choice(GOODS)}_tools.py"
        return {
            "file": name,
            "path": f"Documents/{name}",
            "function": functions[index],
            "start": start,
            "end": start + len(bodies[index]),
            "lines": lines[:-2],
        }

    def prepare(self, machine):
        machine.write(self.values.path, join_lines(self.values.lines))

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        start, end, lines = self.values.start, self.values.end, self.values.lines
        actual = (machine.text(self.values.path) or "").rstrip("\n").split("\n")
        if len(actual) != len(lines):
            yield f"{self.values.path} has {len(actual)} lines, not {len(lines)}"
            return
        for index, (line, old) in enumerate(zip(actual, lines, strict=True)):
            inside = start <= index < end
            if inside and not is_commented(line, old):
                yield f"line {index + 1} is not made a comment: {line!r}"
            elif not inside and line.rstrip() != old:
                yield f"line {index + 1} was changed: {line!r}"

    def oracle(self, hand):
        values = self.values
        text_editor.begin(hand, values.path, join_lines(values.lines), APP)
        text_editor.go_to_line(hand, values.path, values.start + 1, APP)
        hand.press("home")
        for _ in range(values.start, values.end):
            hand.press("shift", "down")
        hand.press("ctrl", "e")
        hand.wait(
            "commented function",
            lambda node: node.role == "text" and f"# ~ def {values.function}" in node.text,
        )
        text_editor.save(hand, values.path, APP)

    def plan(self):
        start, end = self.values.start, self.values.end
        return [
            'window "Geany"',
            "press ctrl+home",
            f"press down {start} times",
            f"press shift+down {end - start} times",
            "press ctrl+e",
            "press ctrl+s",
            "wait",
        ]

    def wrong_results(self):
        path, lines = self.values.path, self.values.lines
        start, end = self.values.start, self.values.end
        first = comment_lines(lines, start, start + 1)
        return {
            "only its first line": lambda m: m.write(path, join_lines(first)),
            "deleted": lambda m: m.write(path, join_lines([*lines[:start], *lines[end:]])),
            "all lines": lambda m: m.write(path, join_lines(comment_lines(lines, 0, len(lines)))),
            "as a string": lambda m: m.write(path, triple_quote_lines(lines, start, end)),
        }

    def right_result(self, machine):
        lines = comment_lines(self.values.lines, self.values.start, self.values.end)
        machine.write(self.values.path, "\n".join(lines))


def source(stream, function) -> list[str]:
    """Return the lines of a function."""
    first, second = stream.integer(2, 9), stream.integer(10, 99)
    if stream.integer(0, 1):
        return [
            f"def {function}(number):",
            f"    whole = number * {first}",
            f"    if whole > {second}:",
            f"        return math.sqrt({second})",
            "    return whole",
        ]
    return [
        f"def {function}(width, height):",
        f"    area = width * height - {second}",
        f"    return math.floor(area / {first})",
    ]


def is_commented(line: str, old: str) -> bool:
    """Return whether a line is another one, made a comment."""
    return line.strip().startswith("#") and re.sub(r"^\s*#+\s*~?", "", line).split() == old.split()


def comment_lines(lines, start, end) -> list[str]:
    """Return the lines, some of which begin with a number sign."""
    commented = [f"# {line}" if line else line for line in lines[start:end]]
    return [*lines[:start], *commented, *lines[end:]]


def triple_quote_lines(lines, start, end) -> str:
    """Return the text with some lines in quotes."""
    return join_lines([*lines[:start], '"""', *lines[start:end], '"""', *lines[end:]])


def join_lines(lines) -> str:
    """Return the text of a file."""
    return "\n".join(lines) + "\n"
