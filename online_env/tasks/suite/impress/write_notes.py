"""Write speaker notes for a slide."""

from dataclasses import replace

from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.kit.slides import SlideTask, presentation, show_slide, slide_changes, write_in
from online_env.tasks.plan_words import quoted

NOTES = (
    "Speak slowly here.",
    "Ask who has been there before.",
    "Show the map on the wall.",
    "Thank the helpers by name.",
    "Five minutes at most!",
    "Hand the photographs round.",
    "Wait for questions.",
)


class WriteNotes(SlideTask):
    """One slide gets notes; what is on the slides stays."""

    name = "write_notes"
    domain = "impress"
    apps = ("libreoffice_impress",)
    phrasings = (
        'Add the speaker note "{note}" to the slide "{title}" of the open presentation; save.',
        'When I come to "{title}", I want to read this in my notes: "{note}" Add it there and save'
        " the presentation.",
        'Please write "{note}" into the notes of the slide titled "{title}", not on the slide'
        " itself, and save {file} as pptx.",
    )

    def draw(self, stream):
        drawn = talk(stream)
        index = stream.integer(1, len(drawn["slides"]) - 1)
        title = drawn["slides"][index][0]
        return {**drawn, "index": index, "title": title, "note": stream.choice(NOTES)}

    def made(self):
        return presentation(self.values.slides)

    def judge(self, now, before):
        wanted = list(before)
        wanted[self.values.index] = replace(before[self.values.index], notes=self.values.note)
        yield from slide_changes(now, wanted)

    def oracle(self, hand):
        show_slide(hand, self.values.index + 1, self.values.title, of=len(self.values.slides))
        menu(hand, "View", "Notes")
        if not any(node.text == self.values.note for node in hand.look()):
            write_in(hand, "Click to add Notes", self.values.note)
        save(hand)

    def plan(self):
        return [
            'window "LibreOffice Impress"',
            f"press pagedown {self.values.index} times",
            "wait",
            'click "View"',
            'click "Notes" near "Outline"',
            'double-click "Click to add Notes"',
            "wait",
            f"type {quoted(self.values.note)}",
            "press esc",
            "press ctrl+s",
            'click "Use PowerPoint 2007-365"',
            "wait",
        ]

    def wrong_results(self):
        index, note = self.values.index, self.values.note
        return {
            "at another slide": self.noted({index - 1: note}),
            "at two slides": self.noted({index: note, index - 1: note}),
            "half of it": self.noted({index: note.split()[0]}),
            "on the slide": self.edited(self.write_on),
        }

    def right_result(self, machine):
        self.noted({self.values.index: f"{self.values.note}\n"})(machine)

    def noted(self, notes):
        """Return what writes notes, by the index of the slide."""

        def change(made):
            for index, note in notes.items():
                made.slides[index].notes_slide.notes_text_frame.text = note

        return self.edited(change)

    def write_on(self, made):
        """Write the note on the slide."""
        frame = made.slides[self.values.index].placeholders[1].text_frame
        frame.text = f"{frame.text}\n{self.values.note}"
