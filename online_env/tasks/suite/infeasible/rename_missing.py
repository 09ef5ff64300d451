"""Rename a file that is not there, though others have nearly its name."""

from online_env.tasks import Task
from online_env.tasks.kit import thunar
from online_env.tasks.kit.sample_files import sample_file
from online_env.tasks.kit.word_lists import TOPICS, sample
from online_env.tasks.plan_words import quoted

FOLDERS = ("Council", "Tenants", "Orchestra", "Workshop")


class RenameMissing(Task):
    """The years before and after are there, and the same name with another ending."""

    name = "rename_missing"
    domain = "infeasible"
    apps = ("thunar",)
    infeasible = "there is no file of that name"
    phrasings = (
        'Rename the file {old} in Documents/{folder} to "{new}".',
        "Please give Documents/{folder}/{old} the name {new}. Only this file, not one of the other"
        " years.",
        "In the folder {folder} of my Documents, {old} should be called {new} from now on.",
    )

    def draw(self, stream):
        topic, *other_topics = sample(stream, TOPICS, 3)
        year = stream.integer(2015, 2024)
        folder_path = f"Documents/{stream.choice(FOLDERS)}"
        names = [f"{topic}-{year - 1}.pdf", f"{topic}-{year + 1}.pdf", f"{topic}-{year}.txt"]
        names += [f"{other_topic}-{year}.pdf" for other_topic in other_topics]
        return {
            "folder": folder_path.rpartition("/")[2],
            "place": folder_path,
            "old": f"{topic}-{year}.pdf",
            "new": f"{topic} {year} signed.pdf",
            "names": names,
        }

    def prepare(self, machine):
        for name in self.values.names:
            machine.write(f"{self.values.place}/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def problems(self, machine):
        yield from machine.unexpected_changes()

    def oracle(self, hand):
        thunar.go(hand, self.values.place)
        names = thunar.present(hand, self.values.old)
        hand.click_on("table-cell", "Trash", app="thunar")
        hand.find("frame", "Trash - Thunar", app="thunar")
        names += thunar.present(hand, self.values.old)
        if not names:
            hand.give_up(f"there is no {self.values.old}, neither in the folder nor in the trash")

    def plan(self):
        reason = f"there is no {self.values.old}, neither in the folder nor in the trash"
        return [
            'window "Thunar"',
            'click "Trash" near "Places"',
            "wait",
            f"give up {quoted(reason)}",
        ]

    def wrong_results(self):
        folder_path, new, names = self.values.place, self.values.new, self.values.names
        return {
            "another year": lambda m: m.run(
                "mv", f"{folder_path}/{names[0]}", f"{folder_path}/{new}"
            ),
            "another ending": lambda m: m.run(
                "mv", f"{folder_path}/{names[2]}", f"{folder_path}/{new}"
            ),
            "a new file": lambda m: m.write(f"{folder_path}/{new}", ""),
        }
