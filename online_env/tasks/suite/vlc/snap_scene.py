"""Take a snapshot of one scene of a film, in VLC."""

from hijack_data.rng import Stream
from online_env.tasks import Task
from online_env.tasks.kit import gimp, recordings, vlc
from online_env.tasks.kit.word_lists import GOODS, sample

JPEG_SLACK = 8.0  # what compressing a picture twice may change of its colours, of 255


class SnapScene(Task):
    """A film has eight scenes with titles; one picture of one of them is wanted."""

    name = "snap_scene"
    domain = "vlc"
    apps = ("vlc",)
    phrasings = (
        'VLC plays the film {film}. Each of its scenes has a title; when the title "{title}" shows,'
        " take a snapshot with VLC, so that it is in my Pictures folder.",
        'I need a still of the scene "{title}" from Videos/{film}. Please take one with VLC (Video,'
        " Take Snapshot; the file name does not matter). Only that one should be in Pictures.",
        'One snapshot, made with VLC, of the scene "{title}" of {film}, saved in Pictures.',
    )

    def draw(self, stream):
        titles = [f"The {word}" for word in sample(stream, GOODS, 8)]
        index = stream.integer(2, 7)
        film = f"film-{stream.integer(10, 99)}.avi"
        return {"titles": titles, "place": index, "title": titles[index], "film": film}

    def prepare(self, machine):
        vlc.prepare(machine)
        scenes = [self.scene(index) for index in range(len(self.values.titles))]
        machine.write(f"Videos/{self.values.film}", recordings.film(scenes))

    def initial_app(self, machine):
        return "vlc", machine.path(f"Videos/{self.values.film}")

    def problems(self, machine):
        yield from machine.unexpected_changes("Pictures/*")
        names = machine.names("Pictures") or set()
        if len(names) != 1:
            yield f"there are {len(names)} files in Pictures, not one"
            return
        path = f"Pictures/{names.pop()}"
        picture = gimp.read_picture(machine, path)
        kind = "PNG" if picture is None else str(picture.format)
        expected = self.scene(self.values.place)
        yield from gimp.picture_problems(machine, path, expected, kind, JPEG_SLACK)

    def oracle(self, hand):
        vlc.pause_at(hand, self.values.place * recordings.SCENE + 1)
        hand.press("shift", "s")

    def wrong_results(self):
        path = "Pictures/still.png"
        expected = gimp.encode(self.scene(self.values.place))
        other_scene = gimp.encode(self.scene(self.values.place - 1))
        half = self.scene(self.values.place).reduce(2)
        return {
            "another scene": lambda m: m.write(path, other_scene),
            "in the home folder": lambda m: m.write("still.png", expected),
            "two scenes": lambda m: [
                m.write(path, expected),
                m.write("Pictures/b.png", other_scene),
            ],
            "a small picture": lambda m: m.write(path, gimp.encode(half)),
        }

    def right_result(self, machine):
        picture = gimp.encode(self.scene(self.values.place), "JPEG", 80)
        machine.write("Pictures/still.jpg", picture)

    def scene(self, index):
        """Return the picture of a scene."""
        return recordings.scene(Stream(self.seed, f"snap_scene {index}"), self.values.titles[index])
