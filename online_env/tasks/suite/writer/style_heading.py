"""Give a line the style of a heading."""

from online_env.tasks.kit import told
from online_env.tasks.kit.documents import TextTask, changed, document, paragraph_of, text_changes
from online_env.tasks.kit.office import find_text, save
from online_env.tasks.kit.prose import report


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
        return document(self.drawn.title, self.drawn.paragraphs)

    def judge(self, now, before):
        yield from text_changes(now, changed(before, self.drawn.line, style=self.style))

    @property
    def style(self):
        """The name of the style."""
        return f"Heading {self.drawn.level}"

    def oracle(self, hand):
        find_text(hand, self.drawn.line)
        hand.press("ctrl", str(self.drawn.level))
        hand.find("heading", app="soffice")
        save(hand)

    def plan(self):
        return [
            told.WRITER,
            *told.find_in_writer(self.drawn.line),
            f"press ctrl+{self.drawn.level}",
            *told.SAVE_DOCX,
        ]

    def wrong(self):
        other = next(line for line in self.drawn.paragraphs if line != self.drawn.line)
        return {
            "another level": self.styled(self.drawn.line, f"Heading {self.drawn.level + 1}"),
            "another line": self.styled(other, self.style),
            "made bold by hand": self.edited(self.embolden),
        }

    def right(self, machine):
        self.styled(self.drawn.line, self.style)(machine)

    def styled(self, line, style):
        """Return what gives a line a style."""

        def change(found):
            paragraph_of(found, line).style = found.styles[style]

        return self.edited(change)

    def embolden(self, found):
        """Make the line bold."""
        paragraph_of(found, self.drawn.line).runs[0].bold = True
