"""Copy a folder with all that is in it, under another name."""

from online_env.tasks import Task
from online_env.tasks.kit import plan_steps, thunar
from online_env.tasks.kit.sample_files import arrangement_problems, paths_below, sample_file
from online_env.tasks.kit.word_lists import MONTHS, TOPICS, sample
from online_env.tasks.plan_words import quoted

PROJECTS = ("Thesis", "Novel", "Website", "Tournament", "Exhibition")
BACKUPS = "Documents/Backups"


class CopyFolder(Task):
    """The copy has a dated name and lies in a folder of backups; an older one is there."""

    name = "copy_folder"
    domain = "files"
    apps = ("thunar",)
    phrasings = (
        "Make a copy of the folder {project}, which is in Documents, with all that is in it. The"
        ' copy should be in Documents/Backups and be called "{copy}".',
        "Before I change anything: please back up Documents/{project} as Documents/Backups/{copy}"
        " (a plain copy of the whole folder).",
        "I need a second copy of my {project} folder (in Documents). Put it into the folder Backups"
        ' there, named "{copy}". Keep the original and the older backup.',
    )

    def draw(self, stream):
        project = stream.choice(PROJECTS)
        month = stream.choice(MONTHS)
        files = [f"{topic}.txt" for topic in sample(stream, TOPICS, 3)]
        files.append(f"Pictures/{stream.choice(TOPICS)}.png")
        folder_path = f"Documents/{project}"
        return {
            "project": project,
            "place": folder_path,
            "copy": f"{project} {month}",
            "old": f"{BACKUPS}/{project} (old)",
            "target": f"{BACKUPS}/{project} {month}",
            "files": files,
        }

    def prepare(self, machine):
        for path in self.values.files:
            machine.write(f"{self.values.place}/{path}", sample_file(path))
        machine.write(f"{self.values.old}/{self.values.files[0]}", "An older version.\n")

    def initial_app(self, machine):
        return "thunar", machine.path("Documents")

    def problems(self, machine):
        folder_path, target = self.values.place, self.values.target
        paths = paths_below(machine, folder_path)
        copies = [(f"{folder_path}/{path}", f"{target}/{path}") for path in paths]
        yield from arrangement_problems(machine, copied=copies)

    def oracle(self, hand):
        project = self.values.project
        thunar.go(hand, BACKUPS)
        if not thunar.present(hand, self.values.copy):
            if not thunar.present(hand, project):
                thunar.go(hand, "Documents")
                thunar.select(hand, project)
                hand.press("ctrl", "c")
                thunar.go(hand, BACKUPS)
                thunar.paste(hand, project)
            thunar.rename(hand, project, self.values.copy)

    def plan(self):
        return [
            'window "Thunar"',
            f"click {quoted(self.values.project)}",
            "press ctrl+c",
            'double-click "Backups"',
            f"wait for {quoted(f'{self.values.project} (old)')}",
            "press ctrl+v",
            *plan_steps.rename(self.values.project, self.values.copy),
        ]

    def wrong_results(self):
        folder_path, target, old = self.values.place, self.values.target, self.values.old
        picture = self.values.files[-1]
        return {
            "moved": lambda m: m.run("mv", folder_path, target),
            "the old backup copied": lambda m: m.run("cp", "-r", old, target),
            "not renamed": lambda m: m.run("cp", "-r", folder_path, BACKUPS),
            "without the picture": lambda m: m.run(
                "sh", "-c", f"cp -r '{folder_path}' '{target}' && rm '{target}/{picture}'"
            ),
        }

    def right_result(self, machine):
        machine.run("cp", "-rp", self.values.place, self.values.target)
