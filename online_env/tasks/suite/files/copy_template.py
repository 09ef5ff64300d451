"""Start three documents from one template."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import move_files, rearranged, sample_file
from online_env.tasks.kit.word_lists import LAST_NAMES, sample
from online_env.tasks.plan_words import quoted

NAMES = tuple(name for name in LAST_NAMES if name.isalpha())
KINDS = ("contract", "letter", "offer", "certificate", "questionnaire")


class CopyTemplate(Task):
    """The copies lie in another folder, each named after a person; the template stays."""

    name = "copy_template"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        'I need the {kind} for three people. Copy "{template}" from Documents/Forms three times to'
        " Documents/{folder}, as {a}, {b} and {c}.",
        "Please make three copies of Documents/Forms/{template} in the folder Documents/{folder}:"
        " {a}, {b}, {c}. The template itself stays as it is.",
        "Documents/Forms/{template} -> Documents/{folder}/{a}, Documents/{folder}/{b},"
        " Documents/{folder}/{c} (copies).",
    )

    def draw(self, stream):
        kind = stream.choice(KINDS)
        a, b, c = (f"{kind} {name}.txt" for name in sample(stream, NAMES, 3))
        year = stream.integer(2020, 2025)
        return {
            "kind": kind,
            "template": f"{kind} template {year + 1}.txt",
            "old": f"{kind} template {year}.txt",
            "folder": stream.choice(("Outgoing", "To send", "Drafts")),
            "a": a,
            "b": b,
            "c": c,
        }

    def prepare(self, machine):
        for name in (self.values.template, self.values.old):
            machine.write(f"Documents/Forms/{name}", sample_file(name))
        machine.write(f"Documents/{self.values.folder}/list.txt", "Nothing sent so far.\n")

    def initial_app(self, machine):
        return "thunar", machine.path("Documents/Forms")

    def copies(self, template=""):
        """Return the paths of a template and of its copies."""
        drawn = self.values
        start = f"Documents/Forms/{template or drawn.template}"
        return [(start, f"Documents/{drawn.folder}/{name}") for name in (drawn.a, drawn.b, drawn.c)]

    def problems(self, machine):
        yield from rearranged(machine, copied=self.copies())

    def oracle(self, hand):
        drawn = self.values
        thunar.go(hand, "Documents/Forms")
        thunar.select(hand, drawn.template)
        hand.press("ctrl", "c")
        thunar.go(hand, f"Documents/{drawn.folder}")
        for name in (drawn.a, drawn.b, drawn.c):
            if thunar.present(hand, name):
                continue
            if not thunar.present(hand, drawn.template):
                thunar.paste(hand, drawn.template)
            thunar.rename(hand, drawn.template, name)

    def plan(self):
        drawn = self.values
        steps = [
            'window "Thunar"',
            f"click {quoted(drawn.template)}",
            "press ctrl+c",
            'click "Documents" near "Places"',
            f"double-click {quoted(drawn.folder)}",
            'wait for "list.txt"',
        ]
        for name in (drawn.a, drawn.b, drawn.c):
            steps += ["press ctrl+v", *plan_steps.rename(drawn.template, name)]
        return steps

    def wrong_results(self):
        copies = self.copies()
        first = [(copies[0][0], f"Documents/Forms/{self.values.a}")]
        return {
            "two copies": lambda m: move_files(m, copies[:2], "cp"),
            "of the old template": lambda m: move_files(m, self.copies(self.values.old), "cp"),
            "one beside the template": lambda m: move_files(m, [*first, *copies[1:]], "cp"),
            "the template is gone": lambda m: (
                move_files(m, copies, "cp"),
                m.run("rm", copies[0][0]),
            ),
        }

    def right_result(self, machine):
        move_files(machine, reversed(self.copies()), "cp")
