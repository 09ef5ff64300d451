"""Throw one file away, and get another one back from the trash."""

from online_env.tasks import Task
from online_env.tasks.kit import thunar
from online_env.tasks.kit.sample_files import sample_file
from online_env.tasks.kit.trash import move_to_trash, take_out, trashed_files
from online_env.tasks.kit.word_lists import TOPICS, sample
from online_env.tasks.plan_words import quoted

FOLDERS = ("Club", "Choir", "Allotment", "Parish")


class TrashAndRestore(Task):
    """Trash and folder both hold other files, which stay where they are."""

    name = "trash_and_restore"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        "Move {out} from Documents/{folder} to the trash, and restore {back} from the trash to"
        " where it was.",
        "I deleted the wrong file. Please get {back} back out of the trash, and throw {out} away"
        " instead: it is in the folder {folder} of my Documents.",
        "Documents/{folder}: {out} goes to the trash; {back} comes back from it. Do not empty the"
        " trash, and delete nothing for good.",
    )

    def draw(self, stream):
        names = [f"{topic}.txt" for topic in sample(stream, TOPICS, 6)]
        folder_path = f"Documents/{stream.choice(FOLDERS)}"
        return {
            "folder": folder_path.rpartition("/")[2],
            "place": folder_path,
            "kept": names[:3],
            "trash": names[3:],
            "out": names[0],
            "back": names[3],
        }

    def prepare(self, machine):
        for name in self.values.kept:
            machine.write(f"{self.values.place}/{name}", sample_file(name))
        for name in self.values.trash:
            move_to_trash(machine, f"{self.values.place}/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def problems(self, machine):
        folder_path = self.values.place
        out, restored = f"{folder_path}/{self.values.out}", f"{folder_path}/{self.values.back}"
        yield from machine.unexpected_changes(out, restored)
        if machine.exists(out):
            yield f"{out} is still there"
        if machine.read(restored) != sample_file(self.values.back):
            yield f"{restored} is not there as it was"
        expected = {f"{folder_path}/{name}" for name in [self.values.out, *self.values.trash[1:]]}
        trash = set(trashed_files(machine))
        if trash != expected:
            yield f"the trash holds {sorted(trash)}, not {sorted(expected)}"

    def oracle(self, hand):
        out, restored = self.values.out, self.values.back
        thunar.go(hand, self.values.place)
        if thunar.present(hand, out):
            thunar.select(hand, out)
            hand.press("delete")
            hand.wait_until_gone(thunar.ROWS, out, app="thunar")
        if thunar.present(hand, restored):
            return
        hand.click_on("table-cell", "Trash", app="thunar")
        hand.find("frame", "Trash - Thunar", app="thunar")
        thunar.as_list(hand)
        hand.context_menu(hand.find(thunar.ROWS, restored, app="thunar"), "Restore", app="thunar")
        hand.wait_until_gone(thunar.ROWS, restored, app="thunar")

    def plan(self):
        return [
            'window "Thunar"',
            f"click {quoted(self.values.out)}",
            "press delete",
            "wait",
            'click "Trash" near "Places"',
            f"right-click {quoted(self.values.back)}",
            'click "Restore"',
            "wait",
        ]

    def wrong_results(self):
        folder_path, out, restored = self.values.place, self.values.out, self.values.back
        other_file = self.values.trash[1]
        return {
            "deleted for good": lambda m: (
                m.run("rm", f"{folder_path}/{out}"),
                restore(m, folder_path, restored),
            ),
            "nothing restored": lambda m: trash(m, folder_path, out),
            "another one restored": lambda m: (
                trash(m, folder_path, out),
                restore(m, folder_path, other_file),
            ),
            "restored to Documents": lambda m: (
                trash(m, folder_path, out),
                restore(m, folder_path, restored),
                m.run("mv", f"{folder_path}/{restored}", "Documents"),
            ),
        }

    def right_result(self, machine):
        restore(machine, self.values.place, self.values.back)
        trash(machine, self.values.place, self.values.out)


def trash(machine, folder_path, name):
    """Move a file to the trash."""
    move_to_trash(machine, f"{folder_path}/{name}", machine.read(f"{folder_path}/{name}"))
    machine.run("rm", f"{folder_path}/{name}")


def restore(machine, folder_path, name):
    """Get a file out of the trash."""
    take_out(machine, f"{folder_path}/{name}")
