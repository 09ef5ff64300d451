"""Plug-ins as strangers write them: a good one, and slots in which to make it bad."""

import textwrap
from pathlib import Path

TEMPLATE = '''
"""A plug-in."""
import functools, itertools, math, os, random, secrets, sys, tempfile, time, uuid
from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field
from typing import Any, ClassVar

import numpy as np

import hijack_data as hj
from hijack_data.plugin import Corruption, Draft, Effect, Paste, Plan, Resample, Scene
from hijack_data.plugin import param, png_recipe, register

{top}

{decorators}
class Bar(Corruption):
    {doc}

    {name}
    {category}
    {scope}
    {about}

    {fields}

    {methods}

    def make_plan(self, scene, stream, step):
        height, width = scene.size
        {chance}
        size = self.half
        {code}
        recipe = {recipe}
        return {draft}
'''
SLOTS = {
    "top": "",
    "decorators": "@register\n@dataclass(frozen=True)",
    "doc": '"""Draws a disc."""',
    "name": 'name: ClassVar[str] = "bar"',
    "category": 'category: ClassVar[str] = "visual_disruptor"',
    "scope": 'scope: ClassVar[str] = "observation"',
    "about": "",
    "fields": 'half: int = param(9, "Radius in pixels", low=1, high=99)',
    "methods": "",
    "chance": "x, y = stream.integer(0, width - 1), stream.integer(0, height - 1)",
    "code": "",
    "recipe": '{"draw": "mark", "shape": "circle", "size": size, "color": "red"}',
    "draft": "Draft(ops=(Paste(recipe, ((x, y),)),))",
}


def source(**slots: str) -> str:
    """The text of a plug-in: the good one, with some slots filled otherwise."""
    unknown = slots.keys() - SLOTS.keys()
    assert not unknown, unknown
    lines = []
    for line in TEMPLATE.splitlines():
        slot = line.strip()[1:-1] if line.strip().startswith("{") else None
        if slot in SLOTS:
            indent = line[: len(line) - len(line.lstrip())]
            lines.append(textwrap.indent(textwrap.dedent({**SLOTS, **slots}[slot]).strip(), indent))
            continue
        for name in ("recipe", "draft"):
            line = line.replace(f"{{{name}}}", {**SLOTS, **slots}[name])
        lines.append(line)
    return "\n".join(lines) + "\n"


def write(folder: Path, stem: str = "bar", **slots: str) -> Path:
    """Write a plug-in to a file."""
    path = folder / f"{stem}.py"
    path.write_text(source(**slots))
    return path
