"""Take the colours out of a picture, in GIMP."""

from PIL import Image, ImageChops

from online_env.tasks.kit import gimp, plan_steps
from online_env.tasks.kit.word_lists import CITIES


class GreyPicture(gimp.PictureTask):
    """A picture in shades of grey goes into a new file; the old one stays."""

    name = "grey_picture"
    phrasings = (
        "Make the picture {file}, which is open in GIMP, black and white (shades of grey), and"
        " export it as {new} in Pictures. The coloured file stays.",
        "For the newspaper I need Pictures/{file} without colours. Please convert it to greyscale"
        " in GIMP and save it as Pictures/{new}; do not change the original.",
        "Greyscale version of Pictures/{file}, please: Pictures/{new}.",
    )

    def draw(self, stream):
        name = f"{stream.choice(CITIES).lower()}-{stream.integer(1, 31)}"
        return {
            "file": f"{name}.png",
            "new": f"{name}-grey.png",
            "path": f"Pictures/{name}.png",
            "result": f"Pictures/{name}-grey.png",
            "size": (stream.integer(40, 60) * 10, stream.integer(30, 40) * 10),
        }

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.result)
        yield from gimp.grey_problems(machine, self.values.result, self.picture())

    def oracle(self, hand):
        gimp.undo_all(hand)
        gimp.gimp_command(hand, "grayscale")
        hand.find("frame", gimp.mode_title("Grayscale"), "gimp")
        gimp.gimp_export(hand, self.values.result)

    def plan(self):
        return [
            *plan_steps.command_of_gimp("grayscale"),
            *plan_steps.export_from_gimp(self.values.new),
        ]

    def wrong_results(self):
        path, result, picture = self.values.path, self.values.result, self.picture()
        grey = picture.convert("L")
        pale = Image.blend(picture, grey.convert("RGB"), 0.8)
        return {
            "the old file": lambda m: m.write(path, gimp.encoded(grey)),
            "pale colours": lambda m: m.write(result, gimp.encoded(pale)),
            "with a dab of the brush": lambda m: m.write(
                result, gimp.encoded(gimp.dabbed(grey).convert("L"))
            ),
            "only copied": lambda m: m.run("cp", path, result),
            "all black": lambda m: m.write(result, gimp.encoded(grey.point(lambda _: 0))),
        }

    def right_result(self, machine):
        red, green, blue = self.picture().split()
        value = ImageChops.lighter(ImageChops.lighter(red, green), blue)  # as a way of GIMP has it
        machine.write(self.values.result, gimp.encoded(value.convert("RGB")))
