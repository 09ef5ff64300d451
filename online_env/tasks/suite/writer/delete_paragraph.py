"""Delete a paragraph, so that no empty line is left."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, document, remove_paragraph, text_changes
from online_env.tasks.kit.office import find_text, save
from online_env.tasks.kit.sample_reports import report


class DeleteParagraph(TextTask):
    """One of the parts, its first line and its sentence, goes."""

    name = "delete_paragraph"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'Delete the part "{line}" of the open document: this line and the paragraph below it.'
        " Leave no empty line, and save.",
        'Take out "{line}" and the sentence that follows it. The rest stays, without a gap.'
        " Save the file as docx.",
        'The part "{line}" (the line itself and the one paragraph after it) is no longer true.'
        " Please remove both and save the document.",
    )

    def draw(self, stream):
        text = report(stream)
        index = stream.integer(0, 2)
        return {**text, "line": text["lines"][index], "body": text["bodies"][index]}

    def initial_document(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, after, before):
        removed_texts = (self.values.line, self.values.body)
        remaining = [
            paragraph for paragraph in before.paragraphs if paragraph.text not in removed_texts
        ]
        yield from text_changes(after, replace(before, paragraphs=tuple(remaining)))

    def oracle(self, hand):
        for text in (self.values.line, self.values.body):
            if any(node.text == text for node in hand.look() if node.role == "paragraph"):
                find_text(hand, text)
                hand.press("delete")  # the text, and then the line feed
                hand.press("delete")
        save(hand)

    def plan(self):
        steps = [plan_steps.WRITER]
        for text in (self.values.line, self.values.body):
            steps += [*plan_steps.find_in_writer(text), "press delete 2 times"]
        return [*steps, *plan_steps.SAVE_DOCX]

    def wrong_results(self):
        line, body = self.values.line, self.values.body
        other_line = next(text for text in self.values.lines if text != line)
        return {
            "the line alone": self.edit_document(lambda document_file: remove(document_file, line)),
            "an empty line is left": self.edit_document(
                lambda document_file: blank(document_file, line, body)
            ),
            "another part": self.edit_document(
                lambda document_file: remove(document_file, other_line, body)
            ),
            "too much": self.edit_document(
                lambda document_file: remove(document_file, line, body, other_line)
            ),
        }

    def right_result(self, machine):
        self.edit_document(
            lambda document_file: remove(document_file, self.values.body, self.values.line)
        )(machine)


def remove(document_file, *texts):
    """Remove paragraphs of a document."""
    for text in texts:
        remove_paragraph(document_file, text)


def blank(document_file, *texts):
    """Empty paragraphs of a document, and leave them there."""
    for paragraph in document_file.paragraphs:
        if paragraph.text in texts:
            paragraph.clear()
