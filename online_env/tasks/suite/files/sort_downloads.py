"""Sort a full Downloads folder by kind of file."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import arrangement_problems, move_files, sample_file
from online_env.tasks.kit.word_lists import CITIES, GOODS, TOPICS, sample, shuffle

PLACE = "Downloads"
ENDS = (".png", ".jpg", ".jpg")


class SortDownloads(Task):
    """Pictures into one new folder, PDFs into another; other files, also tempting ones, stay."""

    name = "sort_downloads"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        'Tidy up my Downloads folder: make two folders in it, "{pictures}" and "{papers}". Move all'
        " pictures (PNG and JPEG) into the first one and all PDF files into the second one. Leave"
        " everything else where it is.",
        "My Downloads are a mess. Please put the PDFs in a new folder {papers} inside Downloads,"
        " and the images in a new folder {pictures}, also inside Downloads. The rest can stay.",
        "In Downloads, move all .png and .jpg files into a subfolder {pictures}, and all .pdf files"
        " into a subfolder {papers}. Don't touch the other files.",
    )

    def draw(self, stream):
        towns = sample(stream, CITIES, 3)
        pictures = [f"{town.lower()}{end}" for town, end in zip(towns, ENDS, strict=True)]
        topics = sample(stream, TOPICS, 4)
        papers = [f"{topic} {stream.integer(2, 9)}.pdf" for topic in topics[:2]]
        other_files = [f"{topics[2]}.txt", f"pdf {topics[3]}.csv", f"{stream.choice(GOODS)}-png.md"]
        folders = stream.choice((("Images", "Papers"), ("Photos", "PDFs"), ("Seen", "To read")))
        return {
            "files": {folders[0]: pictures, folders[1]: papers},
            "others": other_files,
            "pictures": folders[0],
            "papers": folders[1],
            "all": shuffle(stream, [*pictures, *papers, *other_files]),
        }

    def prepare(self, machine):
        for name in self.values.all:
            machine.write(f"{PLACE}/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path(PLACE)

    def moves(self):
        """Return old and new paths."""
        for folder, names in self.values.files.items():
            yield from ((f"{PLACE}/{name}", f"{PLACE}/{folder}/{name}") for name in names)

    def problems(self, machine):
        yield from arrangement_problems(machine, self.moves())

    def oracle(self, hand):
        thunar.go(hand, PLACE)
        for folder in self.values.files:
            thunar.make_folder(hand, folder)
        for folder, names in self.values.files.items():
            present_names = thunar.present(hand, *names)
            if not present_names:
                continue
            thunar.select(hand, *present_names)
            hand.press("ctrl", "x")
            thunar.enter(hand, folder)
            thunar.paste(hand, *present_names)
            thunar.up(hand, PLACE)

    def plan(self):
        steps = ['window "Thunar"']
        for folder, names in self.values.files.items():
            steps += [
                *plan_steps.make_folder(folder),
                *plan_steps.move(names, f"{PLACE}/{folder}"),
                *plan_steps.go(PLACE),
            ]
        return steps

    def wrong_results(self):
        moves = list(self.moves())
        other_file = self.values.others[1]
        extra = (f"{PLACE}/{other_file}", f"{PLACE}/{self.values.papers}/{other_file}")
        swapped = [(old, f"{PLACE}/{self.values.papers}/{old[10:]}") for old, _ in moves]
        return {
            "one is left": lambda m: move_files(m, moves[1:]),
            "a table with pdf in its name, too": lambda m: move_files(m, [*moves, extra]),
            "all in one folder": lambda m: move_files(m, swapped),
            "copied": lambda m: move_files(m, moves, "cp"),
        }

    def right_result(self, machine):
        move_files(machine, reversed(list(self.moves())))
