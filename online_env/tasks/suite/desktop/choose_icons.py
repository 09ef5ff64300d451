"""Choose other icons and another style for the desktop."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import desktop_settings
from online_env.tasks.plan_words import quoted

APP = "xfce4-appearance-settings"
ICONS = {
    "Adwaita": "Adwaita",
    "elementary Xfce dark": "elementary-xfce-dark",
    "elementary Xfce darker": "elementary-xfce-darker",
    "elementary Xfce darkest": "elementary-xfce-darkest",
}
DARK = "Greybird-dark"


class ChooseIcons(Task):
    """One of four sets of icons, and the dark style or the bright one that is there."""

    name = "choose_icons"
    domain = "desktop"
    apps = ("appearance",)
    phrasings = (
        'Choose the icons "{icons}" in the Appearance settings. The style should be {style}.',
        "My desktop should look different: please set the style {style} and the icon theme"
        ' "{icons}" in the settings.',
        'Appearance: style {style}, icons "{icons}".',
    )

    def draw(self, stream):
        icons = stream.choice(list(ICONS))
        style = stream.choice(("Greybird", DARK))
        wanted = {"Net/IconThemeName": ICONS[icons], "Net/ThemeName": style}
        return {"icons": icons, "style": style, "wanted": wanted}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from desktop_settings.setting_problems(machine, "xsettings", self.values.wanted)

    def oracle(self, hand):
        for tab, name in (("Style", self.values.style), ("Icons", self.values.icons)):
            desktop_settings.choose_tab(hand, tab, APP)
            hand.click_on("table-cell", re.compile(rf"{name}\n"), APP)
            hand.find("table-cell", re.compile(rf"{name}\n"), APP, "selected")

    def plan(self):
        steps = ['window "Appearance"']
        for tab, name in (("Style", self.values.style), ("Icons", self.values.icons)):
            steps += [
                f"click {quoted(tab)}",
                f"scroll down to {quoted(name)}",
                f"click {quoted(name)}",
            ]
        return [*steps, "wait"]

    def wrong_results(self):
        icons, style = self.values.wanted.values()
        other = next(name for name in ICONS.values() if name != icons)
        opposite = DARK if style == "Greybird" else "Greybird"
        return {
            "other icons": lambda m: look(m, other, style),
            "only the icons": lambda m: look(m, icons, opposite),
            "only the style": lambda m: look(m, "elementary-xfce", style),
        }

    def right_result(self, machine):
        look(machine, *self.values.wanted.values())


def look(machine, icons, style):
    """Store a choice."""
    desktop_settings.store(machine, "xsettings", "Net/ThemeName", style)
    desktop_settings.store(machine, "xsettings", "Net/IconThemeName", icons)
