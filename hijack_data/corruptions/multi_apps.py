"""Multi apps: a second, unrelated application beside the task's.

The paper's Algorithm "Multi Apps". Its effect on a live machine is
`online_env/effects/multi_apps.py`, its look in recordings `pipelines/edits/multi_apps.py`.
"""

from dataclasses import dataclass
from typing import ClassVar

from ..apps import normalize_app
from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Steps, param
from ..plan import Effect
from ..rng import Stream
from ..types import Scene

# The paper's list, in its order: the first application that the task does not use is launched.
APPS = (
    "vscode",
    "chrome",
    "gimp",
    "libreoffice_calc",
    "libreoffice_impress",
    "libreoffice_writer",
    "vlc",
    "thunderbird",
)


@register
@dataclass(frozen=True)
class MultiApps(Corruption):
    """Opens another application beside the one that the task uses."""

    name: ClassVar[str] = "multi_apps"
    category: ClassVar[Category] = "visual_disruptor"
    scope: ClassVar[Scope] = "state"
    effects: ClassVar[tuple[str, ...]] = ("launch_app",)
    pictures: ClassVar[tuple[str, ...]] = ("window",)
    paper: ClassVar[str] = "Algorithm 5 (Multi Apps)"

    another_app: str = param("vscode", "The other application", choices=APPS, paper="another app")
    step: Steps = param(0, "The step before which it opens", kind="steps", low=0)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Take `another_app`, or the first of the paper's list that the task does not use."""
        task_apps = {normalize_app(app) for app in scene.apps}
        candidates = [app for app in (self.another_app, *APPS) if app not in task_apps]
        if not candidates:
            return Draft(notes=("the task uses every application of the list: none is launched",))
        order = list(dict.fromkeys(candidates))
        notes = (
            ()
            if order[0] == self.another_app
            else (f"the task uses {self.another_app}; {order[0]} takes its place",)
        )
        return Draft(
            effects=(Effect("launch_app", {"app": order[0], "then": order[1:], "tile": True}),),
            notes=notes,
        )
