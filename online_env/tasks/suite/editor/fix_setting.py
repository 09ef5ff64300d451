"""Give a setting of a configuration file another value, in Geany."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import text_editor
from online_env.tasks.kit.word_lists import sample, shuffled
from online_env.tasks.plan_words import quoted

APP = "geany"
SECTIONS = ("mail", "backup", "printer", "archive", "proxy", "camera")
KEYS = {
    "port": (2000, 9999),
    "timeout": (5, 90),
    "retries": (1, 12),
    "limit": (100, 900),
    "interval": (15, 600),
}


class FixSetting(Task):
    """The key is there in each of four sections, and only one of them gets the new value."""

    name = "fix_setting"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        "{file} is open in the editor Geany. In the section [{section}], set {key} to {value}"
        " and save the file. All other settings stay.",
        "The {section} part of {file} (in Documents) has the wrong {key}: it should be {value}."
        " Please correct and save it.",
        "Change {key} of [{section}] in Documents/{file} to {value}.",
    )

    def draw(self, stream):
        sections = {}
        for section in sample(stream, SECTIONS, 4):
            keys = shuffled(stream, list(KEYS))
            sections[section] = {key: stream.integer(*KEYS[key]) for key in keys}
        section = stream.choice(list(sections))
        key = stream.choice(list(KEYS))
        old = sections[section][key]
        value = old + stream.integer(1, 9)
        text = written(sections)
        sections[section][key] = value
        wanted = written(sections)
        name = f"{stream.choice(('server', 'station', 'relay', 'node'))}.conf"
        return {
            "file": name,
            "path": f"Documents/{name}",
            "section": section,
            "key": key,
            "old": old,
            "value": value,
            "text": text,
            "wanted": wanted,
            "number": changed_line(text, wanted),
        }

    def prepare(self, machine):
        machine.write(self.values.path, self.values.text)

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        found = machine.text(self.values.path) or ""
        if settings(found) != settings(self.values.wanted):
            yield f"{self.values.path} holds {found[:600]!r}"

    def oracle(self, hand):
        drawn = self.values
        text_editor.begin(hand, drawn.path, drawn.text, APP)
        line = f"{drawn.key} = {drawn.value}"
        text_editor.rewrite_line(hand, drawn.path, drawn.number, line, APP)
        text_editor.wait_for_text(hand, drawn.wanted, APP)
        text_editor.save(hand, drawn.path, APP)

    def plan(self):
        drawn = self.values
        return [
            'window "Geany"',
            "press ctrl+home",
            f"press down {drawn.number - 1} times",
            "press home",
            "press shift+end",
            f"type {quoted(f'{drawn.key} = {drawn.value}')}",
            "press ctrl+s",
            "wait",
        ]

    def wrong_results(self):
        path, text, wanted = self.values.path, self.values.text, self.values.wanted
        line = f"{self.values.key} = {self.values.value}"
        spaced = re.sub(r"(port = \d)", r"\1 ", wanted, count=1)
        lines = text.splitlines()
        others = [f"{line}\n" if old.startswith(self.values.key) else f"{old}\n" for old in lines]
        return {
            "in all sections": lambda m: m.write(path, "".join(others)),
            "at the end": lambda m: m.write(path, f"{text}{line}\n"),
            "commented out": lambda m: m.write(path, wanted.replace(line, f"# {line}")),
            "a blank in the number": lambda m: m.write(path, spaced),
            "in another folder": lambda m: m.write(self.values.file, wanted),
        }

    def right_result(self, machine):
        machine.write(self.values.path, self.values.wanted.replace(" = ", "=") + "\n")


def written(sections) -> str:
    """Return the text of a configuration."""
    blocks = []
    for name, pairs in sections.items():
        lines = [f"[{name}]", *(f"{key} = {value}" for key, value in pairs.items())]
        blocks.append("\n".join(lines) + "\n")
    return "# Restart the service after a change.\n\n" + "\n".join(blocks)


def settings(text: str) -> list[str]:
    """Return the lines that are not empty, without blanks around them and the equals sign."""
    lines = [line.strip() for line in text.splitlines()]
    return [re.sub(r"\s*=\s*", "=", line) for line in lines if line]


def changed_line(text: str, wanted: str) -> int:
    """Return the number of the first line that differs."""
    pairs = zip(text.splitlines(), wanted.splitlines(), strict=True)
    return next(number for number, (old, new) in enumerate(pairs, start=1) if old != new)
