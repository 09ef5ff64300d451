"""Move all that came from one company into a folder of its own."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import move_files, rearranged, sample_file
from online_env.tasks.kit.word_lists import sample, shuffled

COMPANIES = ("Alder", "Birke & Co", "Calder", "Dunmore", "Elmhurst", "Fjord Power", "Gable")
KINDS = ("invoice", "reminder", "receipt")


class FileInvoices(Task):
    """Three of nine letters go from the inbox into a new folder; those of others stay."""

    name = "file_invoices"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        'In Documents/Inbox there are letters of several companies. Make a folder "{company}" in'
        " Documents and move everything from {company} there.",
        "Please file what {company} sent us: all their papers are in Documents/Inbox and should go"
        ' to a new folder Documents/{company}. Only the ones with "{company}" in the name.',
        "Move every {company} file from Documents/Inbox to Documents/{company} (create that"
        " folder). The other companies' files stay in the inbox.",
    )

    def draw(self, stream):
        companies = sample(stream, COMPANIES, 3)
        files = {company: letters(stream, company) for company in companies}
        company = companies[0]
        names = [name for group in files.values() for name in group]
        return {"company": company, "files": files, "all": shuffled(stream, names)}

    def prepare(self, machine):
        for name in self.values.all:
            machine.write(f"Documents/Inbox/{name}", sample_file(name))

    def initial_app(self, machine):
        return "thunar", machine.path("Documents/Inbox")

    def moves(self, company):
        """Return old and new paths of what came from a company."""
        folder = f"Documents/{self.values.company}"
        names = self.values.files[company]
        return [(f"Documents/Inbox/{name}", f"{folder}/{name}") for name in names]

    def problems(self, machine):
        yield from rearranged(machine, self.moves(self.values.company))

    def oracle(self, hand):
        company = self.values.company
        thunar.go(hand, "Documents")
        thunar.make_folder(hand, company)
        thunar.go(hand, "Documents/Inbox")
        thunar.move(hand, self.values.files[company], f"Documents/{company}")

    def plan(self):
        company = self.values.company
        return [
            'window "Thunar"',
            *plan_steps.go("Documents"),
            *plan_steps.make_folder(company),
            *plan_steps.go("Documents/Inbox"),
            *plan_steps.move(self.values.files[company], f"Documents/{company}"),
        ]

    def wrong_results(self):
        moves = self.moves(self.values.company)
        other = self.moves(list(self.values.files)[1])
        inbox = [
            (old, f"{old.replace('Inbox', f'Inbox/{self.values.company}')}") for old, _ in moves
        ]
        return {
            "one is left": lambda m: move_files(m, moves[:-1]),
            "one of another company, too": lambda m: move_files(m, [*moves, other[0]]),
            "another company": lambda m: move_files(m, other),
            "a folder in the inbox": lambda m: move_files(m, inbox),
        }

    def right_result(self, machine):
        move_files(machine, reversed(self.moves(self.values.company)))


def letters(stream, company):
    """Return the names of three letters of a company."""
    months = sample(stream, range(1, 13), 3)
    return [f"2025-{month:02} {company} {stream.choice(KINDS)}.pdf" for month in months]
