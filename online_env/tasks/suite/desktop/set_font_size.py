"""Make the texts of the desktop larger or smaller."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import desktop_settings
from online_env.tasks.plan_words import quoted

APP = "xfce4-appearance-settings"
FONTS = {
    "default font": ("Gtk/FontName", "Noto Sans", "Noto Sans"),
    "default monospace font": ("Gtk/MonospaceFontName", "DejaVu Sans Mono", "DejaVu Sans Mono"),
}
TEN = {"Gtk/FontName": "Noto Sans 10", "Gtk/MonospaceFontName": "DejaVu Sans Mono 10"}


class SetFontSize(Task):
    """The size of one of two fonts changes; both families, and the other size, stay."""

    name = "set_font_size"
    domain = "desktop"
    apps = ("appearance",)
    phrasings = (
        "Set the size of the desktop's {which} to {size} (Settings, Appearance). The kind of font"
        " stays the same.",
        "I cannot read well what is on the screen. Please give the {which} in the Appearance"
        " settings the size {size}, but do not choose another font.",
        "Appearance: {which} at size {size}, same family as before.",
    )

    def draw(self, stream):
        which = stream.choice(list(FONTS))
        key, button, family = FONTS[which]
        size = stream.choice((8, 9, 11, 12, 13, 14, 15, 16))
        wanted = {**TEN, key: f"{family} {size}"}
        return {"which": which, "key": key, "button": button, "size": size, "wanted": wanted}

    def prepare(self, machine):
        for key, font in TEN.items():
            if desktop_settings.setting(machine, "xsettings", key) is None:
                desktop_settings.store(machine, "xsettings", key, font)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from desktop_settings.setting_problems(machine, "xsettings", self.values.wanted)

    def oracle(self, hand):
        desktop_settings.choose_tab(hand, "Fonts", APP)
        hand.button(re.compile(self.values.button), APP)
        hand.find("dialog", re.compile("Select a"), APP)
        desktop_settings.set_number(hand, "Size", self.values.size, APP)
        hand.button("Select", APP)
        hand.wait_until_gone("dialog", re.compile("Select a"), APP)

    def plan(self):
        return [
            'window "Appearance"',
            'click "Fonts"',
            f"click {quoted(TEN[self.values.key])}",
            'double-click "10" near "Size"',
            "press ctrl+a",
            f"type {quoted(str(self.values.size))}",
            "press tab",
            'click "Select" near "Cancel"',
            "wait",
        ]

    def wrong_results(self):
        key = self.values.key
        other = next(name for name in TEN if name != key)
        family = TEN[key].removesuffix(" 10")
        size = self.values.size
        return {
            "another size": lambda m: desktop_settings.store(
                m, "xsettings", key, f"{family} {size + 1}"
            ),
            "another family": lambda m: desktop_settings.store(
                m, "xsettings", key, f"DejaVu Serif {size}"
            ),
            "the other font": lambda m: desktop_settings.store(
                m, "xsettings", other, TEN[other].replace("10", str(size))
            ),
        }

    def right_result(self, machine):
        desktop_settings.store(
            machine, "xsettings", self.values.key, self.values.wanted[self.values.key]
        )
