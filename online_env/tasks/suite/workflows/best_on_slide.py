"""Find the best row of a workbook, and write it as the title of a slide."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import dump, open_document, replace_all, save
from online_env.tasks.kit.sample_talks import talk
from online_env.tasks.kit.sheets import book, read_cells
from online_env.tasks.kit.slides import SlideTask, presentation, slide_changes
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES, sample
from online_env.tasks.plan_words import quoted

BLANK = "(winner)"


class BestOnSlide(SlideTask):
    """The workbook has the points of a contest; the last slide has a blank for the winner."""

    name = "best_on_slide"
    domain = "workflows"
    apps = ("libreoffice_impress", "libreoffice_calc")
    phrasings = (
        "On the last slide of the open presentation, replace (winner) by the name of who has the"
        " most points in Documents/{book}. Save the presentation; the workbook stays as it is.",
        "Who has the most points in {book} (in Documents)? Write that name instead of (winner) on"
        " the last slide, which is in {file}, and save it.",
        "The title of the last slide says (winner). Please look up in the workbook {book}, in"
        " Documents, who has got the most points, put the name there, and save {file} as pptx.",
    )

    def draw(self, stream):
        firsts = sample(stream, FIRST_NAMES, stream.integer(6, 10))
        points = sample(stream, range(21, 99), len(firsts))
        rows = [
            (f"{first} {stream.choice(LAST_NAMES)}", count)
            for first, count in zip(firsts, points, strict=True)
        ]
        ranked = sorted(rows, key=lambda row: row[1])
        name = f"points-{stream.integer(100, 999)}.xlsx"
        drawn = talk(stream)
        return {
            **drawn,
            "slides": [*drawn["slides"][:3], (f"First prize: {BLANK}", "A basket of fruit")],
            "book": name,
            "sheet": f"Documents/{name}",
            "rows": rows,
            "winner": ranked[-1][0],
            "second": ranked[-2][0],
        }

    def made(self):
        return presentation(self.values.slides)

    def prepare(self, machine):
        super().prepare(machine)
        rows = [("Name", "Points"), *self.values.rows]
        machine.write(self.values.sheet, dump(book({"Contest": rows})))

    def judge(self, now, before):
        title = before[-1].title.replace(BLANK, self.values.winner)
        yield from slide_changes(now, (*before[:-1], replace(before[-1], title=title)))

    def oracle(self, hand):
        open_document(hand, self.values.sheet, "table", "Sheet Contest")
        numbers = range(2, len(self.values.rows) + 2)
        names = read_cells(hand, [f"A{number}" for number in numbers])
        points = read_cells(hand, [f"B{number}" for number in numbers])
        best = max(zip(map(int, points), names, strict=True))[1]
        hand.press("ctrl", "w")
        hand.find("document-presentation", app="soffice")
        replace_all(hand, BLANK, best)
        save(hand)

    def plan(self):
        return [
            plan_steps.IMPRESS,
            *plan_steps.open_in_office(self.values.sheet, "Contest"),
            f"wait for {quoted(self.values.winner)}",
            "press ctrl+w",
            plan_steps.IMPRESS,
            *plan_steps.replace_in_office(BLANK, self.values.winner),
            *plan_steps.SAVE_PPTX,
        ]

    def wrong_results(self):
        winner, second = self.values.winner, self.values.second
        return {
            "the second": self.put({-1: second}),
            "both": self.put({-1: f"{winner} and {second}"}),
            "on the first slide, too": self.put({-1: winner, 0: winner}),
            "the first name alone": self.put({-1: winner.split()[0]}),
        }

    def right_result(self, machine):
        self.put({-1: self.values.winner.replace("'", "\u2019")})(machine)  # as it is typed

    def put(self, names):
        """Return what puts names in titles, by the index of the slide."""

        def change(made):
            for index, name in names.items():
                frame = made.slides[len(made.slides) + index if index < 0 else index].shapes.title
                text = frame.text_frame.text
                frame.text_frame.text = text.replace(BLANK, name) if BLANK in text else name

        return self.edited(change)
