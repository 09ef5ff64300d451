"""Make a folder for a project, with folders in it."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import arrangement_problems
from online_env.tasks.kit.word_lists import CITIES, sample

PARTS = ("Drawings", "Letters", "Photos", "Offers", "Notes", "Contracts", "Plans")
WORKS = ("Roof", "Kitchen", "Garden", "Bridge", "School", "Harbour")


class MakeFolderTree(Task):
    """Three folders in a new one, and two more in one of the three."""

    name = "make_folder_tree"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        'Make a folder "{top}" in Documents. In it, make the folders {a}, {b} and {c}; and in {b},'
        " make the folders {year} and {next}.",
        "We begin a new project. I need this in my Documents: a folder {top} with three folders"
        " {a}, {b}, {c}. The folder {b} gets two folders of its own: {year} and {next}.",
        "Please create these empty folders:\n\nDocuments/{top}/{a}\nDocuments/{top}/{b}/{year}\n"
        "Documents/{top}/{b}/{next}\nDocuments/{top}/{c}",
    )

    def draw(self, stream):
        a, b, c = sample(stream, PARTS, 3)
        year = stream.integer(2020, 2026)
        top = f"{stream.choice(WORKS)} {stream.choice(CITIES)}"
        parts = [top, f"{top}/{a}", f"{top}/{b}", f"{top}/{c}"]
        parts += [f"{top}/{b}/{year}", f"{top}/{b}/{year + 1}"]
        folders = [f"Documents/{part}" for part in parts]
        return {
            "top": top,
            "a": a,
            "b": b,
            "c": c,
            "year": year,
            "next": year + 1,
            "folders": folders,
        }

    def initial_app(self, machine):
        return "thunar", machine.path("Documents")

    def problems(self, machine):
        yield from arrangement_problems(machine, folders=self.values.folders)

    def oracle(self, hand):
        values = self.values
        thunar.go(hand, "Documents")
        thunar.make_folder(hand, values.top)
        thunar.enter(hand, values.top)
        for name in (values.a, values.b, values.c):
            thunar.make_folder(hand, name)
        thunar.enter(hand, values.b)
        for name in (values.year, values.next):
            thunar.make_folder(hand, str(name))

    def plan(self):
        values = self.values
        steps = [
            'window "Thunar"',
            *plan_steps.make_folder(values.top),
            *plan_steps.go(f"Documents/{values.top}"),
        ]
        for name in (values.a, values.b, values.c):
            steps += plan_steps.make_folder(name)
        steps += plan_steps.go(f"Documents/{values.top}/{values.b}")
        for name in (values.year, values.next):
            steps += plan_steps.make_folder(str(name))
        return steps

    def wrong_results(self):
        values = self.values
        folders = values.folders
        other_folder = folders[-1].replace(f"/{values.b}/", f"/{values.c}/")
        return {
            "the years are missing": lambda m: m.run("mkdir", "-p", *folders[:-2]),
            "a year is elsewhere": lambda m: m.run("mkdir", "-p", *folders[:-1], other_folder),
            "one too many": lambda m: m.run("mkdir", "-p", *folders, f"{folders[0]}/New Folder"),
            "a file in the place of one": lambda m: half_file(m, folders),
        }

    def right_result(self, machine):
        machine.run("mkdir", "-p", *reversed(self.values.folders))


def half_file(machine, folders):
    """Make the folders, but a file instead of the last."""
    machine.run("mkdir", "-p", *folders[:-1])
    machine.write(folders[-1], "")
