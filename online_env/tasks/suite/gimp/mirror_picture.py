"""Mirror a picture or turn it upside down, in GIMP."""

from PIL import Image, ImageDraw

from online_env.tasks.kit import gimp, plan_steps
from online_env.tasks.kit.word_lists import FIRST_NAMES

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


class MirrorPicture(gimp.PictureTask):
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
        yield from machine.unexpected_changes(self.values.result)
        wanted = self.picture().transpose(self.values.method)
        yield from gimp.picture_problems(machine, self.values.result, wanted)

    def oracle(self, hand):
        gimp.undo_all(hand)
        gimp.gimp_command(hand, self.values.command)
        hand.wait_until_gone("frame", "Search Actions", "gimp")
        gimp.gimp_export(hand, self.values.result)

    def plan(self):
        return [
            *plan_steps.command_of_gimp(self.values.command),
            *plan_steps.export_from_gimp(self.values.new),
        ]

    def wrong_results(self):
        path, result, picture = self.values.path, self.values.result, self.picture()
        turned = picture.transpose(self.values.method)
        others = [method for _, method in WAYS.values() if method != self.values.method]
        other = picture.transpose(others[0])
        quarter = picture.transpose(Image.Transpose.ROTATE_90)
        spotted = turned.copy()
        ImageDraw.Draw(spotted).ellipse((90, 90, 110, 110), "black")
        return {
            "the old file": lambda m: m.write(path, gimp.encoded(turned)),
            "another way": lambda m: m.write(result, gimp.encoded(other)),
            "by 90 degrees": lambda m: m.write(result, gimp.encoded(quarter)),
            "with a dab of the brush": lambda m: m.write(result, gimp.encoded(spotted)),
            "only copied": lambda m: m.run("cp", path, result),
        }

    def right_result(self, machine):
        turned = self.picture().transpose(self.values.method)
        machine.write(self.values.result, gimp.encoded(turned.convert("RGBA")))
