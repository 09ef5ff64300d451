"""The type of arguments that name a file or a folder."""

import os
from typing import TypeAlias

PathLike: TypeAlias = str | os.PathLike[str]
