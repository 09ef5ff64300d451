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
        drawn = talk(stream)
        index = stream.integer(1, len(drawn["slides"]) - 2)
        order = stream.choice(("first", "last"))
        return {
            **drawn,
            "index": index,
            "title": drawn["slides"][index][0],
            "order": order,
            "where": {"first": "the very beginning", "last": "the end"}[order],
        }

    def made(self):
        return presentation(self.values.slides)

    def judge(self, now, before):
        yield from slide_changes(now, [before[number] for number in self.wanted()])

    def wanted(self):
        """Return the present indices of the slides in their new order."""
        index = self.values.index
        others = [number for number in range(len(self.values.slides)) if number != index]
        return [index, *others] if self.values.order == "first" else [*others, index]

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
        wanted = self.wanted()
        index = self.values.index
        others = [number for number in wanted if number != index]
        is_first = self.values.order == "first"
        return {
            "to the other end": self.put([*others, index] if is_first else [index, *others]),
            "the others turned": self.put([index, *others[::-1]]),
            "without it": self.put(others),
        }

    def right_result(self, machine):
        self.put(self.wanted())(machine)

    def put(self, order):
        """Return what leaves some slides, in an order."""
        return self.edited(lambda made: order_slides(made, order))
