"""Save a playlist with some recordings in a given order, in VLC."""

from hijack_data.rng import Stream
from online_env.tasks import Task
from online_env.tasks.kit import recordings, vlc
from online_env.tasks.kit.word_lists import CITIES, sample

DANCES = ("Waltz", "Tango", "Polka", "March", "Lullaby", "Blues")


class MakePlaylist(Task):
    """Three of six recordings, in the order that was asked for."""

    name = "make_playlist"
    domain = "vlc"
    apps = ("vlc",)
    phrasings = (
        "Make a playlist in VLC of {first}, {second} and {third} from my Music folder, in this"
        " order, and save it as {file} in the same folder.",
        "At the party I want to hear {first}, then {second}, then {third} (all in Music). Please"
        " save that as a playlist with VLC: Music/{file}.",
        "VLC: new playlist Music/{file} with Music/{first}, Music/{second}, Music/{third}, exactly"
        " in that order and nothing else.",
    )

    def draw(self, stream):
        cities = sample(stream, CITIES, len(DANCES))
        songs = [f"{city} {dance}.wav" for city, dance in zip(cities, DANCES, strict=True)]
        wanted = sample(stream, songs, 3)
        return {
            "songs": songs,
            "wanted": wanted,
            "first": wanted[0],
            "second": wanted[1],
            "third": wanted[2],
            "file": f"party-{stream.integer(10, 99)}.xspf",
        }

    def prepare(self, machine):
        vlc.prepare(machine)
        for song in self.values.songs:
            tune = recordings.melody(Stream(self.seed, f"make_playlist {song}"))
            machine.write(f"Music/{song}", recordings.played(tune))

    def problems(self, machine):
        path = f"Music/{self.values.file}"
        yield from machine.unexpected_changes(path)
        found = vlc.playlist(machine, path)
        if found is None:
            yield f"there is no {path}"
        elif found != [machine.path(f"Music/{song}") for song in self.values.wanted]:
            yield f"{path} has other recordings, or another order: {', '.join(found)}"

    def oracle(self, hand):
        vlc.empty_playlist(hand)
        for song in self.values.wanted:
            hand.press("ctrl", "o")
            vlc.pick_file(hand, f"Music/{song}")
            hand.find("tree-item", song, vlc.VLC)
        hand.press("ctrl", "y")
        vlc.pick_file(hand, f"Music/{self.values.file}")

    def wrong_results(self):
        wanted = self.values.wanted
        return {
            "another order": lambda m: self.save(m, [wanted[1], wanted[0], wanted[2]]),
            "one is missing": lambda m: self.save(m, wanted[:2]),
            "all recordings": lambda m: self.save(m, self.values.songs),
            "in the home folder": lambda m: self.save(m, wanted, "."),
        }

    def right_result(self, machine):
        self.save(machine, self.values.wanted)

    def save(self, machine, songs, folder="Music"):
        """Write a playlist as M3U, whatever its name says: VLC plays that as well."""
        lines = ["#EXTM3U", *(machine.path(f"Music/{song}") for song in songs)]
        machine.write(f"{folder}/{self.values.file}", "\n".join(lines) + "\n")
