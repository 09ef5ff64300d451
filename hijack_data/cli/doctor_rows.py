"""The rows that `hijack doctor` prints for the extras and for the desktop."""

import importlib
import platform
from collections.abc import Iterator
from typing import Any

from .. import extras

# The purpose of each extra. An extra without an entry here is still listed.
PURPOSES = {
    "torch": "tensors on CPU and GPU",
    "jax": "JAX arrays, Grain loaders",
    "hf": "Hugging Face datasets",
    "vision": "elements from a screenshot alone",
    "ocr": "elements by reading the screen",
    "openvino": "the same in half the time, with AVX-512",
    "fast": "compiled pasting and resizing",
    "online": "live desktops, benchmarks, their agents",
    "agents": "models behind APIs as agents",
    "inspect": "benchmarks as tasks of Inspect",
    "mcp": "episodes for any MCP client",
    "search": "the worst corruptions for an agent",
    "agent-s": "Agent S3, in an environment of its own",
    "cua": "cua-agent, in an environment of its own",
    "serve": "desktops behind an OpenEnv server",
    "ray": "builds and benchmarks on a cluster",
    "train": "the training examples",
    "trl": "TRL's trainers, supervised fine-tuning",
    "video": "episodes as MP4 files",
    "browser": "the pages of MiniWoB++, for a browser as the desktop",
    "verl": "verl's trainer, in an environment of its own",
    "dev": "work on AgentHijack itself",
    "docs": "the site (make docs)",
}
OK = "[green]ok[/]"
LACKING = "[yellow]--[/]"


def extra_rows() -> Iterator[tuple[str, str, str, str]]:
    """Yield a row for each extra that the package declares: mark, name, purpose, modules."""
    for extra, modules in _extras().items():
        missing = extras.lacking(modules)
        purpose = PURPOSES.get(extra, "")
        if missing:
            yield LACKING, extra, purpose, f"missing: {', '.join(missing)}"
        else:
            yield OK, extra, purpose, ", ".join(modules)


def extras_remedy() -> str:
    """Return how to add the extras that are missing, or `""` if a user lacks none."""
    if not extras.extras():
        return "the package is not installed, so its extras are not known: pip install -e ."
    missing: list[str] = []
    for name, modules in _extras().items():
        if name not in (*extras.WIDE, *extras.APART) and extras.lacking(modules):
            missing.append(name)
    if not missing:
        return ""
    return f"to add what is missing: {extras.remedy(*missing)}"


def desktop_row() -> tuple[str, str, str, str]:
    """Return the row on whether real desktops with a browser can run here."""
    purpose = "real desktops on this machine"
    if platform.system() != "Linux":
        instead = "use a desktop of your own over HTTP (docs/bring_your_own_vm.md)"
        return LACKING, "desktop", purpose, f"needs Linux; {instead}"
    # This module belongs to another package of the distribution, on which this one does not depend.
    doctor: Any = importlib.import_module("online_env.embedded.doctor")
    failed = [check for check in doctor.diagnose() if check.required and not check.ok]
    if not failed:
        return OK, "desktop", purpose, "ready: hijack desktop up"
    suffix = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
    advice = "hijack desktop doctor says how to fix this"
    return LACKING, "desktop", purpose, f"lacks {failed[0].name}{suffix}: {advice}"


def _extras() -> dict[str, tuple[str, ...]]:
    """Return all extras except `all`, those with a listed purpose first."""
    modules_by_extra = dict(extras.extras())
    modules_by_extra.pop("all", None)
    described = {name: modules_by_extra[name] for name in PURPOSES if name in modules_by_extra}
    return described | modules_by_extra
