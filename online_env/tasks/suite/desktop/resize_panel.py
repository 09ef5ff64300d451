"""Make the panel higher or lower."""

from online_env.tasks import Task
from online_env.tasks.kit import desktop_settings
from online_env.tasks.plan_words import quoted

APP = "xfce4-panel"
PANEL = "panels/panel-1"


class ResizePanel(Task):
    """Two numbers in the preferences of the panel."""

    name = "resize_panel"
    domain = "desktop"
    apps = ("panel_settings",)
    phrasings = (
        "The preferences of the panel (the bar at the bottom of the screen) are open. Set its row"
        " size to {size} pixels and its number of rows to {rows}.",
        "Please give the panel {rows} rows of {size} pixels each.",
        "Panel: row size {size} px, number of rows {rows}.",
    )

    def draw(self, stream):
        size = stream.choice((24, 26, 28, 30, 32, 40, 42, 44, 46, 48))
        return {"size": size, "rows": stream.integer(2, 3)}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        wanted = {f"{PANEL}/size": str(self.values.size), f"{PANEL}/nrows": str(self.values.rows)}
        yield from desktop_settings.setting_problems(machine, "xfce4-panel", wanted)

    def oracle(self, hand):
        desktop_settings.set_number(hand, "Row size (pixels):", self.values.size, APP)
        desktop_settings.set_number(hand, "Number of rows:", self.values.rows, APP)
        hand.button("Close", APP)
        hand.wait_until_gone("dialog", "Panel Preferences", APP)

    def plan(self):
        return [
            'window "Panel"',
            'double-click "36" near "Row size (pixels):"',
            "press ctrl+a",
            f"type {quoted(str(self.values.size))}",
            "press tab",
            'double-click "1" near "Number of rows:"',
            "press ctrl+a",
            f"type {quoted(str(self.values.rows))}",
            "press tab",
            'click "Close"',
            "wait",
        ]

    def wrong_results(self):
        size, rows = self.values.size, self.values.rows
        return {
            "only the size": lambda m: shape(m, size, 1),
            "only the rows": lambda m: shape(m, 36, rows),
            "both rows together": lambda m: shape(m, size * rows, 1),
            "too high": lambda m: shape(m, size + 1, rows),
        }

    def right_result(self, machine):
        shape(machine, self.values.size, self.values.rows)


def shape(machine, size, rows):
    """Store the shape of the panel."""
    desktop_settings.store(machine, "xfce4-panel", f"{PANEL}/size", str(size))
    desktop_settings.store(machine, "xfce4-panel", f"{PANEL}/nrows", str(rows))
