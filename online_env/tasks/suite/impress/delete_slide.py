"""Delete a slide."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.kit.slides import (
    SlideTask,
    order_slides,
    presentation,
    show_slide,
    slide_changes,
)


class DeleteSlide(SlideTask):
    """One slide, known by its title, goes."""

    name = "delete_slide"
    domain = "impress"
    apps = ("libreoffice_impress",)
    phrasings = (
        'Delete the slide "{title}" from the open presentation and save it.',
        'The slide titled "{title}" is not needed any more. Remove it, save.',
        'I have no time for "{title}" in my talk. Please take that slide out of {file} and save the'
        " file as pptx.",
    )

    def draw(self, stream):
        drawn = talk(stream)
        index = stream.integer(1, len(drawn["slides"]) - 1)
        return {**drawn, "index": index, "title": drawn["slides"][index][0]}

    def made(self):
        return presentation(self.values.slides)

    def judge(self, now, before):
        index = self.values.index
        yield from slide_changes(now, (*before[:index], *before[index + 1 :]))

    def oracle(self, hand):
        count = len(self.values.slides)
        if hand.see("panel", self.values.title, app="soffice") is not None:
            show_slide(hand, self.values.index + 1, self.values.title, of=count)
            menu(hand, "Slide", "Delete Slide")
            hand.wait_until_gone("panel", self.values.title, app="soffice")
        save(hand)

    def plan(self):
        return [
            plan_steps.IMPRESS,
            f"press pagedown {self.values.index} times",
            "wait",
            'click "Slide" near "Format"',
            'click "Delete Slide"',
            "wait",
            *plan_steps.SAVE_PPTX,
        ]

    def wrong_results(self):
        index = self.values.index
        count = len(self.values.slides)
        others = [number for number in range(count) if number != index]
        return {
            "another slide": self.keep([number for number in range(count) if number != index - 1]),
            "two slides": self.keep(others[:-1]),
            "moved to the end": self.keep([*others, index]),
        }

    def right_result(self, machine):
        count = len(self.values.slides)
        self.keep([number for number in range(count) if number != self.values.index])(machine)

    def keep(self, order):
        """Return what leaves some slides, in an order."""
        return self.edited(lambda made: order_slides(made, order))
