"""Put a picture on the background of the desktop."""

from hijack_data.rng import Stream
from online_env.tasks import Task
from online_env.tasks.kit import desktop_settings, gimp
from online_env.tasks.kit.word_lists import CITIES, sample
from online_env.tasks.plan_words import quoted

ITEMS = ("table-cell", "list-item")
WORKSPACE = "backdrop/screen0/monitorscreen/workspace0"
PLACE = f"{WORKSPACE}/last-image"
STYLE = f"{WORKSPACE}/image-style"
NO_PICTURE = "0"


class SetWallpaper(Task):
    """One of four pictures in a folder becomes the wallpaper."""

    name = "set_wallpaper"
    domain = "desktop"
    apps = ("thunar",)
    phrasings = (
        "The file manager shows my pictures of {folder}. Set {file} as the wallpaper of the"
        " desktop.",
        "Please put the picture {file} (in Pictures/{folder}) on the background of my desktop.",
        "New wallpaper, please: Pictures/{folder}/{file}.",
    )

    def draw(self, stream):
        cities = [city.lower() for city in sample(stream, CITIES, 5)]
        folder = cities.pop()
        files = [f"{city}-{stream.integer(1, 99)}.png" for city in cities]
        return {
            "folder": folder,
            "place": f"Pictures/{folder}",
            "files": files,
            "file": stream.choice(files),
        }

    def prepare(self, machine):
        for name in self.values.files:
            picture = gimp.drawing(Stream(self.seed, name), 320, 180)
            machine.write(f"{self.values.place}/{name}", gimp.encode(picture))

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        expected = {PLACE: machine.path(f"{self.values.place}/{self.values.file}")}
        yield from desktop_settings.setting_problems(machine, "xfce4-desktop", expected)
        if desktop_settings.setting(machine, "xfce4-desktop", STYLE) == NO_PICTURE:
            yield "the background shows no picture, but a colour"

    def oracle(self, hand):
        hand.press("ctrl", "2")  # as a list: the accessibility tree of Thunar has no icons
        item = hand.find(ITEMS, self.values.file, app="thunar")
        hand.context_menu(item, "Set as wallpaper", app="thunar")
        hand.wait_until_gone("menu-item", "Set as wallpaper", app="thunar")

    def plan(self):
        return [
            'window "Thunar"',
            f"right-click {quoted(self.values.file)}",
            'click "Set as wallpaper"',
            "wait",
        ]

    def wrong_results(self):
        folder = self.values.place
        file = self.values.file
        other_file = next(name for name in self.values.files if name != file)
        copy = "Pictures/wallpaper.png"
        return {
            "another picture": lambda m: show(m, f"{folder}/{other_file}"),
            "only copied": lambda m: m.run("cp", f"{folder}/{file}", copy),
            "set, but not shown": lambda m: (
                show(m, f"{folder}/{file}"),
                desktop_settings.store(m, "xfce4-desktop", STYLE, NO_PICTURE),
            ),
            "a path that is not there": lambda m: show(m, f"Pictures/{file}"),
        }

    def right_result(self, machine):
        show(machine, f"{self.values.place}/{self.values.file}")


def show(machine, path):
    """Store what the background shows."""
    desktop_settings.store(machine, "xfce4-desktop", PLACE, machine.path(path))
