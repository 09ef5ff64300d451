"""Rename a file in the file manager."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.word_lists import TOPICS, sample

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
        folder_path = f"Documents/{folder}"
        return {"folder": folder, "place": folder_path, "names": names, "old": names[0], "new": new}

    def prepare(self, machine):
        for name in self.values.names:
            machine.write(f"{self.values.place}/{name}", content(name))

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def problems(self, machine):
        old = f"{self.values.place}/{self.values.old}"
        new = f"{self.values.place}/{self.values.new}"
        yield from machine.unexpected_changes(old, new)
        if machine.exists(old):
            yield f"{old} is still there"
        if machine.text(new) != content(self.values.old):
            yield f"{new} is not the file that was {self.values.old}"

    def oracle(self, hand):
        hand.press("ctrl", "2")  # as a list: the accessibility tree of Thunar has no icons
        hand.click_on(ITEMS, self.values.old, app="thunar")
        hand.press("f2")
        hand.find(("text", "entry"), app="thunar", state="focused")
        hand.replace(self.values.new)
        hand.press("enter")
        hand.find(ITEMS, self.values.new, app="thunar")

    def plan(self):
        return ['window "Thunar"', *plan_steps.rename(self.values.old, self.values.new)]

    def wrong_results(self):
        folder_path, new = self.values.place, self.values.new
        old, other_name = self.values.names[:2]
        return {
            "a copy": lambda m: m.run("cp", f"{folder_path}/{old}", f"{folder_path}/{new}"),
            "another file": lambda m: m.run(
                "mv", f"{folder_path}/{other_name}", f"{folder_path}/{new}"
            ),
            "in another folder": lambda m: m.run("mv", f"{folder_path}/{old}", f"Documents/{new}"),
        }

    def right_result(self, machine):
        folder_path = self.values.place
        machine.run("mv", f"{folder_path}/{self.values.old}", f"{folder_path}/{self.values.new}")


def content(name: str) -> str:
    """Return what the file of a name holds at first."""
    return f"This file was first called {name}.\n"
