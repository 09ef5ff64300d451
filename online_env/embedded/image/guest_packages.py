"""The Python packages that the guest server needs, copied from the environment that runs this.

All of them are pure Python, so those of any host fit the image's own Python; NumPy comes from
Debian. Our own code is not in an image: the guest server's is shown to it while it loads, so that
an image outlives our versions.
"""

import hashlib
import importlib.metadata
import shutil
from pathlib import Path

from hijack_data import extras

from ... import extra
from ...errors import DesktopImageError
from .manifest import Pin

# Distributions, with what they need themselves.
NEEDED = (
    "starlette",
    "uvicorn",
    "anyio",
    "h11",
    "click",
    "idna",
    "typing_extensions",
    "python-multipart",
    "python-xlib",
    "six",
    "mss",
    "jeepney",
)
OPTIONAL = ("sniffio",)  # older versions of anyio
# Debian's packages for it, beside those of the profiles.
DEBIAN = ("python3", "python3-numpy")
# The last command of a build: no image is made in which the guest server cannot load.
PROOF = (
    "import sys; sys.path[:0] = ['/run/guest', '/usr/lib/python3/dist-packages'];"
    " import numpy, starlette.applications, uvicorn, anyio, h11, multipart, Xlib.display, mss,"
    " jeepney.io.blocking, starlette.formparsers; assert sys.version_info >= (3, 11)"
)


def install(folder: Path) -> list[Pin]:
    """Copy the packages into `folder`.

    Returns:
        What was copied, by name.

    Raises:
        DesktopImageError: One is not installed here, or is not pure Python.
    """
    folder.mkdir()
    pins: list[Pin] = []
    for name in (*NEEDED, *OPTIONAL):
        try:
            pins.append(_copy(importlib.metadata.distribution(name), folder))
        except importlib.metadata.PackageNotFoundError:
            if name not in OPTIONAL:
                remedy = extras.remedy(extra.EXTRA)
                raise DesktopImageError(
                    f"the Python package {name} is not installed, which the guest server needs;"
                    f" {remedy}"
                ) from None
    return sorted(pins, key=lambda part: part.name)


def _copy(distribution: importlib.metadata.Distribution, folder: Path) -> Pin:
    name = distribution.metadata["Name"].lower()
    if "Root-Is-Purelib: true" not in (distribution.read_text("WHEEL") or ""):
        raise DesktopImageError(
            f"the Python package {name} is not a wheel of pure Python, so an image cannot have it;"
            " install the wheel of a later version"
        )
    lines: list[str] = []
    for file in sorted(distribution.files or (), key=str):
        if file.suffix == ".pyc" or ".." in file.parts or ".dist-info" in file.parts[0]:
            continue
        source = Path(str(file.locate()))
        target = folder / file
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
        target.chmod(0o644)
        lines.append(f"{hashlib.sha256(source.read_bytes()).hexdigest()}  {file}\n")
    text = "".join(lines).encode()
    return Pin(name, distribution.version, hashlib.sha256(text).hexdigest())
