"""Replace a name in all files of one kind, in a folder with subfolders."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.text_editor import text_problems
from online_env.tasks.kit.word_lists import TOPICS, sample

OLD = ("Nordwind", "Hillcrest", "Bluepine", "Castor", "Oakline")
NEW = ("Meridian", "Foxglove", "Silverbeck", "Pollux", "Larkfield")


class ReplaceInFiles(Task):
    """Files of another kind keep the old name, and so does a word that only begins alike."""

    name = "replace_in_files"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "Our company {old} is now called {new}. Replace the word {old} by {new} in all {ending}"
        " files in Documents/{folder} and its subfolders. Leave files of other kinds as they are,"
        " and longer words that begin with {old}.",
        "Please change every {old} into {new} in the {ending} files below Documents/{folder}, in"
        " subfolders, too. Whole words only (not {old}s), and no other kinds of files.",
        "Documents/{folder}, recursively, *{ending} only: {old} -> {new}, whole words.",
    )

    def draw(self, stream):
        old, new = stream.choice(OLD), stream.choice(NEW)
        ending, other = sample(stream, (".txt", ".html", ".md"), 2)
        topics = sample(stream, TOPICS, 5)
        paths = [f"{topic}{ending}" for topic in topics[:2]]
        paths += [f"archive/{topics[2]}{ending}", f"archive/old/{topics[3]}{ending}"]
        folder = f"{stream.choice(('site', 'press', 'handbook'))}-{stream.integer(10, 99)}"
        return {
            "old": old,
            "new": new,
            "ending": ending,
            "folder": folder,
            "paths": [f"Documents/{folder}/{path}" for path in paths],
            "other": f"Documents/{folder}/{topics[4]}{other}",
        }

    def prepare(self, machine):
        for path in (*self.values.paths, self.values.other):
            machine.write(path, self.text(path, self.values.old))

    def text(self, path, name):
        """Return what a file holds with a name in it."""
        old = self.values.old
        return f"{path}\n\n{name} was founded in 1974. All {old}s are {name}'s.\n{name}, {name}\n"

    def problems(self, machine):
        yield from machine.unexpected_changes(*self.values.paths)
        for path in self.values.paths:
            yield from text_problems(machine, path, self.text(path, self.values.new))

    def oracle(self, hand):
        old, new = self.values.old, self.values.new
        shell.command(hand, f"cd ~/Documents/{self.values.folder}")
        shell.command(hand, f"grep -rn {old} .")
        change = f"sed -i 's/\\b{old}\\b/{new}/g' {{}} +"
        shell.command(hand, f"find . -name '*{self.values.ending}' -exec {change}")
        shell.command(hand, f"grep -rn {old} .")

    def plan(self):
        old, new = self.values.old, self.values.new
        change = f"sed -i 's/\\b{old}\\b/{new}/g' {{}} +"
        return plan_steps.run(
            f"cd ~/Documents/{self.values.folder}",
            f"find . -name '*{self.values.ending}' -exec {change}",
            f"grep -rn {old} .",
        )

    def wrong_results(self):
        paths, other = self.values.paths, self.values.other
        old, new = self.values.old, self.values.new
        once = self.text(paths[0], new).replace(f"{new}, {new}", f"{new}, {old}")
        longer = self.text(paths[0], new).replace(f"{old}s", f"{new}s")
        return {
            "not in subfolders": lambda m: self.change(m, paths[:2]),
            "the other kind, too": lambda m: self.change(m, [*paths, other]),
            "only the first of a line": lambda m: (self.change(m, paths), m.write(paths[0], once)),
            "longer words": lambda m: (self.change(m, paths), m.write(paths[0], longer)),
        }

    def right_result(self, machine):
        first, *others = self.values.paths
        self.change(machine, reversed(others))
        machine.write(first, self.text(first, self.values.new).rstrip("\n"))

    def change(self, machine, paths):
        """Change the name in files."""
        for path in paths:
            machine.write(path, self.text(path, self.values.new))
