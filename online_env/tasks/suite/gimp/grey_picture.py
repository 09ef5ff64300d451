"""Take the colours out of a picture, in GIMP."""

from PIL import Image, ImageChops

from online_env.tasks.kit import pictures, told
from online_env.tasks.kit.words import CITIES


class GreyPicture(pictures.PictureTask):
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
        yield from machine.untouched(self.drawn.result)
        yield from pictures.grey_problems(machine, self.drawn.result, self.picture())

    def oracle(self, hand):
        pictures.undo_all(hand)
        pictures.gimp_command(hand, "grayscale")
        hand.find("frame", pictures.mode_title("Grayscale"), "gimp")
        pictures.gimp_export(hand, self.drawn.result)

    def plan(self):
        return [*told.command_of_gimp("grayscale"), *told.export_from_gimp(self.drawn.new)]

    def wrong(self):
        path, result, picture = self.drawn.path, self.drawn.result, self.picture()
        grey = picture.convert("L")
        pale = Image.blend(picture, grey.convert("RGB"), 0.8)
        return {
            "the old file": lambda m: m.write(path, pictures.encoded(grey)),
            "pale colours": lambda m: m.write(result, pictures.encoded(pale)),
            "with a dab of the brush": lambda m: m.write(
                result, pictures.encoded(pictures.dabbed(grey).convert("L"))
            ),
            "only copied": lambda m: m.run("cp", path, result),
            "all black": lambda m: m.write(result, pictures.encoded(grey.point(lambda _: 0))),
        }

    def right(self, machine):
        red, green, blue = self.picture().split()
        value = ImageChops.lighter(ImageChops.lighter(red, green), blue)  # as a way of GIMP has it
        machine.write(self.drawn.result, pictures.encoded(value.convert("RGB")))
