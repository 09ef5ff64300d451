"""Set the pages of a document in landscape format."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, document, text_changes
from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sample_reports import report


class TurnPage(TextTask):
    """The paper lies on its long side afterwards; its size and the text stay."""

    name = "turn_page"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        "Set the pages of {file}, which is open, in landscape format, and save the document.",
        "{file} should be printed in landscape. Change the page and save, as docx.",
        "Please change the page orientation of the letter {title} from portrait to landscape and"
        " save it.",
    )

    def draw(self, stream):
        return report(stream)

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        for found, was in zip(now.sizes, before.sizes, strict=False):
            if max(abs(a - b) for a, b in zip(sorted(found), sorted(was), strict=True)) > 0.1:
                yield f"the paper has {found} inches, not {was[::-1]}"
        yield from text_changes(now, replace(before, landscape=(True,)))

    def oracle(self, hand):
        menu(hand, "Format", "Page Style...")
        hand.find("dialog", app="soffice")
        hand.click_on("page-tab", "Page", app="soffice")
        hand.click_on("radio-button", "Landscape", app="soffice")
        hand.find("radio-button", "Landscape", app="soffice", state="checked")
        hand.button("OK", app="soffice")
        hand.wait_until_gone("dialog", app="soffice")
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            'click "Format"',
            'click "Page Style..."',
            'click "Page" near "Organizer"',
            'click "Landscape"',
            'click "OK" near "Cancel"',
            "wait",
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        first = self.values.paragraphs[0]
        return {
            "wider than long": self.sized(20, 11),
            "half as wide": self.sized(4, 11),
            "the text changed, too": self.sized(11, 8.5, lambda found: drop(found, first)),
        }

    def right_result(self, machine):
        self.sized(11, 8.5)(machine)

    def sized(self, width, height, also=None):
        """Return what gives the page a width and a height in inches."""

        def change(found):
            from docx.shared import Inches

            for section in found.sections:
                section.page_width = Inches(width)
                section.page_height = Inches(height)
            if also is not None:
                also(found)

        return self.edited(change)


def drop(found, text):
    """Empty a paragraph of a document."""
    for paragraph in found.paragraphs:
        if paragraph.text == text:
            paragraph.clear()
