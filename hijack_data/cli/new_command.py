"""`hijack new corruption NAME`: a template file that already passes `hijack check`."""

from pathlib import Path

import click

from ..errors import HijackError, ParameterError
from ..file_io import write_atomic
from .terminal import echo

PICTURE_TEMPLATE = '''"""Draws a band across the screen."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hijack_data.plugin import Corruption, Draft, Paste, Scene, Stream, param, png_recipe, register


@register
@dataclass(frozen=True)
class {cls}(Corruption):
    """Draws a band across the screen."""  # the first line is what `hijack list` shows

    name: ClassVar[str] = "{name}"
    category: ClassVar[str] = "visual_disruptor"  # unexpected_operation, environment_error
    scope: ClassVar[str] = "observation"  # state, transition and action draw nothing

    # Five severities, 1 to 5. The third is empty: it is the defaults.
    severities: ClassVar[tuple[dict, ...]] = (
        {{"height": 20}},
        {{"height": 40}},
        {{}},
        {{"height": 160}},
        {{"height": 320}},
    )

    # Every field is declared with param: default, documentation, range.
    height: int = param(80, "Height of the band in pixels", low=1, high=4096)
    opacity: int = param(160, "0 is invisible, 255 opaque", low=1, high=255)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Return what to do to `scene`, as data. Random numbers come from `stream` alone."""
        height, width = scene.size
        y = stream.integer(0, height - 1)
        band = np.full((self.height, width, 4), (40, 40, 40, self.opacity), np.uint8)
        # scene.boxes, scene.apps and scene.target may be empty. If you read scene.boxes, override
        # needs_elements. If the screen cannot hold the drawing, raise ParameterError.
        return Draft(ops=(Paste(png_recipe(band), ((0, y),)),))
'''

ACTION_TEMPLATE = '''"""Lets clicks land beside their target."""

from dataclasses import dataclass
from typing import ClassVar

from hijack_data.plugin import Corruption, Draft, InputFault, Scene, Stream, param, register


@register
@dataclass(frozen=True)
class {cls}(Corruption):
    """Lets clicks land beside their target."""  # the first line is what `hijack list` shows

    name: ClassVar[str] = "{name}"
    category: ClassVar[str] = "unexpected_operation"  # visual_disruptor, environment_error
    scope: ClassVar[str] = "action"  # changes what arrives of the agent's next actions
    inputs: ClassVar[tuple[str, ...]] = ("offset",)  # drop (lost), repeat (arrives several times)

    # Five severities, 1 to 5. The third is empty: it is the defaults.
    severities: ClassVar[tuple[dict, ...]] = (
        {{"pixels": 4}},
        {{"pixels": 8}},
        {{}},
        {{"pixels": 32}},
        {{"pixels": 64}},
    )

    # Every field is declared with param: default, documentation, range.
    every: int = param(3, "The fault hits at every step that this divides", low=1, high=1000)
    pixels: int = param(16, "How far a click lands from its target, in pixels", low=1, high=1000)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Return the faults of this step, as data. Random numbers come from `stream` alone."""
        if step % self.every:
            return Draft()
        dx = self.pixels * (1 - 2 * stream.integer(0, 1))  # to the left or to the right
        return Draft(inputs=(InputFault("offset", ("click", "drag"), dx=dx),))
'''

# By scope: the template, what its class does, and how it is tried.
TEMPLATES = {
    "observation": (PICTURE_TEMPLATE, "draws a band", "apply screen.png {name} -o out.png"),
    "action": (
        ACTION_TEMPLATE,
        "lets clicks slip",
        "bench embedded_small --agent oracle --corruptions clean,{name} -o runs/{name}",
    ),
}


@click.group()
def new() -> None:
    """Write a file to begin with."""


@new.command()
@click.argument("name")
@click.option("-o", "--out", metavar="FILE.py", help="The file to write.  [default: NAME.py]")
@click.option(
    "--scope",
    type=click.Choice(list(TEMPLATES)),
    default="observation",
    show_default=True,
    help="What it changes: the picture, or what arrives of an agent's actions.",
)
def corruption(name: str, out: str | None, scope: str) -> None:
    """Write a corruption of your own, such as: hijack new corruption dust."""
    _check_name(name)
    path = Path(out or f"{name}.py")
    _check_path(path)
    template, what_it_does, trial = TEMPLATES[scope]
    cls = "".join(part.capitalize() for part in name.split("_"))
    write_atomic(path, template.format(name=name, cls=cls))
    echo(f"{path}: {cls}, which {what_it_does}; edit it, then run:")
    echo(f"  hijack check {path}")
    echo(f"  hijack --load {path} {trial.format(name=name)}")


def _check_path(path: Path) -> None:
    if path.suffix != ".py":
        raise click.UsageError(f"-o {str(path)!r}: name the file *.py")
    if path.exists():
        raise HijackError(f"{path}: exists already; choose another file with -o")


def _check_name(name: str) -> None:
    from .. import declaration
    from ..corruption import CORRUPTIONS

    problem = next(declaration.name_problems(name), None)
    if problem is None and name in CORRUPTIONS.names():
        problem = f"name {name!r} is taken; hijack list shows all that are"
    if problem is not None:
        raise ParameterError(problem)
