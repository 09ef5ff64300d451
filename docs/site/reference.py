"""The reference of the public names, from their docstrings."""

import re
from pathlib import Path

import hijack_data as hj

ROOT = Path(__file__).resolve().parents[2]
GROUPS = {
    "Corruptions": ("corruptions",),
    "Planning and applying": (
        "_apply",
        "corruption",
        "params",
        "plan",
        "planner",
        "rng",
        "drawing.raster",
    ),
    "Combining": ("compose",),
    "Screens, actions, coordinates": ("types", "elements", "coords", "safety"),
    "Errors": ("errors",),
}


def core() -> str:
    """The page of `hijack_data`."""
    homes = hj._HOMES
    values = {home for group in GROUPS.values() for home in group}
    groups = GROUPS | {"More": tuple(home for home in homes if home not in values)}
    parts = ["# hijack_data\n", "`import hijack_data as hj`. Every name below is `hj.NAME`.\n"]
    for title, places in groups.items():
        names = [f"hijack_data.{name}" for place in places for name in homes.get(place, ())]
        entry = _corruption if title == "Corruptions" else _entry
        if names:
            parts += [f"## {title}\n", *map(entry, names)]
    return "\n".join(parts)


def transforms() -> str:
    """The page of the transforms and the loaders."""
    names = ["PopUps", "Marks", "Subtitle", "Resolution", "OneOf", "Sequence", "Schedule"]
    names += ["FromConfig", "Replay"]
    parts = ["# Transforms and loaders\n", "## torch and torchvision\n"]
    parts += [_entry(f"hijack_data.transforms.{name}") for name in names]
    parts += ["## Grain\n", _entry("hijack_data.grain.Corrupt")]
    parts += ["## Datasets as loaders\n"]
    parts += [
        _entry("pipelines.loaders.torch.TorchDataset"),
        _entry("pipelines.loaders.torch.collate"),
        _entry("pipelines.loaders.grain.GrainSource"),
    ]
    return "\n".join(parts)


def pipelines() -> str:
    """The page of `pipelines`."""
    import pipelines as package

    names = [f"pipelines.{name}" for name in package.__all__]
    return "\n".join(["# pipelines\n", "`import pipelines`.\n", *map(_entry, names)])


def online_env() -> str:
    """The page of `online_env`; its names are read, since importing them needs an extra."""
    text = (ROOT / "online_env" / "__init__.py").read_text(encoding="utf-8")
    names = re.findall(r"import (\w+) as \1$", text, re.M)
    parts = ["# online_env\n", "`import online_env`. It needs the extra `online`.\n"]
    return "\n".join([*parts, *(_entry(f"online_env.{name}") for name in names)])


def pages() -> dict[str, str]:
    """All pages of the reference, by file."""
    return {
        "reference/hijack_data.md": core(),
        "reference/transforms.md": transforms(),
        "reference/pipelines.md": pipelines(),
        "reference/online_env.md": online_env(),
    }


def names(page: str) -> list[str]:
    """The names that a page documents."""
    return re.findall(r"^::: ([\w.]+)$", page, re.M)


def _entry(name: str) -> str:
    return f"::: {name}\n"


def _corruption(name: str) -> str:
    """A corruption without what all of them have; its parameters are on its own page."""
    cls = getattr(hj, name.rpartition(".")[2])
    link = f"Parameters, levels and pictures: [{cls.name}](../corruptions/{cls.name}.md)"
    return f"{_entry(name)}    options:\n      members: false\n\n{link}\n"
