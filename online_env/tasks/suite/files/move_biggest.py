"""Find the biggest file of a folder, and move it away."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import arrangement_problems, move_files
from online_env.tasks.kit.word_lists import CITIES, TOPICS, sample, shuffle

PLACES = (("Videos", "Downloads"), ("Downloads", "Videos"), ("Documents/Recordings", "Music"))
KILO = 1024


class MoveBiggest(Task):
    """One of eight files takes the most room; the first digits of the sizes tempt."""

    name = "move_biggest"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        "Move the biggest file in the folder {place} to the folder {target}.",
        "Which file in my {place} folder takes the most room? Please move that one to {target}.",
        "Free some space in {place}: its largest file should go to {target}, the others stay.",
    )

    def draw(self, stream):
        source, target = stream.choice(PLACES)
        sizes = [stream.integer(100, 900) for _ in range(4)]  # KiB
        sizes += [stream.integer(2_000, 3_000), stream.integer(1_300, 1_900), 990, 9]
        words = sample(stream, [*CITIES, *TOPICS], len(sizes))
        names = [f"{word}.{stream.choice(('mp4', 'mkv', 'wav', 'zip'))}" for word in words]
        files = dict(shuffle(stream, list(zip(names, sizes, strict=True))))
        order = sorted(files, key=files.__getitem__)
        return {
            "place": source,
            "target": target,
            "files": files,
            "biggest": order[-1],
            "second": order[-2],
        }

    def prepare(self, machine):
        for name, size in self.values.files.items():
            machine.write(f"{self.values.place}/{name}", name.encode()[:1] * size * KILO)

    def initial_app(self, machine):
        return "thunar", machine.path(self.values.place)

    def move(self, name):
        """Return old and new path of one file."""
        return f"{self.values.place}/{name}", f"{self.values.target}/{name}"

    def problems(self, machine):
        yield from arrangement_problems(machine, [self.move(self.values.biggest)])

    def oracle(self, hand):
        thunar.go(hand, self.values.place)
        hand.click_on("table-column-header", "Size", app="thunar")
        thunar.reload(hand)
        thunar.move(hand, [self.values.biggest], self.values.target)

    def plan(self):
        return ['window "Thunar"', *plan_steps.move([self.values.biggest], self.values.target)]

    def wrong_results(self):
        biggest, second = self.move(self.values.biggest), self.move(self.values.second)
        return {
            "the second": lambda m: move_files(m, [second]),
            "two of them": lambda m: move_files(m, [biggest, second]),
            "copied": lambda m: move_files(m, [biggest], "cp"),
            "to the home folder": lambda m: m.run("mv", biggest[0], self.values.biggest),
        }

    def right_result(self, machine):
        move_files(machine, [self.move(self.values.biggest)], "mv")
