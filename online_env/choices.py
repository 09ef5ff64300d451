"""What users of live runs choose by name.

This module imports nothing: scoring without a desktop, and the command line, show the choices, and
must not wait for the modules that use them.
"""

from typing import Literal, TypeAlias, get_args

Recovery: TypeAlias = Literal["none", "repair", "reset"]
POLICIES: tuple[Recovery, ...] = get_args(Recovery)
ErrorOrder: TypeAlias = Literal["before_setup", "after_setup"]
ERROR_ORDERS: tuple[ErrorOrder, ...] = get_args(ErrorOrder)
