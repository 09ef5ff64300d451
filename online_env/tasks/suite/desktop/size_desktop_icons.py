"""Change the size of the icons on the desktop, and of their texts."""

from online_env.tasks import Task
from online_env.tasks.kit import desktop_settings
from online_env.tasks.plan_words import quoted

APP = "xfdesktop-settings"


class SizeDesktopIcons(Task):
    """Two numbers on a page of the Desktop settings."""

    name = "size_desktop_icons"
    domain = "desktop"
    apps = ("desktop_settings",)
    phrasings = (
        "Make the icons on the desktop {size} pixels large, and set their custom font size to"
        " {font} (Settings, Desktop).",
        "The icons on my desktop should have another size: icon size {size}, font size {font}."
        " Please change that in the Desktop settings.",
        "Desktop settings, Icons: icon size {size}, custom font size {font}.",
    )

    def draw(self, stream):
        size = stream.choice((24, 32, 36, 40, 56, 64, 72, 80, 96))
        font = stream.choice((8, 9, 11, 12, 13, 14))
        return {"size": size, "font": font}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        wanted = {
            "desktop-icons/icon-size": str(self.values.size),
            "desktop-icons/use-custom-font-size": "true",
            "desktop-icons/font-size": str(self.values.font),
        }
        yield from desktop_settings.setting_problems(machine, "xfce4-desktop", wanted)

    def oracle(self, hand):
        desktop_settings.choose_tab(hand, "Icons", APP)
        desktop_settings.set_number(hand, "Icon size:", self.values.size, APP)
        desktop_settings.set_number(hand, "Use custom font size:", self.values.font, APP)

    def plan(self):
        return [
            'window "Desktop"',
            'click "Icons" near "Menus"',
            'double-click "48" near "Icon size:"',
            "press ctrl+a",
            f"type {quoted(str(self.values.size))}",
            "press tab",
            'double-click "10" near "Use custom font size:"',
            "press ctrl+a",
            f"type {quoted(str(self.values.font))}",
            "press tab",
            "wait",
        ]

    def wrong_results(self):
        size, font = self.values.size, self.values.font
        return {
            "only the icons": lambda m: resize(m, size, 10),
            "only the font": lambda m: resize(m, 48, font),
            "the wrong way round": lambda m: resize(m, font, size),
            "the font is not used": lambda m: resize(m, size, font, "false"),
        }

    def right_result(self, machine):
        resize(machine, self.values.size, f"{self.values.font}.000000")


def resize(machine, size, font, custom="true"):
    """Store two sizes."""
    values = {"icon-size": size, "font-size": font, "use-custom-font-size": custom}
    for name, value in values.items():
        desktop_settings.store(machine, "xfce4-desktop", f"desktop-icons/{name}", str(value))
