"""Give a line the style of a heading."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, changed, document, find_paragraph, text_changes
from online_env.tasks.kit.office import find_text, save
from online_env.tasks.kit.sample_reports import report


class StyleHeading(TextTask):
    """One of the lines that introduce a part becomes a heading of a level."""

    name = "style_heading"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'In the open document, give the line "{line}" the paragraph style Heading {level}, and save'
        " the document.",
        '"{line}" should be a heading of level {level} (style Heading {level}), not plain text.'
        " Change that line only and save.",
        'Please turn the line "{line}" into a Heading {level} and save the file as docx.',
    )

    def draw(self, stream):
        text = report(stream)
        return {**text, "line": stream.choice(text["lines"]), "level": stream.integer(1, 4)}

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        yield from text_changes(now, changed(before, self.values.line, style=self.style))

    @property
    def style(self):
        """The name of the style."""
        return f"Heading {self.values.level}"

    def oracle(self, hand):
        find_text(hand, self.values.line)
        hand.press("ctrl", str(self.values.level))
        hand.find("heading", app="soffice")
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            *plan_steps.find_in_writer(self.values.line),
            f"press ctrl+{self.values.level}",
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        other = next(line for line in self.values.paragraphs if line != self.values.line)
        return {
            "another level": self.styled(self.values.line, f"Heading {self.values.level + 1}"),
            "another line": self.styled(other, self.style),
            "made bold by hand": self.edited(self.embolden),
        }

    def right_result(self, machine):
        self.styled(self.values.line, self.style)(machine)

    def styled(self, line, style):
        """Return what gives a line a style."""

        def change(found):
            find_paragraph(found, line).style = found.styles[style]

        return self.edited(change)

    def embolden(self, found):
        """Make the line bold."""
        find_paragraph(found, self.values.line).runs[0].bold = True
