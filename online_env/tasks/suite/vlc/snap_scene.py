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
        place = stream.integer(2, 7)
        film = f"film-{stream.integer(10, 99)}.avi"
        return {"titles": titles, "place": place, "title": titles[place], "film": film}

    def prepare(self, machine):
        vlc.prepare(machine)
        scenes = [self.scene(place) for place in range(len(self.values.titles))]
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
        found = gimp.opened(machine, path)
        kind = "PNG" if found is None else str(found.format)
        wanted = self.scene(self.values.place)
        yield from gimp.picture_problems(machine, path, wanted, kind, JPEG_SLACK)

    def oracle(self, hand):
        vlc.pause_at(hand, self.values.place * recordings.SCENE + 1)
        hand.press("shift", "s")

    def wrong_results(self):
        path = "Pictures/still.png"
        wanted = gimp.encoded(self.scene(self.values.place))
        other = gimp.encoded(self.scene(self.values.place - 1))
        half = self.scene(self.values.place).reduce(2)
        return {
            "another scene": lambda m: m.write(path, other),
            "in the home folder": lambda m: m.write("still.png", wanted),
            "two scenes": lambda m: [m.write(path, wanted), m.write("Pictures/b.png", other)],
            "a small picture": lambda m: m.write(path, gimp.encoded(half)),
        }

    def right_result(self, machine):
        picture = gimp.encoded(self.scene(self.values.place), "JPEG", 80)
        machine.write("Pictures/still.jpg", picture)

    def scene(self, place):
        """Return the picture of a scene."""
        return recordings.scene(Stream(self.seed, f"snap_scene {place}"), self.values.titles[place])
