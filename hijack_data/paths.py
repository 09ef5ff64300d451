"""The type of what may name a file or a folder."""

import os
from typing import TypeAlias

PathLike: TypeAlias = str | os.PathLike[str]
