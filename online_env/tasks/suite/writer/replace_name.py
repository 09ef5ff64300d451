"""Replace a name everywhere in a text."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, document, text_changes
from online_env.tasks.kit.office import replace_all, save
from online_env.tasks.kit.sample_reports import report
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES


class ReplaceName(TextTask):
    """The name stands several times in the text; nothing else changes."""

    name = "replace_name"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'Replace the name "{person}" by "{new}" everywhere in the open document, and save it.',
        "{new} has taken over from {person}: put the new name in each place of {file} where the old"
        " one stands. Save it as docx.",
        "Wherever this letter says {person}, it should say {new}. Please change all of them and"
        " save the letter.",
    )

    def draw(self, stream):
        text = report(stream)
        first = text["person"].split()[0]
        names = [name for name in FIRST_NAMES if name != first]
        return {**text, "new": f"{stream.choice(names)} {stream.choice(LAST_NAMES)}"}

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        old, new = self.values.person, self.values.new
        wanted = [
            replace(paragraph, text=paragraph.text.replace(old, new))
            for paragraph in before.paragraphs
        ]
        yield from text_changes(now, replace(before, paragraphs=tuple(wanted)))

    def oracle(self, hand):
        replace_all(hand, self.values.person, self.values.new)
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            *plan_steps.replace_in_office(self.values.person, self.values.new),
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        old, new = self.values.person, self.values.new
        return {
            "only the first one": self.edited(lambda found: rename(found, old, new, most=1)),
            "another name": self.edited(lambda found: rename(found, old, new.upper())),
            "the first name alone": self.edited(lambda found: rename(found, old.split()[0], new)),
        }

    def right_result(self, machine):
        new = self.values.new.replace("'", "\u2019")  # Writer makes a typed one round
        self.edited(lambda found: rename(found, self.values.person, new))(machine)


def rename(found, old, new, most=99):
    """Replace a name in so many paragraphs of a document."""
    for paragraph in [paragraph for paragraph in found.paragraphs if old in paragraph.text][:most]:
        paragraph.runs[0].text = paragraph.text.replace(old, new)
