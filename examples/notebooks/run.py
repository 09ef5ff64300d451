"""Run the notebooks of this folder and store what they print and draw.

`python run.py [NAME ...]`; `--out DIR` writes them there instead. Pictures are
stored as JPEG, so that a notebook stays small. It needs nbclient and ipykernel,
which the extra `dev` brings.
"""

import argparse
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parent
# A picture of Pillow shows itself as PNG, ten times as large.
PICTURES_AS_JPEG = """
from PIL import Image as _Image
del _Image.Image._repr_png_
"""


def main() -> None:
    """Run what is named, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--out", type=Path, default=HERE)
    options = parser.parse_args()
    for name in options.names or sorted(path.stem for path in HERE.glob("*.ipynb")):
        began = time.perf_counter()
        notebook = run(HERE / f"{name}.ipynb")
        path = options.out / f"{name}.ipynb"
        nbformat.write(notebook, path)
        seconds, size = time.perf_counter() - began, path.stat().st_size
        print(f"{path}: {seconds:.1f} s, {size / 1e3:.0f} kB")


def run(path: Path) -> nbformat.NotebookNode:
    """Run a notebook in its own folder; no time of a run is kept."""
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(PICTURES_AS_JPEG))
    NotebookClient(
        notebook,
        timeout=300,
        resources={"metadata": {"path": str(path.parent)}},
        record_timing=False,
    ).execute()
    notebook.cells.pop(0)
    for number, cell in enumerate(code_cells(notebook), 1):
        cell.execution_count = number
        cell.outputs = list(kept(cell.outputs, number))
    notebook.metadata = {"kernelspec": notebook.metadata["kernelspec"]}
    return notebook


def code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """The cells that are run."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def kept(
    outputs: Iterable[nbformat.NotebookNode], number: int
) -> Iterator[nbformat.NotebookNode]:
    """What is printed as one text, without warnings; pictures without words."""
    printed: nbformat.NotebookNode | None = None
    for output in outputs:
        if output.get("name") == "stderr":
            continue
        if output.output_type == "stream" and printed is not None:
            printed.text += output.text
            continue
        if output.output_type == "stream":
            printed = output
        if "execution_count" in output:
            output.execution_count = number
        if "image/jpeg" in output.get("data", {}):
            output.data = {"image/jpeg": output.data["image/jpeg"]}
        yield output


if __name__ == "__main__":
    main()
