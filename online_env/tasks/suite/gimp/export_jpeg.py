"""Export a picture as JPEG of a given quality, in GIMP."""

from online_env.tasks.kit import gimp
from online_env.tasks.kit.word_lists import GOODS
from online_env.tasks.plan_words import quoted


class ExportJpeg(gimp.PictureTask):
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
        drawn = self.values
        yield from machine.unexpected_changes(drawn.result)
        wanted = self.picture()
        yield from gimp.picture_problems(machine, drawn.result, wanted, "JPEG", slack=10)
        found = gimp.opened(machine, drawn.result)
        if found is not None and not gimp.has_quality(found, drawn.quality):
            yield f"{drawn.result} has not the quality {drawn.quality}"

    def oracle(self, hand):
        gimp.undo_all(hand)
        gimp.gimp_export(hand, self.values.result, self.values.quality)

    def plan(self):
        return [
            'window "GIMP"',
            "press ctrl+shift+e",
            'wait for "Export Image"',
            "press ctrl+a",
            f"type {quoted(self.values.new)}",
            "press enter",
            'double-click "90" near "Quality:"',
            "press ctrl+a",
            f"type {quoted(str(self.values.quality))}",
            "press tab",
            'click "Export"',
            "wait",
        ]

    def wrong_results(self):
        path, result, picture = self.values.path, self.values.result, self.picture()
        good = gimp.encoded(picture, "JPEG", 90)
        better = gimp.encoded(picture, "JPEG", self.values.quality + 1)
        small = picture.resize((picture.width // 2, picture.height // 2))
        half = gimp.encoded(small, "JPEG", self.values.quality)
        return {
            "the quality that it offers": lambda m: m.write(result, good),
            "nearly the quality": lambda m: m.write(result, better),
            "with a dab of the brush": lambda m: m.write(
                result, gimp.encoded(gimp.dabbed(picture), "JPEG", self.values.quality)
            ),
            "half the size": lambda m: m.write(result, half),
            "a PNG file with that name": lambda m: m.run("cp", path, result),
        }

    def right_result(self, machine):
        data = gimp.encoded(self.picture(), "JPEG", self.values.quality)
        machine.write(self.values.result, data)
