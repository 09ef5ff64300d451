"""The notebooks as pages, with what was stored when they last ran (examples/notebooks/run.py)."""

import base64
import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "examples" / "notebooks"
# Links of a notebook lead through the repository; its page is beside those of docs/.
_DOCS = re.compile(r"\]\(\.\./\.\./docs/")


def pages(folder: Path) -> dict[str, str]:
    """The text of each page by file; pictures are written below `folder`."""
    return {
        f"notebooks/{path.stem}.md": page(path, folder)
        for path in sorted(NOTEBOOKS.glob("*.ipynb"))
    }


def places() -> dict[str, str]:
    """The place on the site of each notebook, by its file in the repository."""
    return {
        path.relative_to(ROOT).as_posix(): f"notebooks/{path.stem}.md"
        for path in NOTEBOOKS.glob("*.ipynb")
    }


def page(path: Path, folder: Path) -> str:
    """A notebook as Markdown, each cell with its outputs."""
    parts: list[str] = []
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(_DOCS.sub("](../", source))
            continue
        parts.append(f"```python\n{source}\n```")
        name = f"{path.stem}-{number}.jpg"
        parts += [_shown(output, name, folder) for output in cell["outputs"]]
    file = path.relative_to(ROOT).as_posix()
    parts.insert(1, f"The notebook is `{file}`; what it shows here was stored when it last ran.")
    return "\n\n".join(parts) + "\n"


def _shown(output: dict[str, Any], name: str, folder: Path) -> str:
    """An output: a picture, which is written, or text."""
    data = output.get("data", {})
    if "image/jpeg" in data:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(base64.b64decode(data["image/jpeg"]))
        return f"![What the cell shows](../pictures/{name})"
    text = "".join(output.get("text", "") or data.get("text/plain", ""))
    return f"```{{.text .output}}\n{text.rstrip()}\n```"
