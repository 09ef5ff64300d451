"""Rename a file in the file manager."""

from online_env.tasks import Task
from online_env.tasks.kit import told
from online_env.tasks.kit.words import TOPICS, sample

FOLDERS = ("Reports", "Invoices", "Letters", "Drafts")
ITEMS = ("table-cell", "list-item")


class RenameFile(Task):
    """One of several files in a folder gets a new name; the others and all contents stay."""

    name = "rename_file"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        'In the file manager, which shows the folder {folder} in Documents, rename the file "{old}"'
        ' to "{new}". Leave the other files as they are.',
        'The file {old} in Documents/{folder} should be called "{new}". Change its name.',
        'Please rename {old} (it is in the {folder} folder of my Documents) to "{new}".',
    )

    def draw(self, stream):
        folder = stream.choice(FOLDERS)
        year = stream.integer(2019, 2025)
        names = [f"{topic}-{year}.txt" for topic in sample(stream, TOPICS, 5)]
        new = f"final {names.pop()}"
        place = f"Documents/{folder}"
        return {"folder": folder, "place": place, "names": names, "old": names[0], "new": new}

    def prepare(self, machine):
        for name in self.drawn.names:
            machine.write(f"{self.drawn.place}/{name}", content(name))

    def opens(self, machine):
        return "thunar", machine.path(self.drawn.place)

    def problems(self, machine):
        old = f"{self.drawn.place}/{self.drawn.old}"
        new = f"{self.drawn.place}/{self.drawn.new}"
        yield from machine.untouched(old, new)
        if machine.exists(old):
            yield f"{old} is still there"
        if machine.text(new) != content(self.drawn.old):
            yield f"{new} is not the file that was {self.drawn.old}"

    def oracle(self, hand):
        hand.press("ctrl", "2")  # as a list: the accessibility tree of Thunar has no icons
        hand.click_on(ITEMS, self.drawn.old, app="thunar")
        hand.press("f2")
        hand.find(("text", "entry"), app="thunar", state="focused")
        hand.replace(self.drawn.new)
        hand.press("enter")
        hand.find(ITEMS, self.drawn.new, app="thunar")

    def plan(self):
        return ['window "Thunar"', *told.rename(self.drawn.old, self.drawn.new)]

    def wrong(self):
        place, new = self.drawn.place, self.drawn.new
        old, other = self.drawn.names[:2]
        return {
            "a copy": lambda m: m.run("cp", f"{place}/{old}", f"{place}/{new}"),
            "another file": lambda m: m.run("mv", f"{place}/{other}", f"{place}/{new}"),
            "in another folder": lambda m: m.run("mv", f"{place}/{old}", f"Documents/{new}"),
        }

    def right(self, machine):
        place = self.drawn.place
        machine.run("mv", f"{place}/{self.drawn.old}", f"{place}/{self.drawn.new}")


def content(name: str) -> str:
    """Return what the file of a name holds at first."""
    return f"This file was first called {name}.\n"
