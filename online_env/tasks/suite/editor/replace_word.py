"""Replace a word everywhere in a text, in Mousepad."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import text_editor
from online_env.tasks.kit.word_lists import CITIES, sample
from online_env.tasks.plan_words import quoted

APP = "mousepad"
LINE = 60  # pixels; a field is one line high
CLICKS = 3  # on a field, until it has the keyboard
WORDS = {
    "lamp": ("lampshade", "lantern"),
    "bench": ("workbench", "table"),
    "rope": ("roper", "cord"),
    "door": ("doorbell", "gate"),
    "boat": ("boathouse", "ferry"),
    "book": ("bookcase", "album"),
    "garden": ("gardener", "orchard"),
}
SENTENCES = (
    "The {old} has come from {city} this morning.",
    "Nobody may move the {old} before noon.",
    "A {other} is not for sale in {city}.",
    "Ask at the desk for the {old}, and for the key.",
    "Please count every {old} twice.",
    "The {other} stays where it is.",
    "From {city} we expect one more {old}.",
    'In the list, "{old}" is on page 4.',
)


class ReplaceWord(Task):
    """A word becomes another one; a longer word that has it in it stays."""

    name = "replace_word"
    domain = "editor"
    apps = (APP,)
    phrasings = (
        'In the file {file}, which is open, replace the word "{old}" by "{new}" everywhere. Words'
        ' that only contain it, such as "{other}", stay as they are. Save the file.',
        "We no longer say {old}, but {new}. Please correct the text in the editor ({file}) all the"
        ' way through and save it. Careful: "{other}" is right as it is.',
        'Replace each "{old}" in Documents/{file} with "{new}", whole words only (not in'
        ' "{other}"), and save.',
    )

    def draw(self, stream):
        old = stream.choice(list(WORDS))
        other, new = WORDS[old]
        cities = sample(stream, CITIES, len(SENTENCES))
        lines = [
            sentence.format(old=old, other=other, city=city)
            for sentence, city in zip(sample(stream, SENTENCES, 8), cities, strict=True)
        ]
        text = "\n".join(lines) + "\n"
        name = f"notice-{stream.integer(10, 99)}.txt"
        wanted = re.sub(rf"\b{old}\b", new, text)
        return {
            "file": name,
            "path": f"Documents/{name}",
            "old": old,
            "new": new,
            "other": other,
            "text": text,
            "wanted": wanted,
        }

    def prepare(self, machine):
        machine.write(self.values.path, self.values.text)

    def initial_app(self, machine):
        return APP, machine.path(self.values.path)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from text_editor.text_problems(machine, self.values.path, self.values.wanted)

    def oracle(self, hand):
        drawn = self.values
        text_editor.begin(hand, drawn.path, drawn.text, APP)
        hand.press("ctrl", "r")
        hand.find("dialog", "Find and Replace", APP)
        _fill(hand, 0, drawn.old)
        _fill(hand, 1, drawn.new)
        for box in ("Match whole word", "Replace all in:"):
            if hand.see("check-box", box, APP, "checked") is None:
                hand.click_on("check-box", box, APP)
                hand.find("check-box", box, APP, "checked")
        hand.button(re.compile("Replace"), APP)
        text_editor.wait_for_text(hand, drawn.wanted, APP)
        hand.button("Close", APP)
        text_editor.save(hand, drawn.path, APP)

    def plan(self):
        return [
            'window "Mousepad"',
            "press ctrl+r",
            'wait for "Match whole word"',
            "press ctrl+a",
            f"type {quoted(self.values.old)}",
            "press tab",
            f"type {quoted(self.values.new)}",
            'click "Match whole word"',
            'click "Replace all in"',
            'click "Replace" near "Close"',
            "wait",
            'click "Close"',
            "press ctrl+s",
            "wait",
        ]

    def wrong_results(self):
        path, text = self.values.path, self.values.text
        old, new = self.values.old, self.values.new
        once = text.replace(f" {old} ", f" {new} ", 1)
        return {
            "in longer words, too": lambda m: m.write(path, text.replace(old, new)),
            "only once": lambda m: m.write(path, once),
            "in a copy": lambda m: m.write(f"{path}.new", self.values.wanted),
            "removed": lambda m: m.write(path, self.values.wanted.replace(new, "")),
        }

    def right_result(self, machine):
        machine.write(self.values.path, self.values.wanted.rstrip("\n"))


def _is_field(node):
    """Whether a node is one of the dialog's two fields, which have no names; the text is higher."""
    return node.app == APP and node.role == "text" and node.box and node.box[3] - node.box[1] < LINE


def _field(hand, number):
    """Return the upper or the lower field of the dialog."""
    hand.wait("a field of the dialog", _is_field)
    return sorted(filter(_is_field, hand.look()), key=lambda node: node.centre[1])[number]


def _fill(hand, number, text):
    """Fill a field of the dialog; where it has not got the keyboard, the text would be changed."""
    for _ in range(CLICKS):
        hand.click(_field(hand, number))
        if "focused" in _field(hand, number).states:
            break
    hand.replace(text)
    hand.wait(f"a field with {text!r}", lambda node: _is_field(node) and node.text == text)
