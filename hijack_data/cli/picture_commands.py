"""`hijack apply` and `hijack gallery`: corrupt pictures."""

import importlib.util
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from .completion import complete
from .options import BriefCommand, seed_option
from .terminal import echo

if TYPE_CHECKING:
    from ..plan import Plan
    from ..planner import Planner
    from ..types import UInt8Array


@click.command("apply", cls=BriefCommand, more=("plan_file", "save_plan", "step", "tree"))
@click.argument("image")
@click.argument(
    "name", required=False, shell_complete=complete("hijack_data.corruption:corruption_names")
)
@click.option(
    "-o",
    "--out",
    required=True,
    metavar="OUT.png|DIR",
    help="Where to write the corrupted picture.",
)
@seed_option()
@click.option(
    "--sample",
    metavar="ID",
    help="Id of the sample; another id, another plan.  [default: 0; in a folder the name]",
)
@click.option(
    "--step",
    type=int,
    metavar="N",
    help="Step in the trajectory.  [default: the first at which it acts]",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a parameter; may be repeated.",
)
@click.option(
    "--severity", type=int, metavar="1-5", help="1 (mild) to 5 (harsh); 3 is the paper's default."
)
@click.option(
    "--tree", metavar="A11Y.xml", help="Accessibility tree with the interactive elements."
)
@click.option("--save-plan", metavar="PLAN.json", help="Write the plan as well.")
@click.option(
    "--plan", "plan_file", metavar="PLAN.json", help="Apply this plan instead of making one."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def apply_command(
    image: str, name: str | None, out: str, save_plan: str | None, as_json: bool, **options: Any
) -> None:
    """Corrupt one picture, or all of a folder.

    Such as: hijack apply screen.png marks -o marked.png
    """
    from .._apply import apply
    from ..file_io import write_atomic
    from ..picture_io import encode_png, load_image
    from .picture_folders import apply_to_folder
    from .picture_plans import make_plan

    if options["plan_file"] is not None:
        _refuse_beside_plan(click.get_current_context())
    sample = options.pop("sample")

    def corrupt(image: str, out: str, sample: str) -> "tuple[Plan, UInt8Array, tuple[str, ...]]":
        arguments: dict[str, Any] = {**options, "sample": sample}
        pixels, notes = load_image(image)
        plan, plan_notes = make_plan(
            pixels, name, arguments.pop("plan_file"), arguments.pop("settings"), **arguments
        )
        result = apply(plan, pixels)
        write_atomic(out, encode_png(result))
        return plan, result, (*notes, *plan_notes, *plan.notes)

    if Path(image).is_dir():
        _refuse_for_folders(sample=sample, save_plan=save_plan, tree=options["tree"])
        apply_to_folder(Path(image), Path(out), corrupt, as_json)
        return
    _check_output(out)
    plan, result, notes = corrupt(image, out, "0" if sample is None else sample)
    if save_plan is not None:
        write_atomic(save_plan, plan.to_json() + "\n")
    _report(plan, result, notes, out, as_json)


def _check_output(out: str) -> None:
    if Path(out).suffix.lower() != ".png":
        raise click.UsageError(
            f"-o {out!r}: only .png keeps the exact pixels; name the output *.png"
        )


def _refuse_beside_plan(context: click.Context) -> None:
    deciding = ("settings", "severity", "seed", "sample", "step", "tree")
    listed = [
        "--set" if name == "settings" else f"--{name}"
        for name in deciding
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT
    ]
    if listed:
        raise click.UsageError(f"--plan decides everything already; leave out {', '.join(listed)}")


def _refuse_for_folders(**options: str | None) -> None:
    for name, value in options.items():
        if value is not None:
            option = name.replace("_", "-")
            raise click.UsageError(f"--{option} is for one picture, not for a folder")


def _report(
    plan: "Plan", result: "UInt8Array", notes: tuple[str, ...], out: str, as_json: bool
) -> None:
    from ..picture_io import pixel_sha256

    sha = pixel_sha256(result)
    height, width = result.shape[:2]
    if as_json:
        row = {
            "corruption": plan.corruption,
            "digest": plan.digest(),
            "sha256": sha,
            "size": [width, height],
        }
        echo(json.dumps({**row, "notes": list(notes)}))
        return
    echo(f"{out}: {plan.corruption}, {width}x{height}, plan {plan.digest()[:12]}")
    for note in notes:
        echo(f"  note: {note}")


@click.command()
@click.argument("images", nargs=-1, required=True, metavar="IMAGE|DIR...")
@click.option("-o", "--out", required=True, metavar="OUT.html", help="Where to write the page.")
@seed_option()
@click.option("--corruptions", metavar="A,B|all", help="Which to show.  [default: all]")
@click.option(
    "--detect", type=click.Choice(["picture", "ocr", "none"]), help="How to find elements."
)
def gallery(
    images: tuple[str, ...], out: str, seed: int, corruptions: str | None, detect: Any
) -> None:
    """Make one self-contained HTML page of before/after pictures."""
    from ..config import specs_from
    from ..file_io import write_atomic
    from ..gallery import gallery as make_page
    from .picture_folders import find_pictures

    if detect is None:
        detect = "picture" if importlib.util.find_spec("cv2") else "none"

    planners: dict[str, Planner] | None = None
    if corruptions:
        planners = {spec.name: spec for spec in specs_from(corruptions)}
    page = make_page(find_pictures(images), seed=seed, planners=planners, detect=detect)
    if page.pictures:
        write_atomic(out, page.html)
        pictures = f"{page.pictures} picture{'s' if page.pictures > 1 else ''}"
        echo(f"{out}: {pictures}, {len(page.html) / 2**20:.1f} MiB")
    else:
        echo(f"{out}: not written, no picture can be read", err=True)
    for problem in page.problems:
        echo(f"  problem: {problem}", err=True)
    if page.problems:
        sys.exit(1)
