"""Scale a picture and export it, in GIMP."""

from PIL import Image

from online_env.tasks.kit import gimp, plan_steps
from online_env.tasks.kit.word_lists import CITIES
from online_env.tasks.plan_words import quoted


class ScalePicture(gimp.PictureTask):
    """A smaller picture of the same shape goes into a new file; the old one stays."""

    name = "scale_picture"
    phrasings = (
        "GIMP shows the picture {file}. Scale it to a width of {width} pixels, in proportion, and"
        " export it as {new} in the folder Pictures. The old file stays as it is.",
        "I need {file} (in Pictures) smaller: {width} pixels wide and {height} high. Please save"
        " that as Pictures/{new} with GIMP and keep the original.",
        "Scale Pictures/{file} to {width} × {height} pixels and keep that as {new} in the same"
        " folder. Leave the original as it is.",
    )

    def draw(self, stream):
        factor = stream.integer(3, 8)
        width, height = stream.integer(40, 60), stream.integer(30, 39)
        name = stream.choice(CITIES).lower()
        return {
            "file": f"{name}.png",
            "new": f"{name}-small.png",
            "size": (width * 10, height * 10),
            "width": width * factor,
            "height": height * factor,
            "path": f"Pictures/{name}.png",
            "result": f"Pictures/{name}-small.png",
        }

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.result)
        yield from gimp.picture_problems(machine, self.values.result, self.scaled(), slack=8)

    def oracle(self, hand):
        drawn = self.values
        gimp.undo_all(hand)
        gimp.gimp_command(hand, "scale image")
        hand.find("dialog", "Scale Image", "gimp")
        hand.find("spin-button", app="gimp", state="focused")
        hand.replace(str(drawn.width))
        hand.press("tab")  # the height follows
        hand.button("Scale", "gimp")
        hand.wait_until_gone("dialog", "Scale Image", "gimp")
        gimp.gimp_export(hand, drawn.result)

    def plan(self):
        return [
            *plan_steps.command_of_gimp("scale image"),
            'wait for "Image Size"',
            "press ctrl+a",
            f"type {quoted(str(self.values.width))}",
            "press tab",
            'click "Scale" near "Cancel"',
            "wait",
            *plan_steps.export_from_gimp(self.values.new),
        ]

    def wrong_results(self):
        drawn = self.values
        scaled = gimp.encoded(self.scaled())
        squeezed = gimp.encoded(self.picture().resize((drawn.width, drawn.height - 20)))
        cut = gimp.encoded(self.picture().crop((0, 0, drawn.width, drawn.height)))
        return {
            "the old file": lambda m: m.write(drawn.path, scaled),
            "out of proportion": lambda m: m.write(drawn.result, squeezed),
            "cut, not scaled": lambda m: m.write(drawn.result, cut),
            "with a dab of the brush": lambda m: m.write(
                drawn.result, gimp.encoded(gimp.dabbed(self.scaled()))
            ),
            "not scaled": lambda m: m.run("cp", drawn.path, drawn.result),
        }

    def right_result(self, machine):
        size = self.values.width, self.values.height
        soft = self.picture().resize(size, Image.Resampling.BILINEAR)
        machine.write(self.values.result, gimp.encoded(soft))

    def scaled(self) -> Image.Image:
        """Return the picture as it should be."""
        return self.picture().resize((self.values.width, self.values.height))
