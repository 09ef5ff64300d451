"""Pack a folder into a compressed archive, without what can be made again."""

import gzip
import io
import tarfile

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, shell
from online_env.tasks.kit.archives import unpacked
from online_env.tasks.kit.word_lists import TOPICS, sample

GZIP = b"\x1f\x8b"


class PackFolder(Task):
    """The archive has all files of the folder except those of one kind."""

    name = "pack_folder"
    domain = "terminal"
    apps = ("terminal",)
    phrasings = (
        "Pack the folder Documents/{folder} into a gzip-compressed tar archive"
        " Documents/{archive}, but without the {ending} files. Keep the folder as it is.",
        "Make Documents/{archive} from Documents/{folder}: everything in it except *{ending}.",
        "I'd like to send my folder {folder} (in Documents) as {archive}. Please create that"
        " archive next to the folder; leave out all files that end in {ending}, in subfolders, too."
        " Delete nothing.",
    )

    def draw(self, stream):
        folder = f"{stream.choice(('project', 'course', 'survey'))}-{stream.integer(10, 99)}"
        ending = stream.choice((".tmp", ".bak", ".cache"))
        names = sample(stream, TOPICS, 5)
        kept = [f"{names[0]}.txt", f"{names[1]}.csv", f"parts/{names[2]}.txt"]
        left = [f"{names[3]}{ending}", f"parts/{names[4]}{ending}"]
        return {
            "folder": folder,
            "ending": ending,
            "archive": f"{folder}.tar.gz",
            "kept": {path: content(path) for path in kept},
            "left": {path: content(path) for path in left},
        }

    def prepare(self, machine):
        for path, data in {**self.values.kept, **self.values.left}.items():
            machine.write(f"Documents/{self.values.folder}/{path}", data)

    def problems(self, machine):
        path = f"Documents/{self.values.archive}"
        yield from machine.unexpected_changes(path)
        data = machine.read(path)
        if data is None or not data.startswith(GZIP):
            yield f"{path} is no archive that gzip compressed"
            return
        start = f"{self.values.folder}/"
        found = unpacked(data) or {}
        inside = {name.rpartition(start)[2]: found[name] for name in found}
        if inside != self.values.kept or len(inside) != len(found):
            yield f"the archive holds {sorted(found)}"

    def oracle(self, hand):
        folder, archive = self.values.folder, self.values.archive
        shell.command(hand, "cd ~/Documents")
        shell.command(hand, f"find {folder} -type f")
        shell.command(hand, f"tar -czf {archive} --exclude='*{self.values.ending}' {folder}")
        shell.command(hand, f"tar -tzf {archive}")

    def plan(self):
        folder, archive = self.values.folder, self.values.archive
        return plan_steps.run(
            "cd ~/Documents",
            f"tar -czf {archive} --exclude='*{self.values.ending}' {folder}",
            f"tar -tzf {archive}",
        )

    def wrong_results(self):
        kept, left = self.values.kept, self.values.left
        return {
            "with all files": lambda m: self.pack(m, {**kept, **left}),
            "without the subfolder": lambda m: self.pack(m, dict(list(kept.items())[:2])),
            "not compressed": lambda m: self.pack(m, kept, bytes),
            "files are gone": lambda m: (
                self.pack(m, kept),
                m.run("rm", *(f"Documents/{self.values.folder}/{path}" for path in left)),
            ),
        }

    def right_result(self, machine):
        self.pack(machine, dict(reversed(self.values.kept.items())))

    def pack(self, machine, files, squeeze=gzip.compress):
        """Write an archive of files."""
        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w") as archive:
            for path, data in files.items():
                entry = tarfile.TarInfo(f"./{self.values.folder}/{path}")
                entry.size = len(data)
                archive.addfile(entry, io.BytesIO(data))
        machine.write(f"Documents/{self.values.archive}", squeeze(buffer.getvalue()))


def content(path):
    """Return what a file holds."""
    return f"What stands in {path}.\n".encode()
