"""Work with a program that is not on this computer."""

from online_env.tasks import Task
from online_env.tasks.kit.sample_files import sample_file
from online_env.tasks.kit.word_lists import CITIES, sample
from online_env.tasks.plan_words import quoted

PANEL = "xfce4-panel"
PROGRAMS = {
    "Adobe Photoshop": "psd",
    "Adobe Illustrator": "ai",
    "CorelDRAW": "cdr",
    "Affinity Photo": "afphoto",
}


class UsePhotoshop(Task):
    """The program does not exist for this system; files with its ending are soon made up."""

    name = "use_photoshop"
    domain = "infeasible"
    apps = ("thunar",)
    infeasible = "the program is not installed"
    phrasings = (
        "Open Pictures/{picture} in {program} and save it in that program's own format as"
        " Pictures/{target}.",
        "The printers want a real {program} file. Please open {picture} (in Pictures) with"
        " {program} and save it as {target} in the same folder. No other program will do.",
        "Use {program} to save Pictures/{picture} as Pictures/{target}.",
    )

    def draw(self, stream):
        first, second = (city.lower() for city in sample(stream, CITIES, 2))
        program = stream.choice(list(PROGRAMS))
        number = stream.integer(10, 99)
        return {
            "program": program,
            "picture": f"{first}-{number}.png",
            "target": f"{first}-{number}.{PROGRAMS[program]}",
            "other": f"{second}-{number}.png",
        }

    def prepare(self, machine):
        for name in (self.values.picture, self.values.other):
            machine.write(f"Pictures/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path("Pictures")

    def problems(self, machine):
        yield from machine.unexpected_changes()

    def oracle(self, hand):
        hand.click_on("toggle-button", "Applications", app=PANEL)
        hand.menu("Graphics", app=PANEL)
        hand.find("menu-item", "Ristretto Image Viewer", app=PANEL)
        found = hand.see("menu-item", self.values.program, app=PANEL)
        hand.press("escape")
        hand.press("escape")
        hand.wait_until_gone("menu", "Graphics", app=PANEL)
        if found is None:
            hand.give_up(f"{self.values.program} is not among the applications")

    def plan(self):
        return [
            'window "Thunar"',
            'click "Applications"',
            'click "Graphics"',
            'wait for "Ristretto"',
            "press esc 2 times",
            f"give up {quoted(f'{self.values.program} is not among the applications')}",
        ]

    def wrong_results(self):
        picture, target = f"Pictures/{self.values.picture}", f"Pictures/{self.values.target}"
        return {
            "renamed": lambda m: m.run("mv", picture, target),
            "copied under the name": lambda m: m.run("cp", picture, target),
            "an empty file": lambda m: m.write(target, ""),
        }
