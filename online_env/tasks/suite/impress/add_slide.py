"""Add a slide with a title after a given one."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.kit.slides import (
    SlideContent,
    SlideTask,
    add_slide,
    order_slides,
    presentation,
    show_slide,
    slide_changes,
    write_in,
)
from online_env.tasks.plan_words import quoted


class AddSlide(SlideTask):
    """The new slide has a title and nothing else."""

    name = "add_slide"
    domain = "impress"
    apps = ("libreoffice_impress",)
    phrasings = (
        'In the open presentation, add a slide right after the one titled "{after}". Its title is'
        ' "{title}"; it needs no other text. Save the presentation.',
        'Insert a new slide "{title}" behind "{after}" (title only) and save.',
        'The talk needs one more slide. Please put it after "{after}", give it the title "{title}",'
        " leave the rest of it empty, and save the file as pptx.",
    )

    def draw(self, stream):
        values = talk(stream)
        title = values["spare"]
        index = stream.integer(1, len(values["slides"]) - 1)
        after = values["slides"][index][0]
        return {**values, "title": title, "index": index, "after": after}

    def initial_document(self):
        return presentation(self.values.slides)

    def judge(self, after, before):
        index = self.values.index + 1
        new = SlideContent(title=self.values.title)
        yield from slide_changes(after, (*before[:index], new, *before[index:]))

    def oracle(self, hand):
        count = len(self.values.slides)
        if hand.see("panel", self.values.title, app="soffice") is None:
            show_slide(hand, self.values.index + 1, self.values.after, of=count)
            menu(hand, "Slide", "New Slide")
            write_in(hand, "Click to add Title", self.values.title)
        save(hand)

    def plan(self):
        return [
            plan_steps.IMPRESS,
            f"press pagedown {self.values.index} times",
            "wait",
            "press ctrl+m",
            'double-click "Click to add Title"',
            "wait",
            f"type {quoted(self.values.title)}",
            "press esc 2 times",
            *plan_steps.SAVE_PPTX,
        ]

    def wrong_results(self):
        title, index = self.values.title, self.values.index + 1
        return {
            "at the wrong place": self.insert_slide(title, index - 1),
            "without a title": self.insert_slide("", index),
            "another title": self.insert_slide(title.upper(), index),
            "with a text": self.insert_slide(title, index, "more"),
        }

    def right_result(self, machine):
        self.insert_slide(self.values.title, self.values.index + 1)(machine)

    def insert_slide(self, title, index, text=""):
        """Return what adds a slide with a number of slides before it."""

        def change(presentation_file):
            order = list(range(len(presentation_file.slides)))
            add_slide(presentation_file, title, text)
            order_slides(presentation_file, [*order[:index], len(order), *order[index:]])

        return self.edit_document(change)
