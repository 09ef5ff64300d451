"""Find the one letter that mentions a number, and copy it."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.sample_files import move_files, rearranged
from online_env.tasks.kit.word_lists import CITIES, TOPICS, sample

YEARS = (2022, 2023, 2024)


class FindMention(Task):
    """Twelve files in three folders; another one has a number that only begins alike."""

    name = "find_mention"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "One of the files below Documents/Letters mentions the order number {number}. Copy that"
        " file to the Desktop, under the same name.",
        "I am looking for the letter about order {number}. It must be somewhere in my folder"
        " Documents/Letters. Please put a copy of it on the Desktop.",
        "grep for {number} in ~/Documents/Letters (with subfolders), then cp the file with exactly"
        " that number to ~/Desktop.",
    )

    def draw(self, stream):
        number = stream.integer(10_000, 89_999)
        cities = sample(stream, CITIES, 4)
        files = {}
        for year in YEARS:
            for city, topic in zip(cities, sample(stream, TOPICS, 4), strict=True):
                path = f"Documents/Letters/{year}/{topic} {year}.txt"
                files[path] = f"Your order {stream.integer(90_000, 99_999)} goes to {city}.\n"
        wanted, similar = sample(stream, list(files), 2)
        files[wanted] += f"With it comes what is left of order {number}.\n"
        files[similar] += f"Please pay for order {number}{stream.integer(10, 99)} today.\n"
        return {"number": number, "files": files, "wanted": wanted, "similar": similar}

    def prepare(self, machine):
        for path, text in self.values.files.items():
            machine.write(path, text)

    def copy(self, path):
        """Return the path and that of a copy on the desktop."""
        return path, f"Desktop/{path.rpartition('/')[2]}"

    def problems(self, machine):
        yield from rearranged(machine, copied=[self.copy(self.values.wanted)])

    def oracle(self, hand):
        shell.command(hand, f"grep -rw {self.values.number} Documents/Letters")
        shell.command(hand, f"cp '{self.values.wanted}' Desktop/")

    def plan(self):
        return plan_steps.run(
            f"grep -rw {self.values.number} Documents/Letters",
            f"cp '{self.values.wanted}' Desktop/",
        )

    def wrong_results(self):
        wanted, similar = self.copy(self.values.wanted), self.copy(self.values.similar)
        other = f"Desktop/{self.values.number}.txt"
        return {
            "a number that begins alike": lambda m: move_files(m, [similar], "cp"),
            "both": lambda m: move_files(m, [wanted, similar], "cp"),
            "moved": lambda m: move_files(m, [wanted]),
            "under another name": lambda m: move_files(m, [(wanted[0], other)], "cp"),
        }

    def right_result(self, machine):
        machine.write(self.copy(self.values.wanted)[1], self.values.files[self.values.wanted])
