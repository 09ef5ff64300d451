"""Tick what is done in a to-do list, in Mousepad."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import text_editor
from online_env.tasks.kit.word_lists import CITIES, FIRST_NAMES, GOODS, sample

APP = "mousepad"
WORK = (
    "call {name}",
    "buy a {thing}",
    "write to {name} in {city}",
    "repair the {thing}",
    "return the {thing} to {name}",
    "book the train to {city}",
    "ask {name} about the {thing}",
    "pay the {thing}",
    "measure the {thing}",
    "find out when {name} is in {city}",
)


class TickItems(Task):
    """Three items of ten get an x between their brackets; two have one from the start."""

    name = "tick_items"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        "These things on my list {file} (open in the text editor) are done:\n\n{items}\n\nTick"
        " them, with an x between the brackets as it is there already, and save the file.",
        "Please mark as done ([x]) in Documents/{file}:\n\n{items}\n\nand leave the rest of the"
        " list alone.",
        "I have done these things:\n\n{items}\n\nTick them in my to-do list, the file {file} that"
        " the editor shows, and save it.",
    )

    def draw(self, stream):
        names = sample(stream, FIRST_NAMES, len(WORK))
        things = sample(stream, GOODS, len(WORK))
        cities = sample(stream, CITIES, len(WORK))
        items = [
            work.format(name=name, thing=thing, city=city)
            for work, name, thing, city in zip(
                sample(stream, WORK, 10), names, things, cities, strict=True
            )
        ]
        order = sample(stream, range(len(items)), 5)
        before, done = set(order[:2]), sorted(order[2:])
        name = f"todo-{stream.integer(1, 52)}.txt"
        return {
            "file": name,
            "path": f"Documents/{name}",
            "items": "\n".join(items[index] for index in done),
            "done": done,
            "lines": listed(items, {*before, *done}),
            "text": "\n".join(listed(items, before)) + "\n",
            "open": [index for index in range(len(items)) if index not in order],
        }

    def prepare(self, machine):
        machine.write(self.values.path, self.values.text)

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        found = (machine.text(self.values.path) or "").splitlines()
        plain = [re.sub(r"^\[ *[xX] *\]", "[x]", line.rstrip()) for line in found]
        if plain != self.values.lines:
            yield f"{self.values.path} holds {found}"

    def oracle(self, hand):
        drawn = self.values
        text_editor.begin(hand, drawn.path, drawn.text, APP)
        for index in drawn.done:
            text_editor.go_to_line(hand, drawn.path, index + 1, APP)
            hand.press("right")
            hand.press("delete")
            hand.type("x")
        text_editor.wait_for_text(hand, "\n".join(drawn.lines) + "\n", APP)
        text_editor.save(hand, drawn.path, APP)

    def plan(self):
        steps = ['window "Mousepad"', "press ctrl+home"]
        line = 0
        for index in self.values.done:
            if index > line:
                steps.append(f"press down {index - line} times")
            steps += ["press home", "press right", "press delete", 'type "x"']
            line = index
        return [*steps, "press ctrl+s", "wait"]

    def wrong_results(self):
        path, lines, text = self.values.path, self.values.lines, self.values.text
        less = list(lines)
        less[self.values.done[0]] = less[self.values.done[0]].replace("[x]", "[ ]")
        more = list(lines)
        more[self.values.open[0]] = more[self.values.open[0]].replace("[ ]", "[x]")
        short = [line for index, line in enumerate(lines) if index not in self.values.done]
        return {
            "one is missing": lambda m: m.write(path, "\n".join(less)),
            "one too many": lambda m: m.write(path, "\n".join(more)),
            "taken off the list": lambda m: m.write(path, "\n".join(short)),
            "all of them": lambda m: m.write(path, text.replace("[ ]", "[x]")),
        }

    def right_result(self, machine):
        machine.write(self.values.path, "\n".join(self.values.lines).replace("[x]", "[X]"))


def listed(items, ticked) -> list[str]:
    """Return the lines of a list of which some items are ticked."""
    return [f"[{'x' if index in ticked else ' '}] {item}" for index, item in enumerate(items)]
