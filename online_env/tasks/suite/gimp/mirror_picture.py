"""Mirror a picture or turn it upside down, in GIMP."""

from PIL import Image, ImageDraw

from online_env.tasks.kit import pictures, told
from online_env.tasks.kit.words import FIRST_NAMES

WAYS = {
    "Mirror it, so that left and right change places": (
        "flip image horizontally",
        Image.Transpose.FLIP_LEFT_RIGHT,
    ),
    "Flip it, so that top and bottom change places": (
        "flip image vertically",
        Image.Transpose.FLIP_TOP_BOTTOM,
    ),
    "Turn it by 180 degrees": ("turn the image upside-down", Image.Transpose.ROTATE_180),
}


class MirrorPicture(pictures.PictureTask):
    """A turned picture goes into a new file; the old one stays."""

    name = "mirror_picture"
    phrasings = (
        "{file} is open in GIMP. {way}, and export the result as {new} in the folder Pictures. The"
        " file {file} itself stays as it is.",
        "I need another version of Pictures/{file}. {way}. It should be Pictures/{new}, and the"
        " old picture must not change.",
        "Open picture: {file}. {way}; then export it to Pictures/{new}.",
    )

    def draw(self, stream):
        person = "".join(c for c in stream.choice(FIRST_NAMES).lower() if c.isascii())
        number = stream.integer(100, 999)
        way = stream.choice(list(WAYS))
        command, method = WAYS[way]
        return {
            "file": f"{person}-{number}.png",
            "new": f"{person}-{number}-new.png",
            "path": f"Pictures/{person}-{number}.png",
            "result": f"Pictures/{person}-{number}-new.png",
            "size": (stream.integer(40, 60) * 10, stream.integer(30, 40) * 10),
            "way": way,
            "command": command,
            "method": method,
        }

    def problems(self, machine):
        yield from machine.untouched(self.drawn.result)
        wanted = self.picture().transpose(self.drawn.method)
        yield from pictures.picture_problems(machine, self.drawn.result, wanted)

    def oracle(self, hand):
        pictures.undo_all(hand)
        pictures.gimp_command(hand, self.drawn.command)
        hand.gone("frame", "Search Actions", "gimp")
        pictures.gimp_export(hand, self.drawn.result)

    def plan(self):
        return [*told.command_of_gimp(self.drawn.command), *told.export_from_gimp(self.drawn.new)]

    def wrong(self):
        path, result, picture = self.drawn.path, self.drawn.result, self.picture()
        turned = picture.transpose(self.drawn.method)
        others = [method for _, method in WAYS.values() if method != self.drawn.method]
        other = picture.transpose(others[0])
        quarter = picture.transpose(Image.Transpose.ROTATE_90)
        spotted = turned.copy()
        ImageDraw.Draw(spotted).ellipse((90, 90, 110, 110), "black")
        return {
            "the old file": lambda m: m.write(path, pictures.encoded(turned)),
            "another way": lambda m: m.write(result, pictures.encoded(other)),
            "by 90 degrees": lambda m: m.write(result, pictures.encoded(quarter)),
            "with a dab of the brush": lambda m: m.write(result, pictures.encoded(spotted)),
            "only copied": lambda m: m.run("cp", path, result),
        }

    def right(self, machine):
        turned = self.picture().transpose(self.drawn.method)
        machine.write(self.drawn.result, pictures.encoded(turned.convert("RGBA")))
