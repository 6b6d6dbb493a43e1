"""Errors that end a command with exit code 3."""

from __future__ import annotations


class RunError(RuntimeError):
    """Failure of a run whose input was found good: a bug, a lack of memory, a dead worker."""
