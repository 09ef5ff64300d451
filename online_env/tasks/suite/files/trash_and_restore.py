"""Throw one file away, and get another one back from the trash."""

from online_env.tasks import Task
from online_env.tasks.kit import thunar
from online_env.tasks.kit.files import sample_file
from online_env.tasks.kit.trash import take_out, throw_away, thrown_away
from online_env.tasks.kit.words import TOPICS, sample
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
        place = f"Documents/{stream.choice(FOLDERS)}"
        return {
            "folder": place.rpartition("/")[2],
            "place": place,
            "kept": names[:3],
            "trash": names[3:],
            "out": names[0],
            "back": names[3],
        }

    def prepare(self, machine):
        for name in self.drawn.kept:
            machine.write(f"{self.drawn.place}/{name}", sample_file(name))
        for name in self.drawn.trash:
            throw_away(machine, f"{self.drawn.place}/{name}", sample_file(name))

    def opens(self, machine):
        return "thunar", machine.path(self.drawn.place)

    def problems(self, machine):
        place = self.drawn.place
        out, back = f"{place}/{self.drawn.out}", f"{place}/{self.drawn.back}"
        yield from machine.untouched(out, back)
        if machine.exists(out):
            yield f"{out} is still there"
        if machine.read(back) != sample_file(self.drawn.back):
            yield f"{back} is not there as it was"
        wanted = {f"{place}/{name}" for name in [self.drawn.out, *self.drawn.trash[1:]]}
        found = set(thrown_away(machine))
        if found != wanted:
            yield f"the trash holds {sorted(found)}, not {sorted(wanted)}"

    def oracle(self, hand):
        out, back = self.drawn.out, self.drawn.back
        thunar.go(hand, self.drawn.place)
        if thunar.present(hand, out):
            thunar.select(hand, out)
            hand.press("delete")
            hand.gone(thunar.ROWS, out, app="thunar")
        if thunar.present(hand, back):
            return
        hand.click_on("table-cell", "Trash", app="thunar")
        hand.find("frame", "Trash - Thunar", app="thunar")
        thunar.as_list(hand)
        hand.context_menu(hand.find(thunar.ROWS, back, app="thunar"), "Restore", app="thunar")
        hand.gone(thunar.ROWS, back, app="thunar")

    def plan(self):
        return [
            'window "Thunar"',
            f"click {quoted(self.drawn.out)}",
            "press delete",
            "wait",
            'click "Trash" near "Places"',
            f"right-click {quoted(self.drawn.back)}",
            'click "Restore"',
            "wait",
        ]

    def wrong(self):
        place, out, back = self.drawn.place, self.drawn.out, self.drawn.back
        other = self.drawn.trash[1]
        return {
            "deleted for good": lambda m: (m.run("rm", f"{place}/{out}"), restore(m, place, back)),
            "nothing restored": lambda m: trash(m, place, out),
            "another one restored": lambda m: (trash(m, place, out), restore(m, place, other)),
            "restored to Documents": lambda m: (
                trash(m, place, out),
                restore(m, place, back),
                m.run("mv", f"{place}/{back}", "Documents"),
            ),
        }

    def right(self, machine):
        restore(machine, self.drawn.place, self.drawn.back)
        trash(machine, self.drawn.place, self.drawn.out)


def trash(machine, place, name):
    """Move a file to the trash."""
    throw_away(machine, f"{place}/{name}", machine.read(f"{place}/{name}"))
    machine.run("rm", f"{place}/{name}")


def restore(machine, place, name):
    """Get a file out of the trash."""
    take_out(machine, f"{place}/{name}")
