"""What people look at: pages of runs, studies, rehearsals and validations, with pictures and films; data on disk."""

from pathlib import Path

TEMPLATES = Path(__file__).parent / "templates"
"""Templates of the pages; they extend those of :mod:`mvpose.report.documents`."""
