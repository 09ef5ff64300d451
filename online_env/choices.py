"""What users of runs choose by name, and the defaults of these choices.

This module imports nothing: scoring without a desktop, and the command line, show the choices, and
must not wait for the modules that use them.
"""

from typing import Literal, TypeAlias, get_args

Recovery: TypeAlias = Literal["none", "repair", "reset"]
POLICIES: tuple[Recovery, ...] = get_args(Recovery)
ErrorOrder: TypeAlias = Literal["before_setup", "after_setup"]
ERROR_ORDERS: tuple[ErrorOrder, ...] = get_args(ErrorOrder)
DrawingLayer: TypeAlias = Literal["picture", "dom"]
LAYERS: tuple[DrawingLayer, ...] = get_args(DrawingLayer)
# What `hijack score` asks: the step, whether a reminder is needed, or what happened.
Question: TypeAlias = Literal["steps", "reminders", "summaries"]
QUESTIONS: tuple[Question, ...] = get_args(Question)
NEAR_PIXELS = 32.0  # how far a point may be off where no box is known
ROW_TIMEOUT_S = 120.0  # s that an agent has for a row
CONFIDENCE = 0.95  # of the one-sided bound of a certificate
