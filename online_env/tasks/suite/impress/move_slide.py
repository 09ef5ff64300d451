"""Move a slide to the end, or to the start."""

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
from online_env.tasks.plan_words import quoted


class MoveSlide(SlideTask):
    """One slide gets another place; the others keep their order."""

    name = "move_slide"
    domain = "impress"
    apps = ("libreoffice_impress",)
    phrasings = (
        'Move the slide "{title}" of the open presentation to {where}, and save.',
        'In {file}, "{title}" should come {order}. Change the order of the slides and save.',
        'Please make "{title}" the {order} slide of my talk; the others stay in their order. Save'
        " the presentation as pptx.",
    )

    def draw(self, stream):
        values = talk(stream)
        index = stream.integer(1, len(values["slides"]) - 2)
        order = stream.choice(("first", "last"))
        return {
            **values,
            "index": index,
            "title": values["slides"][index][0],
            "order": order,
            "where": {"first": "the very beginning", "last": "the end"}[order],
        }

    def initial_document(self):
        return presentation(self.values.slides)

    def judge(self, after, before):
        yield from slide_changes(after, [before[number] for number in self.expected_order()])

    def expected_order(self):
        """Return the present indices of the slides in their new order."""
        index = self.values.index
        other_slides = [number for number in range(len(self.values.slides)) if number != index]
        return [index, *other_slides] if self.values.order == "first" else [*other_slides, index]

    def oracle(self, hand):
        count = len(self.values.slides)
        is_first = self.values.order == "first"
        show_slide(hand, self.values.index + 1, self.values.title, of=count)
        menu(hand, "Slide", "Move", "Slide to Start" if is_first else "Slide to End")
        save(hand)

    def plan(self):
        end = {"first": "Start", "last": "End"}[self.values.order]
        return [
            plan_steps.IMPRESS,
            f"press pagedown {self.values.index} times",
            "wait",
            'click "Slide" near "Format"',
            'click "Move"',
            f"click {quoted(f'Slide to {end}')}",
            "wait",
            *plan_steps.SAVE_PPTX,
        ]

    def wrong_results(self):
        order = self.expected_order()
        index = self.values.index
        other_slides = [number for number in order if number != index]
        is_first = self.values.order == "first"
        return {
            "to the other end": self.reorder(
                [*other_slides, index] if is_first else [index, *other_slides]
            ),
            "the others turned": self.reorder([index, *other_slides[::-1]]),
            "without it": self.reorder(other_slides),
        }

    def right_result(self, machine):
        self.reorder(self.expected_order())(machine)

    def reorder(self, order):
        """Return what leaves some slides, in an order."""
        return self.edit_document(lambda presentation_file: order_slides(presentation_file, order))
