"""Training data of an onlooker: reminders, summaries of events, and recovery steps.

See the paper, section "Critical Designs".
"""

from .export import export_onlooker
from .report import OnlookerReport

__all__ = ["OnlookerReport", "export_onlooker"]
