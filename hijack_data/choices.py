"""What users choose by name, where the choice is fixed.

This module imports nothing of the library: the command line shows the choices, and must not wait
for the modules that use them.
"""

from typing import Literal, TypeAlias, get_args

CLEAN = "clean"  # the condition without a corruption
BACKENDS = ("numpy", "torch", "jax")
LABEL_POLICIES = ("keep", "avoid", "drop", "recover")
LAZY = "lazy"
OUTPUTS = ("materialised", LAZY)
Platform: TypeAlias = Literal["linux-xfce", "linux", "windows", "macos", "android", "ios", "web"]
PLATFORMS: tuple[Platform, ...] = get_args(Platform)
