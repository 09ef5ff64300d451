"""Merge lists of guests into one that is sorted and names everybody once."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES, shuffled

FIRST = tuple(name for name in FIRST_NAMES if name.isascii())
LAST = tuple(name for name in LAST_NAMES if name.isascii() and name.isalpha())
EVENTS = ("party", "concert", "seminar", "excursion")


class MergeLists(Task):
    """Three lists have some names in common; a fourth one is for something else."""

    name = "merge_lists"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "Documents/{folder} has three lists of guests: {a}, {b} and {c}. Make one list {all} in the"
        " same folder, sorted alphabetically by line, with each name only once.",
        "Please merge {a}, {b} and {c} (in Documents/{folder}) into {all}, sorted and without"
        " duplicates. Don't change the three files.",
        "In ~/Documents/{folder}: sort {a} {b} {c} together, drop duplicate lines, save as {all}.",
    )

    def draw(self, stream):
        people = [f"{first} {stream.choice(LAST)}" for first in shuffled(stream, FIRST)]
        groups = [people[:3], people[2:6], people[5:9]]  # neighbours have one in common
        a, b, c = shuffled(stream, ("family.txt", "work.txt", "club.txt"))
        lists = dict(zip((a, b, c), (shuffled(stream, group) for group in groups), strict=True))
        folder = f"{stream.choice(EVENTS)} {stream.integer(2024, 2027)}"
        new = f"all-{stream.integer(1, 9)}.txt"
        return {
            "folder": folder,
            "place": f"Documents/{folder}",
            "all": new,
            "path": f"Documents/{folder}/{new}",
            "lists": lists,
            "a": a,
            "b": b,
            "c": c,
        }

    @property
    def merged(self):
        """The lines as they should be."""
        return sorted({name for names in self.values.lists.values() for name in names})

    def prepare(self, machine):
        for name, lines in self.values.lists.items():
            machine.write(f"{self.values.place}/{name}", "\n".join(lines) + "\n")
        machine.write(f"{self.values.place}/helpers.txt", "Somebody Else\n")

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        found = (machine.text(self.values.path) or "").split("\n")
        if [line.strip() for line in found if line.strip()] != self.merged:
            yield f"{self.values.path} holds {found}"

    def oracle(self, hand):
        new = self.values.all
        shell.command(hand, f"cd ~/'{self.values.place}'")
        shell.command(hand, f"sort -u {' '.join(self.values.lists)} > {new}")
        shell.command(hand, f"cat {new}")

    def plan(self):
        return plan_steps.run(
            f"cd ~/'{self.values.place}'",
            f"sort -u {' '.join(self.values.lists)} > {self.values.all}",
            f"cat {self.values.all}",
        )

    def wrong_results(self):
        path, lists = self.values.path, self.values.lists
        a, b, _ = lists.values()
        twice = sorted(name for names in lists.values() for name in names)
        return {
            "with duplicates": lambda m: save(m, path, twice),
            "not sorted": lambda m: save(m, path, self.merged[::-1]),
            "two lists": lambda m: save(m, path, sorted({*a, *b})),
            "with the helpers": lambda m: save(m, path, [*self.merged, "Somebody Else"]),
        }

    def right_result(self, machine):
        machine.write(self.values.path, "\n" + " \r\n".join(self.merged) + "\t\n\n")


def save(machine, path, lines):
    """Write lines."""
    machine.write(path, "\n".join(lines) + "\n")
