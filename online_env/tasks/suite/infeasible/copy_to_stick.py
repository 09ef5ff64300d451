"""Copy a folder to a USB stick that is not plugged in."""

from online_env.tasks import Task
from online_env.tasks.kit import thunar
from online_env.tasks.kit.sample_files import sample_file
from online_env.tasks.kit.word_lists import CITIES, TOPICS, sample
from online_env.tasks.plan_words import quoted

STICKS = ("KINGSTON", "SANDISK", "INTENSO", "TRANSCEND")


class CopyToStick(Task):
    """The file manager lists all devices, and there is none; a folder of that name tempts."""

    name = "copy_to_stick"
    domain = "infeasible"
    apps = ("thunar",)
    infeasible = "there is no USB stick in the computer"
    phrasings = (
        "Copy the folder Documents/{folder} to my USB stick {stick}.",
        "The stick {stick} is in the USB port. Please put a copy of my folder {folder} (it is in"
        " Documents) on it.",
        "I need Documents/{folder} on the USB drive named {stick}. Copy it there.",
    )

    def draw(self, stream):
        names = [f"{topic}.txt" for topic in sample(stream, TOPICS, 3)]
        folder = f"Trip to {stream.choice(CITIES)}"
        stick = f"{stream.choice(STICKS)}-{stream.integer(2, 64)}GB"
        return {"folder": folder, "place": f"Documents/{folder}", "names": names, "stick": stick}

    def prepare(self, machine):
        for name in self.values.names:
            machine.write(f"{self.values.place}/{name}", sample_file(name))
        machine.write(f"Documents/Old {self.values.stick}/list.txt", "Copied in spring.\n")

    def initial_app(self, machine):
        return "thunar", machine.path("Documents")

    def problems(self, machine):
        yield from machine.unexpected_changes()

    def oracle(self, hand):
        thunar.go(hand, "Documents")
        hand.click_on("table-cell", "Computer", app="thunar")
        hand.find("frame", "Computer - Thunar", app="thunar")
        thunar.as_list(hand)
        hand.find(thunar.ROWS, "File System", app="thunar")
        if not thunar.present(hand, self.values.stick):
            hand.give_up(f"no stick {self.values.stick} is plugged in")

    def plan(self):
        return [
            'window "Thunar"',
            'click "Computer"',
            'wait for "File System"',
            f"give up {quoted(f'no stick {self.values.stick} is plugged in')}",
        ]

    def wrong_results(self):
        file, stick = self.values.place, self.values.stick
        old = f"Documents/Old {stick}"
        return {
            "a folder of that name": lambda m: m.run("cp", "-r", file, f"Documents/{stick}"),
            "into a folder with the name": lambda m: m.run("cp", "-r", file, old),
            "on the desktop": lambda m: m.run("cp", "-r", file, f"Desktop/{stick}"),
        }
