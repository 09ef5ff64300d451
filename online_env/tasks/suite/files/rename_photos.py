"""Give the pictures of a camera names that say something."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import arrangement_problems, move_files, sample_file
from online_env.tasks.kit.word_lists import CITIES

EVENTS = ("Wedding", "Hike", "Birthday", "Harvest", "Regatta")


class RenamePhotos(Task):
    """Four pictures get an event and a number, in the order of their old numbers."""

    name = "rename_photos"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        'Rename the four pictures IMG_....jpg in Pictures/{folder} to "{title} 1.jpg",'
        ' "{title} 2.jpg" and so on, in the order of their numbers. Leave the other files alone.',
        "The photos in Pictures/{folder} still have the names of the camera (IMG_ and a number)."
        ' Please call them "{title} 1.jpg" to "{title} 4.jpg"; the lowest number becomes 1.',
        "Pictures/{folder}: IMG_*.jpg -> {title} 1.jpg, {title} 2.jpg, {title} 3.jpg,"
        " {title} 4.jpg, sorted by the old number.",
    )

    def draw(self, stream):
        event, city = stream.choice(EVENTS), stream.choice(CITIES)
        number = stream.integer(1000, 8000)
        names = []
        for _ in range(4):
            number += stream.integer(1, 60)
            names.append(f"IMG_{number}.jpg")
        title = f"{event} {stream.integer(2018, 2025)}"
        folder = f"{city} trip"
        folder_path = f"Pictures/{folder}"
        return {
            "folder": folder,
            "title": title,
            "place": folder_path,
            "pairs": [(old, f"{title} {index}.jpg") for index, old in enumerate(names, 1)],
            "others": [f"{city}.png", f"IMG_{number}.txt"],
        }

    def prepare(self, machine):
        for name in [*(old for old, _ in self.values.pairs), *self.values.others]:
            machine.write(f"{self.values.place}/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def moves(self, pairs=()):
        """Return old and new paths."""
        folder_path = self.values.place
        return [
            (f"{folder_path}/{old}", f"{folder_path}/{new}")
            for old, new in pairs or self.values.pairs
        ]

    def problems(self, machine):
        yield from arrangement_problems(machine, self.moves())

    def oracle(self, hand):
        thunar.go(hand, self.values.place)
        for old, new in self.values.pairs:
            thunar.rename(hand, old, new)

    def plan(self):
        steps = ['window "Thunar"']
        for old, new in self.values.pairs:
            steps += plan_steps.rename(old, new)
        return steps

    def wrong_results(self):
        pairs = self.values.pairs
        news = [new for _, new in pairs]
        backwards = [(old, new) for (old, _), new in zip(pairs, reversed(news), strict=True)]
        padded = [(old, re.sub(r" (\d)\.", r" 0\1.", new)) for old, new in pairs]
        return {
            "three of four": lambda m: move_files(m, self.moves(pairs[:3])),
            "backwards": lambda m: move_files(m, self.moves(backwards)),
            "with leading zeros": lambda m: move_files(m, self.moves(padded)),
            "copied": lambda m: move_files(m, self.moves(), "cp"),
        }

    def right_result(self, machine):
        move_files(machine, reversed(self.moves()))
