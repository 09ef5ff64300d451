"""Export a picture as JPEG of a given quality, in GIMP."""

from online_env.tasks.kit import pictures
from online_env.tasks.kit.words import GOODS
from online_env.tasks.plan_words import quoted


class ExportJpeg(pictures.PictureTask):
    """The quality is read from the tables of the file."""

    name = "export_jpeg"
    phrasings = (
        "Export the picture {file}, which GIMP shows, as JPEG with the quality {quality}. It"
        " should be {new} in the folder Pictures.",
        "The file Pictures/{file} is too big to send. Please export it from GIMP as a JPEG named"
        " {new}, in the same folder, at quality {quality}.",
        "Pictures/{file} as JPEG, quality {quality}, please; name it Pictures/{new}.",
    )

    def draw(self, stream):
        name = f"{stream.choice(GOODS)}-{stream.integer(10, 99)}"
        return {
            "file": f"{name}.png",
            "new": f"{name}.jpg",
            "path": f"Pictures/{name}.png",
            "result": f"Pictures/{name}.jpg",
            "size": (stream.integer(40, 60) * 10, stream.integer(30, 40) * 10),
            "quality": stream.integer(30, 88),
        }

    def problems(self, machine):
        drawn = self.drawn
        yield from machine.untouched(drawn.result)
        wanted = self.picture()
        yield from pictures.picture_problems(machine, drawn.result, wanted, "JPEG", slack=10)
        found = pictures.opened(machine, drawn.result)
        if found is not None and not pictures.has_quality(found, drawn.quality):
            yield f"{drawn.result} has not the quality {drawn.quality}"

    def oracle(self, hand):
        pictures.undo_all(hand)
        pictures.gimp_export(hand, self.drawn.result, self.drawn.quality)

    def plan(self):
        return [
            'window "GIMP"',
            "press ctrl+shift+e",
            'wait for "Export Image"',
            "press ctrl+a",
            f"type {quoted(self.drawn.new)}",
            "press enter",
            'double-click "90" near "Quality:"',
            "press ctrl+a",
            f"type {quoted(str(self.drawn.quality))}",
            "press tab",
            'click "Export"',
            "wait",
        ]

    def wrong(self):
        path, result, picture = self.drawn.path, self.drawn.result, self.picture()
        good = pictures.encoded(picture, "JPEG", 90)
        better = pictures.encoded(picture, "JPEG", self.drawn.quality + 1)
        small = picture.resize((picture.width // 2, picture.height // 2))
        half = pictures.encoded(small, "JPEG", self.drawn.quality)
        return {
            "the quality that it offers": lambda m: m.write(result, good),
            "nearly the quality": lambda m: m.write(result, better),
            "with a dab of the brush": lambda m: m.write(
                result, pictures.encoded(pictures.dabbed(picture), "JPEG", self.drawn.quality)
            ),
            "half the size": lambda m: m.write(result, half),
            "a PNG file with that name": lambda m: m.run("cp", path, result),
        }

    def right(self, machine):
        data = pictures.encoded(self.picture(), "JPEG", self.drawn.quality)
        machine.write(self.drawn.result, data)
