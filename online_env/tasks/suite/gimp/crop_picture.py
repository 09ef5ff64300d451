"""Cut a picture to a size, in GIMP."""

from PIL import Image

from online_env.tasks.kit import gimp
from online_env.tasks.kit.word_lists import GOODS

CORNERS = ("top left", "top right", "bottom left", "bottom right")


class CropPicture(gimp.PictureTask):
    """What is left is a part of the picture at one of its corners, in the same file."""

    name = "crop_picture"
    phrasings = (
        "Crop the picture that GIMP shows to {width} × {height} pixels, so that its {corner} part"
        " is left, and export it over the old file {file}.",
        "Of {file} in my Pictures folder I only need the {corner} corner, {width} pixels wide and"
        " {height} pixels high. Please cut the rest off, in the file itself.",
        "Cut Pictures/{file} down to its {corner} {width} × {height} pixels (same file name).",
    )

    def draw(self, stream):
        size = stream.integer(60, 80) * 10, stream.integer(40, 50) * 10
        width, height = size[0] - stream.integer(50, 250), size[1] - stream.integer(50, 150)
        corner = stream.choice(CORNERS)
        left = size[0] - width if "right" in corner else 0
        top = size[1] - height if "bottom" in corner else 0
        name = f"{stream.choice(GOODS)}.png"
        return {
            "file": name,
            "path": f"Pictures/{name}",
            "size": size,
            "width": width,
            "height": height,
            "corner": corner,
            "left": left,
            "top": top,
            "box": (left, top, left + width, top + height),
        }

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        yield from gimp.picture_problems(machine, self.values.path, self.cut(self.values.box))

    def oracle(self, hand):
        drawn = self.values
        gimp.undo_all(hand)
        gimp.gimp_command(hand, "canvas size")
        hand.find("dialog", "Set Image Canvas Size", "gimp")
        gimp.set_canvas(hand, drawn.width, drawn.height, -drawn.left, -drawn.top)
        hand.find("frame", gimp.size_title(drawn.width, drawn.height), "gimp")
        gimp.gimp_export(hand, drawn.path)

    def wrong_results(self):
        path, size = self.values.path, (self.values.width, self.values.height)
        left, top, right, bottom = self.values.box
        cut = gimp.encoded(self.cut(self.values.box))
        whole_width = self.cut((0, top, self.values.size[0], bottom))
        shift = 2 if left == 0 else -2
        beside = self.cut((left + shift, top, right + shift, bottom))
        return {
            "a little beside": lambda m: m.write(path, gimp.encoded(beside)),
            "with a dab of the brush": lambda m: m.write(
                path, gimp.encoded(gimp.dabbed(self.cut(self.values.box)))
            ),
            "only the height": lambda m: m.write(path, gimp.encoded(whole_width)),
            "scaled": lambda m: m.write(path, gimp.encoded(self.picture().resize(size))),
            "in a copy": lambda m: m.write("Pictures/cut.png", cut),
        }

    def right_result(self, machine):
        cut = self.cut(self.values.box).convert("RGBA")
        machine.write(self.values.path, gimp.encoded(cut))

    def cut(self, box) -> Image.Image:
        """Return a part of it."""
        return self.picture().crop(box)
