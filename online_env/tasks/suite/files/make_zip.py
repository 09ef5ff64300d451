"""Pack some files of a folder into a ZIP archive."""

from pathlib import PurePosixPath

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.archives import make_zip, unpack
from online_env.tasks.kit.sample_files import sample_file
from online_env.tasks.kit.word_lists import LAST_NAMES, TOPICS, sample, shuffle
from online_env.tasks.plan_words import quoted

NAMES = tuple(name for name in LAST_NAMES if name.isascii() and name.isalpha())
LOOKS = 5
FOLDERS = ("Case file", "Application", "Estate", "Handover")


class MakeZip(Task):
    """Three of six files go into an archive in the same folder; the files stay."""

    name = "make_zip"
    domain = "files"
    apps = ("thunar", "xarchiver")
    phrasings = (
        "In Documents/{folder}, pack {a}, {b} and {c} into a ZIP archive {archive}, in the same"
        " folder. Keep the files.",
        "I want to send three files of Documents/{folder}: {a}, {b} and {c}. Please make a zip of"
        " just these, next to them, called {archive}.",
        "Make {archive} in Documents/{folder} with {a}, {b}, {c} in it, and nothing more.",
    )

    def draw(self, stream):
        names = [f"{topic}.pdf" for topic in sample(stream, TOPICS, 6)]
        folder_path = f"Documents/{stream.choice(FOLDERS)}"
        archive = f"{stream.choice(NAMES)}-{stream.integer(10, 99)}.zip"
        return {
            "folder": folder_path.rpartition("/")[2],
            "place": folder_path,
            "archive": archive,
            "path": f"{folder_path}/{archive}",
            "packed": names[:3],
            "a": names[0],
            "b": names[1],
            "c": names[2],
            "all": shuffle(stream, names),
        }

    def prepare(self, machine):
        for name in self.values.all:
            machine.write(f"{self.values.place}/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def problems(self, machine):
        yield from machine.unexpected_changes(self.values.path)
        data = machine.read(self.values.path)
        if data is None or data[:2] != b"PK":
            yield f"there is no ZIP archive {self.values.path}"
            return
        files = unpack(data) or {}
        inside = {PurePosixPath(path).name: files[path] for path in files}
        if inside != self.files(self.values.packed) or len(inside) != len(files):
            yield f"the archive holds {sorted(files)}"

    def files(self, names):
        """Return contents by name."""
        return {name: sample_file(name) for name in names}

    def oracle(self, hand):
        names = self.values.packed
        thunar.go(hand, self.values.place)
        if thunar.present(hand, self.values.archive):
            thunar.select(hand, self.values.archive)
            hand.press("delete")
        thunar.select(hand, *names)
        row = hand.find(thunar.ROWS, names[-1], app="thunar")
        hand.context_menu(row, "Create Archive...", app="thunar")
        hand.find("file-chooser", "Create a new archive", app="xarchiver")
        hand.replace(self.values.archive)
        hand.click(combo_box_beside(hand, "Archive type:"))
        hand.find("menu-item", "apk", app="xarchiver")
        hand.press("end")  # the list of types is longer than the screen
        hand.click_on("menu-item", "zip", app="xarchiver")
        hand.button("Create", app="xarchiver")
        hand.wait_until_gone("file-chooser", app="xarchiver")
        # Now and then Thunar crashes when files come and go, so its window may not show it.
        for _ in range(LOOKS):
            if thunar.present(hand, self.values.archive):
                return

    def plan(self):
        values = self.values
        return [
            'window "Thunar"',
            *plan_steps.choose(values.packed),
            f"right-click {quoted(values.packed[-1])}",
            'click "Create Archive"',
            'wait for "Archive type:"',
            "press ctrl+a",
            f"type {quoted(values.archive)}",
            'click below "Archive type:"',
            "press end",
            'click "zip"',
            'click "Create" near "Cancel"',
            f"wait for {quoted(values.archive)}",
        ]

    def wrong_results(self):
        path, names = self.values.path, self.values.packed
        everything = make_zip(self.files(self.values.all))
        return {
            "one is missing": lambda m: m.write(path, make_zip(self.files(names[:2]))),
            "all six": lambda m: m.write(path, everything),
            "an empty file": lambda m: m.write(path, ""),
            "moved into it": lambda m: (
                self.right_result(m),
                m.run("rm", f"{self.values.place}/{names[0]}"),
            ),
        }

    def right_result(self, machine):
        machine.write(self.values.path, make_zip(self.files(reversed(self.values.packed))))


def combo_box_beside(hand, label):
    """Return the combo box that stands right of a label."""
    _, top, right, _ = hand.find("label", label, app="xarchiver").box
    boxes = [node for node in hand.look() if node.role == "combo-box" and node.box]
    return next(node for node in boxes if node.box[1] == top and node.box[0] > right)
