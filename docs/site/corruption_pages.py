"""A page for each corruption, and the gallery, from what the library says about itself."""

import json
from collections.abc import Iterable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import charts
import pictures
import yaml

import hijack_data as hj
from hijack_data.cli.list_commands import describe
from hijack_data.composites import composite, is_bare

TEXTS = yaml.safe_load((Path(__file__).parent / "texts.yaml").read_text(encoding="utf-8"))
# Where the divider stands at first, in percent: in the middle of what any of the nine changes.
DIVIDED_AT = 45
KINDS = {
    "visual_disruptor": "changes what is seen",
    "unexpected_operation": "does something that the agent did not do",
    "environment_error": "breaks what the agent relies on",
}

NUMPY = """import numpy as np

import hijack_data as hj

screen = np.full((1080, 1920, 3), 235, np.uint8)  # your screenshot: uint8 RGB
scene = hj.Scene(size=(1080, 1920), boxes=[[40, 40, 400, 90]], target=(220, 65))
plan = hj.make_corruption("{name}").plan(scene, seed=3, sample="traj-3", step=0)
after = hj.apply(plan, screen)  # the input is not modified
"""
TORCH = """import torch

import hijack_data.transforms as tr

screen = torch.full((3, 1080, 1920), 235, dtype=torch.uint8)
corrupt = tr.{cls}(severity=3, seed=3)
after = corrupt({{"image": screen, "id": "traj-3", "target": (220, 65)}})
"""
JAX = """import grain
import numpy as np

import hijack_data as hj
import hijack_data.grain as hg

rows = [{{"image": np.full((1080, 1920, 3), 235, np.uint8), "id": "traj-3", "target": (220, 65)}}]
dataset = grain.MapDataset.source(rows).map(hg.Corrupt(hj.{cls}(), seed=3))
after = dataset[0]["image"]
"""
JAX_ARRAY = """import jax.numpy as jnp

import hijack_data as hj

screen = jnp.full((1080, 1920, 3), 235, jnp.uint8)
scene = hj.Scene(size=(1080, 1920), target=(220, 65))
after = hj.apply(hj.make_corruption("{name}").plan(scene, seed=3, sample="traj-3"), screen)
"""
BUILD = """from pipelines import build

build("examples/recordings", "shown_{name}", corruptions="{name}", seed=3)
"""
ROWS_HF = """from datasets import load_dataset

rows = load_dataset("shown_{name}", split="train")
print(len(rows), rows[0]["corruption"], rows[0]["instruction"])
"""
ROWS_TORCH = """from pipelines.loaders.torch import TorchDataset

rows = TorchDataset("shown_{name}")
print(len(rows), rows[0]["screenshot"].shape)
"""
ROWS_GRAIN = """import grain

from pipelines.loaders.grain import GrainSource

rows = grain.MapDataset.source(GrainSource("shown_{name}")).shuffle(seed=1)
print(rows[0]["corruption"])
"""
COMMAND = """. .venv/bin/activate
hijack show {name}
hijack apply examples/recordings/images/notes-04.png {name} -o out.png --seed 3
"""
LIVE_COMMAND = """hijack desktop up --name try
hijack desktop corrupt {name} --on try --seed 3
hijack desktop down try
"""


def page(name: str, folder: Path) -> str:
    """The page of a corruption; `folder` holds the pictures that could be made."""
    return "\n".join(_lines(name, folder))


def _lines(name: str, folder: Path) -> Iterator[str]:
    info = describe(type(hj.make_corruption(name)))
    words = TEXTS[name]
    yield f"# {words['title']}\n"
    yield f"`{name}` · {KINDS[info['category']]} · acts on the **{info['scope']}**, {info['acts']}"
    yield f"· the paper's {info['paper']} · {info['id']}\n"
    yield f"{info['summary']} {words['why']}\n"
    yield _slider(name)
    yield from _severities(name, info, folder)
    yield "## In a recording, and live\n"
    yield f"**In a recording.** {words['offline']}{_fidelity(name)}\n"
    yield f"**On a live desktop.** {words['live']}\n"
    yield from _code(name, info)
    yield from _parameters(info)
    yield from _seeds(name, folder)
    yield from _measured(name)


def _slider(name: str) -> str:
    screen = pictures.screen_of(name)
    return (
        f'<div class="ba" style="--x:{DIVIDED_AT}%">'
        f'<img src="../pictures/{screen}.webp" alt="The recorded screen" width="1280" height="720">'
        f'<img class="over" src="../pictures/{name}/after.webp" alt="The same screen under {name}"'
        ' width="1280" height="720">'
        f'<input type="range" min="0" max="100" value="{DIVIDED_AT}" aria-label="Before and after">'
        '<span class="tag left">before</span><span class="tag right">after</span></div>\n'
    )


def _severities(name: str, info: dict[str, Any], folder: Path) -> Iterator[str]:
    yield "## Severity\n"
    levels = info["severities"]
    if not levels:
        yield "It happens or it does not: there are no levels.\n"
        return
    cls = type(hj.make_corruption(name)).__name__
    yield f"Level 3 is the paper's default. Another: `hj.{cls}.at(4)`, or"
    yield f"`hijack apply ... {name} --severity 4`.\n"
    tiles: list[tuple[str, str]] = []
    for number, level in enumerate(levels, 1):
        output = ", ".join(f"{key}={json.dumps(value)}" for key, value in level.items())
        file = pictures.file_name(name, pictures.screen_of(name), level=number)
        tiles.append((file, f"<b>{number}</b> {output or 'defaults'}"))
    yield strip(tiles, folder)


def strip(tiles: list[tuple[str, str]], folder: Path, up: str = "../") -> str:
    """Small pictures in a row, each with a caption; those that were not made are left out."""
    items: list[str] = []
    for file, caption in tiles:
        if not (folder / file).exists():
            continue
        source = f"{up}pictures/{file}"
        items.append(
            f'<figure><a href="{source}"><img src="{source}" alt="{file.partition("/")[0]}"'
            ' width="480" height="270" loading="lazy"></a>'
            f"<figcaption>{caption}</figcaption></figure>"
        )
    return f'<div class="strip" style="--columns:{len(items)}">{"".join(items)}</div>\n'


def _fidelity(name: str) -> str:
    screen = pictures.shot(pictures.screen_of(name))
    key = {"seed": pictures.SEED, "sample": screen.name}
    plan = hj.make_corruption(name).plan(screen.scene, **key)
    if not is_bare(plan):
        return ""
    result = composite(plan, screen.pixels, screen.scene, **key)
    output = f" The picture above has the [fidelity](../concepts.md#fidelity) `{result.fidelity}`"
    if result.fidelity != "foreign":
        return f"{output}."
    return (
        f"{output}, since nothing says which desktop a single screenshot is of; in a dataset from a"
        " recording of our desktop it would be `recorded` or `composited`."
    )


def _code(name: str, info: dict[str, Any]) -> Iterator[str]:
    cls = type(hj.make_corruption(name)).__name__
    yield "## Code\n"
    if info["scope"] == "observation":
        parts = [
            ("NumPy", NUMPY),
            ("torch", TORCH),
            ("JAX and Grain", JAX),
            ("JAX array", JAX_ARRAY),
        ]
    else:
        yield "It changes the machine, so no tensor can show it: build rows, then load them.\n"
        parts = [
            ("Build", BUILD),
            ("Hugging Face", ROWS_HF),
            ("torch", ROWS_TORCH),
            ("JAX and Grain", ROWS_GRAIN),
        ]
    for title, text in parts:
        yield _tab(title, "python", text.format(name=name, cls=cls))
    yield _tab("Command line", "sh", COMMAND.format(name=name))
    yield _tab("Live", "sh", LIVE_COMMAND.format(name=name))


def _tab(title: str, language: str, text: str) -> str:
    inner = "\n".join(f"    {line}".rstrip() for line in text.splitlines())
    return f'=== "{title}"\n\n    ```{language}\n{inner}\n    ```\n'


def _parameters(info: dict[str, Any]) -> Iterator[str]:
    yield "## Parameters\n"
    yield "| parameter | default | accepts | meaning |\n|---|---|---|---|"
    for row in info["parameters"]:
        accepts = row["accepts"].replace("|", "or")
        yield f"| `{row['name']}` | `{json.dumps(row['default'])}` | {accepts} | {row['doc']} |"
    yield ""
    yield "Set them in YAML ([Configuration](../configuration.md)), with `--set KEY=VALUE` on the"
    yield "command line, or as arguments in Python.\n"


def _seeds(name: str, folder: Path) -> Iterator[str]:
    yield "## Seeds\n"
    yield "A plan follows from the seed, the corruption, the sample, the step and the epoch, and"
    yield "from the scene where the corruption uses it ([Concepts](../concepts.md#plan)). More"
    yield "screens, levels and seeds: [Try it](../try.md).\n"
    screen = pictures.screen_of(name)
    files = {seed: pictures.file_name(name, screen, seed=seed) for seed in pictures.SEEDS}
    different = {
        (folder / file).read_bytes() for file in files.values() if (folder / file).exists()
    }
    if len(different) < 2:
        yield "This corruption draws nothing at random: every seed gives the same picture.\n"
        return
    yield strip([(file, f"seed={seed}") for seed, file in files.items()], folder)


def _measured(name: str) -> Iterator[str]:
    chart = charts.levels(name)
    yield "## Measured\n"
    if chart:
        yield chart
        yield "On 16 recorded screens; [all figures](../figures.md).\n"
    rows = charts.paper()
    agent = next(row for row in rows if row["agent"] == "UI-TARS-1.5-7B")
    yield f"In the paper, UI-TARS-1.5-7B solves {agent['clean']} % of OSWorld's tasks on a clean"
    yield f"desktop and {agent[name]} % under this corruption ([results](../paper_results.md)).\n"


def try_page(folder: Path) -> str:
    """The page on which the reader chooses screen, corruption, severity and seed."""
    choices = {
        name: {
            "levels": list(pictures.levels(name)),
            "missing": [
                file
                for screen, level, seed in product(
                    pictures.SCREENS, pictures.levels(name), pictures.SEEDS
                )
                if not (folder / (file := pictures.file_name(name, screen, level, seed))).exists()
            ],
        }
        for name in hj.corruption_names()[:9]
    }
    text = (Path(__file__).parent / "try.md").read_text(encoding="utf-8")
    parts = {
        "screens": _options(pictures.SCREENS, pictures.SCREENS[0]),
        "corruptions": _options(choices, "pop_ups"),
        "seeds": _options(map(str, pictures.SEEDS), str(pictures.SEED)),
        "screen": pictures.SCREENS[0],
        "first": pictures.file_name("pop_ups", pictures.SCREENS[0]),
        "at": str(DIVIDED_AT),
        "choices": json.dumps(choices),
    }
    for name, part in parts.items():
        text = text.replace(f"{{{{ {name} }}}}", part)
    return text


def _options(values: Iterable[str], chosen: str) -> str:
    return "".join(
        f"<option{' selected' if value == chosen else ''}>{value}</option>" for value in values
    )


def blocks() -> Iterator[tuple[str, str, str]]:
    """Yield every Python block of the pages: the corruption, the title, the code."""
    for name in hj.corruption_names()[:9]:
        for line in _code(name, describe(type(hj.make_corruption(name)))):
            if line.startswith("===") and "```python" in line:
                title = line.split('"')[1]
                inner = line.partition("```python\n")[2].partition("    ```")[0]
                yield name, title, "\n".join(part[4:] for part in inner.splitlines())
