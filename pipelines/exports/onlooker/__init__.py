"""What an onlooker learns from: reminders, summaries of what happened, and recovery steps (paper, section "Critical
Designs")."""

from .export import OnlookerReport, export_onlooker

__all__ = ["OnlookerReport", "export_onlooker"]
