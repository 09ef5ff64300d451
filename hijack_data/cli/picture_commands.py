"""`hijack apply` and `hijack gallery`: corrupt pictures."""

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import click
import yaml

from .. import params as p
from .._apply import apply
from ..backends import NAMES, convert, to_numpy
from ..composites import composite, is_bare, uses_elements
from ..config import specs_from
from ..corruption import Corruption, check_names, find_corruption
from ..elements import scene_from
from ..errors import HijackError, MissingDependencyError, ParameterError, PlanError
from ..file_io import write_atomic
from ..picture_io import encode_png, load_image, pixel_sha256
from ..plan import Plan
from ..planner import Planner
from ..types import Scene, UInt8Array
from .completion import complete
from .options import BriefCommand, seed_option
from .picture_folders import apply_to_folder, find_pictures
from .terminal import echo


def parse_settings(cls: type[Corruption], settings: tuple[str, ...]) -> dict[str, Any]:
    """Turn `key=value` words into parameters.

    The value of a text parameter is taken as it is, any other is read as YAML.

    Raises:
        ParameterError: a word is not `key=value`, or its value is not YAML.
    """
    values: dict[str, Any] = {}
    for setting in settings:
        key, sign, text = setting.partition("=")
        if not sign:
            raise ParameterError(f"--set {setting!r} must be key=value")
        check_names(cls, {key: None})
        if key in values:
            raise ParameterError(f"--set {key} is given twice; remove one")
        parameter, _ = p.parameters(cls)[key]
        if parameter.kind in ("str", "choice", "color", "ip"):
            values[key] = text.replace("\\n", "\n")
            continue
        try:
            values[key] = yaml.safe_load(text)
        except yaml.YAMLError:
            accepts = parameter.accepts
            raise ParameterError(f"--set {key}: {text!r} cannot be read as {accepts}") from None
    return values


def make_scene(
    planner: Planner, image: UInt8Array, tree: str | None
) -> tuple[Scene, tuple[str, ...]]:
    """Make the scene of a picture, with its elements if the corruption needs them."""
    if tree is not None:
        return scene_from(image, tree=_read(tree)), ()
    if not uses_elements(planner):
        return scene_from(image, detect="none"), ()
    try:
        return scene_from(image), ()
    except MissingDependencyError as error:
        return scene_from(image, detect="none"), (f"no elements are known: {error}",)


def _read(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise HijackError(f"{path}: cannot be read ({error.strerror or error})") from None


def _make_plan(
    image: UInt8Array,
    name: str | None,
    plan_file: str | None,
    settings: tuple[str, ...],
    **key: Any,
) -> tuple[Plan, tuple[str, ...]]:
    # The plan, read from a file or made for this picture.
    severity = key.pop("severity")
    tree = key.pop("tree")
    if plan_file is not None:
        if settings or severity is not None:
            raise click.UsageError(
                "--plan contains the parameters already; leave out --set and --severity"
            )
        return _read_plan(plan_file, name), ()
    if name is None:
        raise click.UsageError("give the NAME of a corruption, or --plan FILE")
    cls = find_corruption(name)
    values = parse_settings(cls, settings)
    spec = cls(**values) if severity is None else cls.at(severity, **values)
    scene, notes = make_scene(spec, image, tree)
    plan = spec.plan(scene, **key)
    if not is_bare(plan):
        return plan, notes
    try:
        composited = composite(plan, image, scene, seed=key["seed"], sample=key["sample"])
    except HijackError as error:
        if not notes:
            raise
        raise HijackError(f"{error}; {notes[-1]}") from None
    advice = "a live desktop shows its own, see `hijack desktop corrupt`"
    return composited.plan, (*notes, f"fidelity: {composited.fidelity}; {advice}")


def _read_plan(file: str, name: str | None) -> Plan:
    plan = Plan.from_json(_read(file))
    if name is not None and plan.corruption not in (find_corruption(name)().id, name):
        raise PlanError(f"{file}: a plan of {plan.corruption}, not of {name}")
    if is_bare(plan):
        raise PlanError(
            f"{file}: a plan of {plan.corruption} for a machine, which shows nothing on a"
            " picture; leave out --plan and give the corruption's name"
        )
    return plan


@click.command(
    "apply", cls=BriefCommand, more=("backend", "plan_file", "save_plan", "step", "tree")
)
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
    "--backend",
    type=click.Choice(NAMES),
    default="numpy",
    show_default=True,
    help="What draws; the bytes are the same.",
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
    image: str,
    name: str | None,
    out: str,
    backend: str,
    save_plan: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Corrupt one picture, or all of a folder.

    Such as: hijack apply screen.png marks -o marked.png
    """
    sample = options.pop("sample")

    def corrupt(image: str, out: str, sample: str) -> tuple[Plan, UInt8Array, tuple[str, ...]]:
        arguments: dict[str, Any] = {**options, "sample": sample}
        pixels, notes = load_image(image)
        plan, plan_notes = _make_plan(
            pixels, name, arguments.pop("plan_file"), arguments.pop("settings"), **arguments
        )
        result = to_numpy(apply(plan, convert(pixels, backend)))
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
    _report(plan, result, notes, backend, out, as_json)


def _check_output(out: str) -> None:
    if Path(out).suffix.lower() != ".png":
        raise click.UsageError(
            f"-o {out!r}: only .png keeps the exact pixels; name the output *.png"
        )


def _refuse_for_folders(**options: str | None) -> None:
    for name, value in options.items():
        if value is not None:
            option = name.replace("_", "-")
            raise click.UsageError(f"--{option} is for one picture, not for a folder")


def _report(
    plan: Plan, result: UInt8Array, notes: tuple[str, ...], backend: str, out: str, as_json: bool
) -> None:
    sha = pixel_sha256(result)
    height, width = result.shape[:2]
    if as_json:
        row = {
            "corruption": plan.corruption,
            "digest": plan.digest(),
            "sha256": sha,
            "size": [width, height],
        }
        echo(json.dumps({**row, "notes": list(notes), "backend": backend}))
        return
    echo(f"{out}: {plan.corruption}, {width}x{height}, plan {plan.digest()[:12]}, {backend}")
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
    from ..gallery import gallery as make_page

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
