"""Put the average of some rows into a cell."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import save
from online_env.tasks.kit.sheets import SheetTask, book, changes, enter
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES

CLASSES = ("5a", "5b", "6a", "6c")


class AverageMatching(SheetTask):
    """The points of one class are averaged; rows of other classes lie between."""

    name = "average_matching"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "In the open workbook, work out the average of the points of class {group} alone, put it"
        " into cell {cell}, and save. Two decimal places are enough.",
        "{cell} should hold the average points of class {group} (at least two decimals). Save the"
        " file as it is, as xlsx.",
        "Please find out how many points the pupils of class {group} have on average and enter that"
        " number in {cell} of the sheet Points, exact to two decimals. Then save.",
    )

    def draw(self, stream):
        group = stream.choice(CLASSES)
        rows = []
        for number in range(stream.integer(16, 28)):
            own = group if number in (0, 3, 9) else stream.choice(CLASSES)
            first = stream.choice(FIRST_NAMES)
            rows.append((first, stream.choice(LAST_NAMES), own, stream.integer(12, 100)))
        points = [count for *_, found, count in rows if found == group]
        return {
            "path": f"Documents/points-{stream.integer(2019, 2025)}.xlsx",
            "rows": rows,
            "group": group,
            "cell": stream.choice(("F1", "F2", "G1", "G4", "H2")),
            "average": sum(points) / len(points),
            "formula": f'=AVERAGEIF(C2:C{len(rows) + 1};"{group}";D2:D{len(rows) + 1})',
        }

    def made(self):
        return book({"Points": [("First name", "Last name", "Class", "Points"), *self.values.rows]})

    def judge(self, now, before):
        cell, average = self.values.cell, self.values.average
        yield from changes(now, before, {cell})
        found = now.value(cell)
        is_near = isinstance(found, (int, float)) and abs(found - average) <= 0.0051
        if not is_near:
            yield f"{cell} is {found!r}, not {average:.2f}"

    def oracle(self, hand):
        enter(hand, self.values.cell, self.values.formula)
        save(hand)

    def plan(self):
        return [
            plan_steps.CALC,
            *plan_steps.enter_in_cell(self.values.cell, self.values.formula),
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        cell, average = self.values.cell, self.values.average
        points = [row[3] for row in self.values.rows]
        return {
            "the average of all": self.put({cell: sum(points) / len(points) + 1e-2}),
            "too rough": self.put({cell: round(average) + 0.01}),
            "in another cell": self.put({"H9": average}),
            "a formula without a value": self.put({cell: self.values.formula}),
        }

    def right_result(self, machine):
        self.put({self.values.cell: round(self.values.average, 2)})(machine)
