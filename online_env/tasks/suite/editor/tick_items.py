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
        goods = sample(stream, GOODS, len(WORK))
        cities = sample(stream, CITIES, len(WORK))
        items = [
            work.format(name=name, thing=item, city=city)
            for work, name, item, city in zip(
                sample(stream, WORK, 10), names, goods, cities, strict=True
            )
        ]
        order = sample(stream, range(len(items)), 5)
        before, to_tick = set(order[:2]), sorted(order[2:])
        name = f"todo-{stream.integer(1, 52)}.txt"
        return {
            "file": name,
            "path": f"Documents/{name}",
            "items": "\n".join(items[index] for index in to_tick),
            "done": to_tick,
            "lines": list_lines(items, {*before, *to_tick}),
            "text": "\n".join(list_lines(items, before)) + "\n",
            "open": [index for index in range(len(items)) if index not in order],
        }

    def prepare(self, machine):
        machine.write(self.values.path, self.values.text)

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        lines = (machine.text(self.values.path) or "").splitlines()
        normalized = [re.sub(r"^\[ *[xX] *\]", "[x]", line.rstrip()) for line in lines]
        if normalized != self.values.lines:
            yield f"{self.values.path} holds {lines}"

    def oracle(self, hand):
        values = self.values
        text_editor.begin(hand, values.path, values.text, APP)
        for index in values.done:
            text_editor.go_to_line(hand, values.path, index + 1, APP)
            hand.press("right")
            hand.press("delete")
            hand.type("x")
        text_editor.wait_for_text(hand, "\n".join(values.lines) + "\n", APP)
        text_editor.save(hand, values.path, APP)

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
        one_missing = list(lines)
        one_missing[self.values.done[0]] = one_missing[self.values.done[0]].replace("[x]", "[ ]")
        one_too_many = list(lines)
        one_too_many[self.values.open[0]] = one_too_many[self.values.open[0]].replace("[ ]", "[x]")
        short = [line for index, line in enumerate(lines) if index not in self.values.done]
        return {
            "one is missing": lambda m: m.write(path, "\n".join(one_missing)),
            "one too many": lambda m: m.write(path, "\n".join(one_too_many)),
            "taken off the list": lambda m: m.write(path, "\n".join(short)),
            "all of them": lambda m: m.write(path, text.replace("[ ]", "[x]")),
        }

    def right_result(self, machine):
        machine.write(self.values.path, "\n".join(self.values.lines).replace("[x]", "[X]"))


def list_lines(items, ticked) -> list[str]:
    """Return the lines of a list of which some items are ticked."""
    return [f"[{'x' if index in ticked else ' '}] {item}" for index, item in enumerate(items)]
