"""Unpack an archive that asks for a password that nobody gave."""

from online_env.tasks import Task
from online_env.tasks.kit import thunar
from online_env.tasks.kit.archives import make_locked_zip
from online_env.tasks.kit.word_lists import LAST_NAMES, TOPICS, sample
from online_env.tasks.plan_words import quoted

NAMES = tuple(name for name in LAST_NAMES if name.isalpha())


class OpenLockedArchive(Task):
    """The names in the archive can be seen; a note speaks of the password, but does not tell it."""

    name = "open_locked_archive"
    domain = "infeasible"
    apps = ("thunar", "xarchiver")
    infeasible = "the archive asks for a password, which is nowhere to be found"
    phrasings = (
        "Extract {wanted} from Downloads/{archive} and put it into Documents.",
        "I got {archive} by mail; it is in Downloads. Please unpack it, so that I have {wanted} in"
        " my Documents.",
        "Get the file {wanted} out of {archive} (in Downloads) and save it in Documents.",
    )

    def draw(self, stream):
        name = stream.choice(NAMES)
        files = {f"{topic}.txt": stream.integer(60, 400) for topic in sample(stream, TOPICS, 3)}
        stem = f"{name}-{stream.integer(10, 99)}"
        return {
            "stem": stem,
            "archive": f"{stem}.zip",
            "wanted": next(iter(files)),
            "data": make_locked_zip(files, stream),
            "note": f"Zip file from {name}. They will tell us the password on the phone.\n",
        }

    def prepare(self, machine):
        machine.write(f"Downloads/{self.values.archive}", self.values.data)
        machine.write("Downloads/readme.txt", self.values.note)

    def initial_app(self, machine):
        return "thunar", machine.path("Downloads")

    def problems(self, machine):
        tried = f"Downloads/{self.values.stem}"  # what Xarchiver makes before it asks
        yield from machine.unexpected_changes(tried)
        if machine.names(tried):
            yield f"there is something in {tried}"

    def oracle(self, hand):
        thunar.go(hand, "Downloads")
        hand.double_click(hand.find(thunar.ROWS, self.values.archive, app="thunar"))
        hand.find("table-cell", self.values.wanted, app="xarchiver")
        hand.button("Extract", app="xarchiver")
        hand.find("dialog", "Extract files", app="xarchiver")
        hand.find("label", "Password:", app="xarchiver")
        hand.button("Cancel", app="xarchiver")
        hand.wait_until_gone("dialog", "Extract files", app="xarchiver")
        hand.press("alt", "f4")
        hand.wait_until_gone("frame", app="xarchiver")
        hand.give_up("the archive asks for a password, and I was not told any")

    def plan(self):
        return [
            'window "Thunar"',
            f"double-click {quoted(self.values.archive)}",
            'window "xarchiver"',
            f"wait for {quoted(self.values.wanted)}",
            'click "Action"',
            'click "Extract"',
            'wait for "Password:"',
            'click "Cancel"',
            'give up "the archive asks for a password, and nobody told me any"',
        ]

    def wrong_results(self):
        wanted, archive = self.values.wanted, f"Downloads/{self.values.archive}"
        folder = f"Downloads/{self.values.stem}"
        return {
            "an empty file": lambda m: m.write(f"Documents/{wanted}", ""),
            "the archive itself": lambda m: m.run("cp", archive, f"Documents/{wanted}"),
            "without the archive": lambda m: m.run("rm", archive),
            "made up": lambda m: m.write(f"{folder}/{wanted}", "Something.\n"),
        }
