"""Change how VLC shows subtitles."""

from online_env.tasks import Task
from online_env.tasks.kit import vlc

SIZES = {"Smaller": "20", "Small": "18", "Large": "12", "Larger": "6"}
OUTLINES = {"None": "0", "Thin": "2", "Thick": "6"}
LANGUAGES = {"German": "de", "French": "fr", "Spanish": "es", "Danish": "da", "Polish": "pl"}


class StyleSubtitles(Task):
    """Size and outline of the letters, and the language that VLC looks for."""

    name = "style_subtitles"
    domain = "vlc"
    apps = ("vlc",)
    phrasings = (
        'In the preferences of VLC, set the font size of subtitles to "{size}", their outline'
        ' thickness to "{outline}", and the preferred subtitle language to {code} ({language}).',
        "I watch films with {language} subtitles. Please make that the preferred language of VLC's"
        ' subtitles (code {code}), with font size "{size}" and outline thickness "{outline}".',
        'VLC subtitles: language {code}, font size "{size}", outline "{outline}"; nothing else.',
    )

    def draw(self, stream):
        language = stream.choice(list(LANGUAGES))
        return {
            "size": stream.choice(list(SIZES)),
            "outline": stream.choice(list(OUTLINES)),
            "language": language,
            "code": LANGUAGES[language],
        }

    def prepare(self, machine):
        vlc.prepare(machine)

    def problems(self, machine):
        yield from machine.unexpected_changes()
        yield from vlc.setting_problems(machine, self.wanted())

    def oracle(self, hand):
        vlc.preferences(hand, "Subtitles / OSD")
        hand.fill("Preferred subtitle language", self.values.code, vlc.VLC)
        vlc.choose(hand, "Font size", self.values.size)
        vlc.choose(hand, "Outline thickness", self.values.outline)
        vlc.save_preferences(hand)

    def wrong_results(self):
        return {
            "another language": lambda m: self.save(m, {"sub-language": "en"}),
            "the usual size": lambda m: self.save(m, {"freetype-rel-fontsize": "16"}),
            "the usual outline": lambda m: self.save(m, {"freetype-outline-thickness": "4"}),
            "sound as well": lambda m: self.save(m, {"audio-language": self.values.code}),
        }

    def right_result(self, machine):
        self.save(machine, {"sub-language": f" {self.values.code}", "vout": "any"})

    def save(self, machine, changed):
        """Write the wanted settings, some of them changed."""
        vlc.store(machine, self.wanted() | changed)

    def wanted(self):
        """Return the settings as VLC stores them."""
        return {
            "sub-language": self.values.code,
            "freetype-rel-fontsize": SIZES[self.values.size],
            "freetype-outline-thickness": OUTLINES[self.values.outline],
        }
