"""Replace a name on all slides."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import replace_all, save
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.kit.slides import SlideTask, presentation, slide_changes
from online_env.tasks.kit.word_lists import CITIES


class ReplaceOnSlides(SlideTask):
    """The name of a city stands in titles and in texts."""

    name = "replace_on_slides"
    domain = "impress"
    apps = ("libreoffice_impress",)
    phrasings = (
        "Replace {old} by {new} on all slides of the open presentation, and save it.",
        "The talk was moved: everywhere on the slides it should say {new}, not {old}. Save.",
        "Please change the name of the city from {old} to {new} throughout {file}, in titles and"
        " texts, and save the file under its name; it stays a pptx.",
    )

    def draw(self, stream):
        drawn = talk(stream)
        others = [city for city in CITIES if city != drawn["city"]]
        return {**drawn, "old": drawn["city"], "new": stream.choice(others)}

    def made(self):
        return presentation(self.values.slides)

    def judge(self, now, before):
        wanted = [
            replace(
                slide,
                title=self.moved(slide.title),
                texts=tuple(self.moved(text) for text in slide.texts),
            )
            for slide in before
        ]
        yield from slide_changes(now, wanted)

    def moved(self, text):
        """Return a text with the new name."""
        return text.replace(self.values.old, self.values.new)

    def oracle(self, hand):
        replace_all(hand, self.values.old, self.values.new)
        save(hand)

    def plan(self):
        return [
            plan_steps.IMPRESS,
            *plan_steps.replace_in_office(self.values.old, self.values.new),
            *plan_steps.SAVE_PPTX,
        ]

    def wrong_results(self):
        return {
            "the titles alone": self.changed(lambda text: self.moved(text), texts=False),
            "the texts alone": self.changed(lambda text: self.moved(text), titles=False),
            "in capitals": self.changed(
                lambda text: text.replace(self.values.old, self.values.new.upper())
            ),
        }

    def right_result(self, machine):
        self.changed(self.moved)(machine)

    def changed(self, change, titles=True, texts=True):
        """Return what changes the titles and the texts of all slides."""

        def outcome(made):
            for slide in made.slides:
                for shape in slide.shapes:
                    is_title = shape.shape_id == slide.shapes.title.shape_id
                    if titles if is_title else texts:
                        shape.text_frame.text = change(shape.text_frame.text)

        return self.edited(outcome)
