"""Find the folder that takes the most room on the disk."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.word_lists import CITIES, sample, shuffled

KILO = 1024


class FindBigFolder(Task):
    """Most of its room is in a subfolder; another folder has more files."""

    name = "find_big_folder"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "Which of the folders in Documents/{place} takes the most disk space? Write its name, and"
        " nothing else, into the file Documents/{answer}.",
        "My disk is filling up. Find out which folder directly in ~/Documents/{place} is the"
        " biggest, with all that is in it, and save just its name as ~/Documents/{answer}.",
        "Use du to find out which folder directly in Documents/{place} is the largest; only its"
        " name goes into Documents/{answer}.",
    )

    def draw(self, stream):
        biggest, second, many, *rest = sample(stream, CITIES, 6)
        files = {f"{biggest}/info.txt": 2, f"{biggest}/raw/data/film.bin": stream.integer(700, 900)}
        files[f"{second}/film.bin"] = stream.integer(400, 550)
        files.update({f"{many}/{index}.txt": 4 for index in range(12)})
        files.update({f"{name}/notes.bin": stream.integer(20, 90) for name in rest})
        return {
            "place": stream.choice(("Travel", "Footage", "Reports", "Tours")),
            "answer": f"biggest-{stream.integer(10, 99)}.txt",
            "files": dict(shuffled(stream, list(files.items()))),
            "biggest": biggest,
            "second": second,
            "many": many,
        }

    def prepare(self, machine):
        for path, size in self.values.files.items():
            machine.write(f"Documents/{self.values.place}/{path}", b"0" * size * KILO)

    def problems(self, machine):
        answer = f"Documents/{self.values.answer}"
        yield from machine.unexpected_changes(answer)
        found = (machine.text(answer) or "").strip()
        if found.removeprefix("./").removesuffix("/") != self.values.biggest:
            yield f"{answer} holds {found[:80]!r}, not {self.values.biggest!r}"

    def oracle(self, hand):
        shell.command(hand, f"cd ~/Documents/{self.values.place}")
        shell.command(hand, "du -sk * | sort -n")
        shell.command(hand, f"echo {self.values.biggest} > ../{self.values.answer}")

    def plan(self):
        return plan_steps.run(
            f"cd ~/Documents/{self.values.place}",
            "du -sk * | sort -n",
            f"echo {self.values.biggest} > ../{self.values.answer}",
        )

    def wrong_results(self):
        biggest, second = self.values.biggest, self.values.second
        return {
            "the biggest file of its own": lambda m: self.save(m, second),
            "the most files": lambda m: self.save(m, self.values.many),
            "both": lambda m: self.save(m, f"{biggest}\n{second}"),
            "with its size": lambda m: self.save(m, f"904\t./{biggest}"),
            "its whole path": lambda m: self.save(m, f"Documents/{self.values.place}/{biggest}"),
            "in the home folder": lambda m: m.write(self.values.answer, biggest),
        }

    def right_result(self, machine):
        self.save(machine, f"./{self.values.biggest}/\n")

    def save(self, machine, answer):
        """Write an answer."""
        machine.write(f"Documents/{self.values.answer}", answer)
