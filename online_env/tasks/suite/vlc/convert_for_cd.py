"""Convert a recording for a CD, in VLC."""

from hijack_data.rng import Stream
from online_env.tasks import Task
from online_env.tasks.kit import recordings, vlc
from online_env.tasks.kit.word_lists import CITIES, sample


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
        for song in self.values.songs:
            machine.write(f"Music/{song}", recordings.played(self.tune(song)))

    def problems(self, machine):
        path = f"Music/{self.values.result}"
        yield from machine.unexpected_changes(path)
        heard = recordings.sound(machine, path)
        if heard is None:
            yield f"there is no WAV file {path}"
            return
        if (heard.channels, heard.rate) != recordings.CD:
            yield f"{path} has {heard.channels} channels and {heard.rate} Hz: no CD has that"
        for problem in recordings.melody_problems(heard, self.tune(self.values.source)):
            yield f"{path} is not {self.values.source}: {problem}"

    def oracle(self, hand):
        vlc.leave_dialogs(hand)
        hand.press("ctrl", "r")
        hand.button("Add...", vlc.VLC)
        vlc.pick_file(hand, f"Music/{self.values.source}")
        hand.button("Convert / Save", vlc.VLC)
        vlc.choose(hand, "Profile", "Audio - CD")
        hand.button("Browse", vlc.VLC)
        vlc.pick_file(hand, f"Music/{self.values.result}")
        hand.button("Start", vlc.VLC)
        hand.find("frame", vlc.IDLE, vlc.VLC, "active")

    def wrong_results(self):
        path = f"Music/{self.values.result}"
        tune = self.tune(self.values.source)
        good = recordings.played(tune, *recordings.CD)
        other = recordings.played(self.tune(self.values.songs[1]), *recordings.CD)
        return {
            "only copied": lambda m: m.run("cp", f"Music/{self.values.source}", path),
            "another recording": lambda m: m.write(path, other),
            "one channel": lambda m: m.write(path, recordings.played(tune, 1, 44100)),
            "half of it": lambda m: m.write(path, recordings.played(tune[:4], *recordings.CD)),
            "over the original": lambda m: m.write(f"Music/{self.values.source}", good),
        }

    def right_result(self, machine):
        tune = self.tune(self.values.source)
        machine.write(f"Music/{self.values.result}", recordings.played(tune, *recordings.CD))

    def tune(self, song):
        """Return the melody of a recording."""
        return recordings.melody(Stream(self.seed, f"convert_for_cd {song}"))
