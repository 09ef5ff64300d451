"""Have several workspaces, and give one of them a name."""

import re

from online_env.tasks import Task
from online_env.tasks.kit import desktop_settings
from online_env.tasks.plan_words import quoted

APP = "xfwm4-workspace-settings"
NAMES = ("Mail", "Music", "Work", "Drawings", "Reading", "Games", "Photos", "Letters")


class SetWorkspaces(Task):
    """The number of workspaces changes, and the name of the second one."""

    name = "set_workspaces"
    domain = "desktop"
    apps = ("workspace_settings",)
    phrasings = (
        "In the settings of the workspaces, which are open, set the number of workspaces to"
        ' {count} and give workspace 2 the name "{label}".',
        'I would like to have {count} workspaces, of which the second is called "{label}". Please'
        " set that up.",
        'Settings, Workspaces: {count} of them; rename "Workspace 2" to "{label}".',
    )

    def draw(self, stream):
        return {"count": stream.integer(3, 6), "label": stream.choice(NAMES)}

    def problems(self, machine):
        yield from machine.unexpected_changes()
        expected = {"general/workspace_count": str(self.values.count)}
        yield from desktop_settings.setting_problems(machine, "xfwm4", expected)
        names = desktop_settings.setting(machine, "xfwm4", "general/workspace_names")
        if not self.are_right(names):
            yield f"the workspaces are named {names}"

    def are_right(self, names) -> bool:
        """Return whether only the second workspace was renamed; there may be more names."""
        if names is None or len(names) < self.values.count:
            return False
        usual = [f"Workspace {number}" for number in range(1, len(names) + 1)]
        return names == [usual[0], self.values.label, *usual[2:]]

    def oracle(self, hand):
        label = self.values.label
        desktop_settings.set_number(hand, "Number of workspaces:", self.values.count, APP)
        # The last one has the label if a click went astray.
        hand.find("table-cell", re.compile(f"(Workspace {self.values.count}|{label})$"), APP)
        cells = hand.wait_until_stable("list of the workspaces", lambda: self.cells(hand))
        for number, cell in enumerate(cells, 1):
            name = label if number == 2 else f"Workspace {number}"
            if cell.name != name:
                hand.double_click(cell)
                # The tree has no node for the text that is edited.
                hand.replace(f"{name}\n")
        hand.find("table-cell", label, APP)

    def cells(self, hand):
        """Return the names of all workspaces from top to bottom; `None` until they are there."""
        name = re.compile(f"Workspace [0-9]+$|{self.values.label}$")
        cells = [
            node
            for node in hand.look()
            if node.role == "table-cell" and node.box and APP in node.app and name.match(node.name)
        ]
        by_row = sorted(cells, key=lambda cell: cell.centre[1])
        return by_row if len(by_row) == self.values.count else None

    def plan(self):
        return [
            'window "Workspaces"',
            'double-click right of "Number of workspaces:"',
            "press ctrl+a",
            f"type {quoted(str(self.values.count))}",
            "press tab",
            f"wait for {quoted(f'Workspace {self.values.count}')}",
            'double-click "Workspace 2"',
            "press ctrl+a",
            f"type {quoted(self.values.label)}",
            "press enter",
            'click "Workspace 1"',  # the pointer covers the name, which is selected
            f"wait for {quoted(self.values.label)}",
        ]

    def wrong_results(self):
        count, label = self.values.count, self.values.label
        return {
            "only the number": lambda m: arrange(m, count, "Workspace 2"),
            "only the name": lambda m: arrange(m, 2, label),
            "one more": lambda m: arrange(m, count + 1, label),
            "another one": lambda m: arrange(m, count, "Workspace 2", label),
        }

    def right_result(self, machine):
        arrange(machine, self.values.count, self.values.label)


def arrange(machine, count, second, third="Workspace 3"):
    """Store a number of workspaces, and the names of two of them."""
    later = [f"Workspace {number}" for number in range(4, count + 1)]
    names = ["Workspace 1", second, third, *later][:count]
    desktop_settings.store(machine, "xfwm4", "general/workspace_count", str(count))
    desktop_settings.store(machine, "xfwm4", "general/workspace_names", names)
