"""Make some words of a sentence bold."""

from online_env.tasks.kit import told
from online_env.tasks.kit.documents import TextTask, changed, document, paragraph_of, text_changes
from online_env.tasks.kit.office import find_text, save
from online_env.tasks.kit.prose import report


class BoldTerm(TextTask):
    """A few words in the middle of a paragraph become bold; the rest of it stays."""

    name = "bold_term"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'Make the words "{term}" bold in the open document, only those, and save it.',
        'Put "{term}" in bold. Nothing else. Save.',
        'So that nobody overlooks it, please set the words "{term}" in bold type and save the'
        " document as docx.",
    )

    def draw(self, stream):
        text = report(stream)
        whole = "\n".join([text["title"], *text["paragraphs"]]).lower()
        sentence = stream.choice(text["bodies"])
        words = sentence.rstrip(".").split()
        terms = [
            " ".join(words[start : start + 3]).rstrip(",") for start in range(1, len(words) - 3)
        ]
        term = stream.choice([term for term in terms if whole.count(term.lower()) == 1])
        return {**text, "sentence": sentence, "term": term}

    def made(self):
        return document(self.drawn.title, self.drawn.paragraphs)

    def judge(self, now, before):
        bold = (self.drawn.term,)
        yield from text_changes(now, changed(before, self.drawn.sentence, bold=bold))

    def oracle(self, hand):
        find_text(hand, self.drawn.term)
        if hand.see("toggle-button", "Bold", app="soffice", state="checked") is None:
            hand.press("ctrl", "b")
        hand.find("toggle-button", "Bold", app="soffice", state="checked")
        save(hand)

    def plan(self):
        return [told.WRITER, *told.find_in_writer(self.drawn.term), "press ctrl+b", *told.SAVE_DOCX]

    def wrong(self):
        sentence, term = self.drawn.sentence, self.drawn.term
        other = next(text for text in self.drawn.bodies if text != sentence)
        return {
            "the whole sentence": self.marked(sentence, sentence),
            "one word of them": self.marked(sentence, term.split()[0]),
            "another sentence": self.marked(other, other),
        }

    def right(self, machine):
        self.marked(self.drawn.sentence, self.drawn.term)(machine)

    def marked(self, sentence, term):
        """Return what makes a part of a paragraph bold."""

        def change(found):
            paragraph = paragraph_of(found, sentence)
            before, _, after = sentence.partition(term)
            paragraph.clear()
            paragraph.add_run(before)
            paragraph.add_run(term).bold = True
            paragraph.add_run(after)

        return self.edited(change)
