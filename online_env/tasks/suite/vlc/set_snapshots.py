"""Say where and how VLC saves snapshots."""

from online_env.tasks import Task
from online_env.tasks.kit import vlc
from online_env.tasks.kit.word_lists import GOODS


class SetSnapshots(Task):
    """Folder, beginning of the name, format, and numbers in the place of the time."""

    name = "set_snapshots"
    domain = "vlc"
    apps = ("vlc",)
    phrasings = (
        "Set VLC up so that snapshots of videos go to the folder Pictures/{folder}, their names"
        ' begin with "{prefix}", they are numbered, and the format is {format}.',
        "From now on VLC should save snapshots as {format} files in Pictures/{folder}, with"
        ' sequential numbers and the prefix "{prefix}". Please change its preferences.',
        "VLC preferences, video snapshots: directory Pictures/{folder}, prefix {prefix}, sequential"
        " numbering, {format}.",
    )

    def draw(self, stream):
        folder = f"stills-{stream.integer(10, 99)}"
        prefix, format_ = f"{stream.choice(GOODS)}-", stream.choice(("jpg", "tiff"))
        return {"folder": folder, "prefix": prefix, "format": format_}

    def prepare(self, machine):
        vlc.prepare(machine)
        machine.write(f"Pictures/{self.values.folder}/about.txt", "Stills of our films\n")

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from vlc.setting_problems(machine, self.wanted(machine))

    def oracle(self, hand):
        drawn = self.values
        vlc.preferences(hand, "Video")
        hand.fill("Directory", hand.path(f"Pictures/{drawn.folder}"), vlc.VLC)
        hand.fill("Prefix", drawn.prefix, vlc.VLC)
        vlc.choose(hand, "Format", drawn.format)
        vlc.tick(hand, "Sequential numbering")
        vlc.save_preferences(hand)

    def wrong_results(self):
        return {
            "another folder": lambda m: self.save(m, {"snapshot-path": "/home/user/Pictures"}),
            "another format": lambda m: self.save(m, {"snapshot-format": "png"}),
            "without numbers": lambda m: self.save(m, {"snapshot-sequential": "0"}),
            "full screen as well": lambda m: self.save(m, {"fullscreen": "1"}),
        }

    def right_result(self, machine):
        folder = machine.path(f"Pictures/{self.values.folder}/")
        self.save(machine, {"snapshot-path": f"{folder}/", "vout": "any"})

    def save(self, machine, changed):
        """Write the wanted settings, some of them changed."""
        vlc.store(machine, self.wanted(machine) | changed)

    def wanted(self, machine):
        """Return the settings as VLC stores them."""
        return {
            "snapshot-path": machine.path(f"Pictures/{self.values.folder}"),
            "snapshot-prefix": self.values.prefix,
            "snapshot-format": self.values.format,
            "snapshot-sequential": "1",
        }
