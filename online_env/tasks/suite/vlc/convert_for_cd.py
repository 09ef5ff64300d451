"""Convert a recording for a CD, in VLC."""

from hijack_data.rng import Stream
from online_env.tasks import Task
from online_env.tasks.kit import recordings, vlc
from online_env.tasks.kit.words import CITIES, sample


class ConvertForCd(Task):
    """One of three recordings becomes a WAV file as CDs have them; the old files stay."""

    name = "convert_for_cd"
    domain = "vlc"
    apps = ("vlc",)
    phrasings = (
        'Convert Music/{source} with VLC\'s profile "Audio - CD" and save the result as {result}'
        " in the folder Music. Keep the original.",
        "I want to burn {source} from my Music folder on a CD. Please convert it in VLC (profile"
        " Audio - CD) to Music/{result}; leave the other files alone.",
        'VLC, Convert / Save: Music/{source} to Music/{result}, profile "Audio - CD".',
    )

    def draw(self, stream):
        towns = sample(stream, CITIES, 3)
        number = stream.integer(10, 99)
        return {
            "songs": [f"{town}.wav" for town in towns],
            "source": f"{towns[0]}.wav",
            "result": f"cd-{number}.wav",
        }

    def prepare(self, machine):
        vlc.prepare(machine)
        for song in self.drawn.songs:
            machine.write(f"Music/{song}", recordings.played(self.tune(song)))

    def problems(self, machine):
        path = f"Music/{self.drawn.result}"
        yield from machine.untouched(path)
        heard = recordings.sound(machine, path)
        if heard is None:
            yield f"there is no WAV file {path}"
            return
        if (heard.channels, heard.rate) != recordings.CD:
            yield f"{path} has {heard.channels} channels and {heard.rate} Hz: no CD has that"
        for problem in recordings.melody_problems(heard, self.tune(self.drawn.source)):
            yield f"{path} is not {self.drawn.source}: {problem}"

    def oracle(self, hand):
        vlc.leave_dialogs(hand)
        hand.press("ctrl", "r")
        hand.button("Add...", vlc.VLC)
        vlc.pick_file(hand, f"Music/{self.drawn.source}")
        hand.button("Convert / Save", vlc.VLC)
        vlc.choose(hand, "Profile", "Audio - CD")
        hand.button("Browse", vlc.VLC)
        vlc.pick_file(hand, f"Music/{self.drawn.result}")
        hand.button("Start", vlc.VLC)
        hand.find("frame", vlc.IDLE, vlc.VLC, "active")

    def wrong(self):
        path = f"Music/{self.drawn.result}"
        tune = self.tune(self.drawn.source)
        good = recordings.played(tune, *recordings.CD)
        other = recordings.played(self.tune(self.drawn.songs[1]), *recordings.CD)
        return {
            "only copied": lambda m: m.run("cp", f"Music/{self.drawn.source}", path),
            "another recording": lambda m: m.write(path, other),
            "one channel": lambda m: m.write(path, recordings.played(tune, 1, 44100)),
            "half of it": lambda m: m.write(path, recordings.played(tune[:4], *recordings.CD)),
            "over the original": lambda m: m.write(f"Music/{self.drawn.source}", good),
        }

    def right(self, machine):
        tune = self.tune(self.drawn.source)
        machine.write(f"Music/{self.drawn.result}", recordings.played(tune, *recordings.CD))

    def tune(self, song):
        """Return the melody of a recording."""
        return recordings.melody(Stream(self.seed, f"convert_for_cd {song}"))
