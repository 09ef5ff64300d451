"""Unpack an archive of the Downloads folder, and put what was in it where it belongs."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.archives import make_zip
from online_env.tasks.kit.sample_files import sample_file
from online_env.tasks.kit.word_lists import CITIES, TOPICS, sample
from online_env.tasks.plan_words import quoted

TARGETS = ("Documents", "Pictures", "Desktop")


class ExtractArchive(Task):
    """The archive holds one folder; it stays in Downloads, and so does another archive."""

    name = "extract_archive"
    domain = "files"
    apps = ("thunar", "xarchiver")
    phrasings = (
        "Unpack {archive}, which is in Downloads. The folder {folder} that it holds should be in"
        " {target} afterwards, and not in Downloads. Keep the archive.",
        "There is a {archive} in my Downloads. Please extract it so that I have the folder {folder}"
        " in {target}. Leave the zip file where it is, and no other traces.",
        "Extract Downloads/{archive} to {target} (it contains a folder named {folder}); keep the"
        " archive itself.",
    )

    def draw(self, stream):
        city, other = sample(stream, CITIES, 2)
        first, second = (f"{topic}.txt" for topic in sample(stream, TOPICS, 2))
        folder = f"{city} {stream.integer(2019, 2025)}"
        return {
            "archive": f"{city.lower()}-{stream.integer(10, 99)}.zip",
            "other": f"{other.lower()}.zip",
            "folder": folder,
            "target": stream.choice(TARGETS),
            "files": [f"{folder}/{first}", f"{folder}/{second}", f"{folder}/more/map.png"],
        }

    def prepare(self, machine):
        drawn = self.values
        inside = {path: sample_file(path) for path in drawn.files}
        machine.write(f"Downloads/{drawn.archive}", make_zip(inside))
        machine.write(f"Downloads/{drawn.other}", make_zip({"tickets.txt": b"Row 7\n"}))

    def initial_app(self, machine):
        return "thunar", machine.path("Downloads")

    def problems(self, machine):
        wanted = {f"{self.values.target}/{path}": sample_file(path) for path in self.values.files}
        yield from machine.unexpected_changes(*wanted)
        for path, data in wanted.items():
            if machine.read(path) != data:
                yield f"{path} is not there as it is in the archive"

    def oracle(self, hand):
        drawn = self.values
        thunar.go(hand, drawn.target)
        if thunar.present(hand, drawn.folder):
            return
        thunar.go(hand, "Downloads")
        if not thunar.present(hand, drawn.folder):
            archive = hand.find(thunar.ROWS, drawn.archive, app="thunar")
            hand.context_menu(archive, "Extract Here", app="thunar")
            hand.find(thunar.ROWS, drawn.folder, app="thunar")
        thunar.move(hand, [drawn.folder], drawn.target)

    def plan(self):
        drawn = self.values
        return [
            'window "Thunar"',
            f"right-click {quoted(drawn.archive)}",
            'click "Extract Here"',
            f"click {quoted(drawn.folder)}",
            "press ctrl+x",
            *plan_steps.go(drawn.target),
            "press ctrl+v",
            f"wait for {quoted(drawn.folder)}",
        ]

    def wrong_results(self):
        target, archive = self.values.target, f"Downloads/{self.values.archive}"
        files = self.values.files
        return {
            "in Downloads": lambda m: extract(m, "Downloads", files),
            "a file is missing": lambda m: extract(m, target, files[:-1]),
            "without the folder": lambda m: extract(m, target, files, self.values.folder),
            "and the archive is gone": lambda m: (extract(m, target, files), m.run("rm", archive)),
        }

    def right_result(self, machine):
        extract(machine, self.values.target, reversed(self.values.files))


def extract(machine, target, paths, without=""):
    """Write what the archive holds to a folder, without the start of the paths."""
    for path in paths:
        machine.write(f"{target}/{path.removeprefix(f'{without}/')}", sample_file(path))
