"""Give one slide a background colour."""

from dataclasses import replace

from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.kit.slides import SlideTask, presentation, show_slide, slide_changes

# The colours of LibreOffice's standard palette, and what a person may take for them.
COLOURS = {"Yellow": "FFFF00", "Orange": "FF8000", "Red": "FF0000", "Lime": "81D41A"}


class ColourSlide(SlideTask):
    """One slide gets a background of one colour; the others stay white."""

    name = "colour_slide"
    domain = "impress"
    apps = ("libreoffice_impress",)
    phrasings = (
        'Give the slide "{title}" of the open presentation a {colour} background (the {name} of'
        " the standard palette), that slide only, and save.",
        '{name}, from the standard palette, as the background of the slide "{title}". Leave the'
        " other slides as they are. Save.",
        'Please colour the background of the slide titled "{title}" with the standard palette\'s'
        " {name} and save {file} as pptx.",
    )

    def draw(self, stream):
        drawn = talk(stream)
        index = stream.integer(1, len(drawn["slides"]) - 1)
        name = stream.choice(list(COLOURS))
        return {
            **drawn,
            "index": index,
            "title": drawn["slides"][index][0],
            "name": name,
            "colour": name.lower(),
        }

    def made(self):
        return presentation(self.values.slides)

    def judge(self, now, before):
        wanted = list(before)
        index = self.values.index
        wanted[index] = replace(before[index], background=COLOURS[self.values.name])
        yield from slide_changes(now, wanted)

    def oracle(self, hand):
        show_slide(hand, self.values.index + 1, self.values.title, of=len(self.values.slides))
        menu(hand, "Slide", "Slide Properties...")
        hand.find("dialog", "Slide Properties", app="soffice")
        hand.click_on("page-tab", "Background", app="soffice")
        hand.click_on("toggle-button", "Color", app="soffice")
        hand.click_on("list-item", self.values.name, app="soffice")
        hand.wait("the colour's code", self.is_code)
        hand.button("OK", app="soffice")
        hand.wait_until_gone("dialog", app="soffice")
        save(hand)

    def is_code(self, node):
        """Return whether a node is the field with the code of the colour."""
        return node.role == "text" and node.text.upper() == COLOURS[self.values.name]

    def wrong_results(self):
        index, right = self.values.index, COLOURS[self.values.name]
        other = "0000FF"
        return {
            "another colour": self.painted({index: other}),
            "another slide": self.painted({index - 1: right}),
            "all slides": self.painted(dict.fromkeys(range(len(self.values.slides)), right)),
        }

    def right_result(self, machine):
        self.painted({self.values.index: COLOURS[self.values.name]})(machine)

    def painted(self, colours):
        """Return what gives slides a background: colours by the index of the slide."""

        def change(made):
            from pptx.dml.color import RGBColor

            for index, code in colours.items():
                fill = made.slides[index].background.fill
                fill.solid()
                fill.fore_color.rgb = RGBColor.from_string(code)

        return self.edited(change)
