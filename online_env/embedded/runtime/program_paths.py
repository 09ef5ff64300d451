"""Programs that make a desktop's network: the machine's own, or else those of the desktop's image.

A program of an image runs on the image's own C library, so it does not matter which one the machine
has.
"""

import os
import shutil
from pathlib import Path

from .desktop_config import SetupError

# Only the first holds files: the other one's links lead to the machine's, seen from outside.
_FOLDERS = ("usr/bin", "usr/sbin")
# By os.uname().machine: an image's libraries, and the loader among them.
_LIBRARIES = {
    "x86_64": ("usr/lib/x86_64-linux-gnu", "ld-linux-x86-64.so.2"),
    "aarch64": ("usr/lib/aarch64-linux-gnu", "ld-linux-aarch64.so.1"),
}


def command(name: str, system: str = "/") -> list[str]:
    """Return how the program `name` is called.

    Args:
        name: of the program.
        system: the root of the image; `/` where there is none.

    Raises:
        SetupError: Neither the machine nor the image has it.
    """
    path = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"
    path_found = shutil.which(name, path=path)
    if path_found is not None:
        return [path_found]
    for folder in _FOLDERS:
        program = Path(system, folder, name)
        if system != "/" and program.is_file() and not program.is_symlink():
            folder_of_libraries, loader = _LIBRARIES[os.uname().machine]
            libraries = Path(system, folder_of_libraries)
            return [str(libraries / loader), "--library-path", str(libraries), str(program)]
    raise SetupError(
        f"{name} is not installed (apt-get install iproute2), and no image of the desktop is used;"
        " `hijack desktop install` makes one"
    )
