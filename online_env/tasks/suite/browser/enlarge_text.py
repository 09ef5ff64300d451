"""Set the size of the text of web pages, and their zoom."""

import math
import re

from online_env.tasks import Task
from online_env.tasks.kit import chromium, plan_steps
from online_env.tasks.kit.pages import visit
from online_env.tasks.plan_words import quoted

SIZE = "webkit.webprefs.default_font_size"
SIZES = {"Very small": 9, "Small": 12, "Large": 20, "Very large": 24}
ZOOM = "partition.default_zoom_level"
ZOOMS = (75, 80, 90, 110, 125, 150)
ZOOM_BASE = 1.2  # the stored level is the logarithm of the zoom to this base


class EnlargeText(Task):
    """Two drop-down lists of the page about appearance."""

    name = "enlarge_text"
    domain = "browser"
    apps = ("chrome",)
    phrasings = (
        'Set the font size of Chromium to "{size}", and the zoom for all pages to {zoom} %.',
        "In the appearance settings of the browser, choose the font size {size} and a page zoom"
        " of {zoom} %.",
        "Chromium: font size {size}, page zoom {zoom} % (in the settings, for all sites).",
    )

    def draw(self, stream):
        return {"size": stream.choice(list(SIZES)), "zoom": stream.choice(ZOOMS)}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        size = SIZES[self.values.size]
        expected = math.log(self.values.zoom / 100, ZOOM_BASE)
        yield from chromium.wrong_settings(machine, {SIZE: size})
        zoom = (chromium.setting(machine, ZOOM) or {}).get("x", 0.0)
        if abs(zoom - expected) >= 0.01:
            yield f"the level of the zoom is {zoom}, not {expected:.3f}"

    def oracle(self, hand):
        visit(hand, "chrome://settings/appearance", "Settings - Appearance")
        for name, option in (
            ("Font size", self.values.size),
            ("Page zoom", f"{self.values.zoom}%"),
        ):
            hand.click_on("combo-box", name, app="chrom", scroll=True)
            hand.click_on("menu-item", re.compile(rf"\s*{option}\s*$"), app="chrom")
            hand.wait_until_gone("menu-item", app="chrom")

    def plan(self):
        return [
            'window "Chromium"',
            *plan_steps.visit("chrome://settings/appearance", "Font size"),
            'click "Medium (Recommended)"',
            f"click {quoted(self.values.size)}",
            'scroll down to "Page zoom"',
            'click "100%" near "Page zoom"',
            f"click {quoted(f'{self.values.zoom}%')}",
            "wait",
        ]

    def wrong_results(self):
        def write_settings(size, zoom):
            def change(machine):
                chromium.change_setting(machine, SIZE, size)
                level = math.log(zoom / 100, ZOOM_BASE)
                chromium.change_setting(machine, ZOOM, {"x": level})

            return change

        size, zoom = SIZES[self.values.size], self.values.zoom
        return {
            "only the size": lambda m: chromium.change_setting(m, SIZE, size),
            "another zoom": write_settings(size, zoom + 25),
            "another size": write_settings(size + 1, zoom),
        }

    def right_result(self, machine):
        level = math.log(self.values.zoom / 100, ZOOM_BASE)
        chromium.change_setting(machine, ZOOM, {"x": round(level, 6)})
        chromium.change_setting(machine, SIZE, SIZES[self.values.size])
