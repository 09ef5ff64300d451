"""What an onlooker learns from: reminders, summaries of what happened, and recovery steps (paper, section "Critical
Designs")."""

from .export import export_onlooker
from .report import OnlookerReport

__all__ = ["OnlookerReport", "export_onlooker"]
