"""The tasks that come with the library: one short file each, in a folder for each domain.

The name of a file is that of its task, and its class has the same name in CamelCase: a new file is
a new task, and nothing else has to be told.
"""

from pathlib import Path


def class_references() -> dict[str, str]:
    """Return where the class of each task is, as `module:Class`, by the name of the task."""
    root = Path(__file__).parent
    references: dict[str, str] = {}
    for path in sorted(root.glob("*/*.py")):
        if path.stem.startswith("_"):
            continue
        module = f"{__name__}.{path.parent.name}.{path.stem}"
        references[path.stem] = f"{module}:{class_name(path.stem)}"
    return references


def class_name(name: str) -> str:
    """Return the name of a task's class: `write_note` is `WriteNote`."""
    return "".join(word.capitalize() for word in name.split("_"))
