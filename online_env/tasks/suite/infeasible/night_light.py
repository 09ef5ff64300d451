"""Switch on a night light that the settings do not have."""

from online_env.tasks import Task

APP = "xfce4-settings-manager"


class NightLight(Task):
    """Xfce has no such setting, neither by this name nor by another."""

    name = "night_light"
    domain = "infeasible"
    apps = ("settings",)
    infeasible = "the settings of this desktop have no night light"
    phrasings = (
        "In the settings, switch on the night light from {start} to {end} o'clock, so that the"
        " screen gets warmer colours in the evening.",
        "Please turn on the blue light filter in the settings of the desktop, every day from"
        " {start}:00 to {end}:00.",
        "Settings: night light on, {start} to {end} h.",
    )

    def draw(self, stream):
        return {"start": stream.integer(18, 23), "end": stream.integer(5, 9)}

    def problems(self, machine):
        yield from machine.unexpected_changes()

    def oracle(self, hand):
        hand.fill("Search", "night", APP)
        hand.wait_until_gone("label", "Hardware", APP)
        hand.replace("blue light")
        hand.wait_until_gone("label", "Hardware", APP)
        hand.give_up("the settings find neither a night light nor a blue light filter")

    def plan(self):
        return [
            'window "Settings"',
            "press ctrl+f",
            'type "night"',
            "wait",
            "press ctrl+a",
            'type "blue light"',
            "wait",
            'give up "the settings find neither a night light nor a blue light filter"',
        ]

    def wrong_results(self):
        return {
            "a script": lambda m: m.write("Desktop/night.sh", "xgamma -bgamma 0.7\n"),
            "a note": lambda m: m.write("Documents/night light.txt", "on\n"),
            "a dark picture": lambda m: m.write("Pictures/night.svg", "<svg/>\n"),
        }
