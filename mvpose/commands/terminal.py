"""Texts and tables of commands in a terminal."""

from collections.abc import Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text


def say(text: str | Text, *, err: bool = False) -> None:
    """Print a text as it is: its lines are not wrapped, and numbers and brackets in it are no markup."""
    Console(stderr=err).print(text, soft_wrap=True, highlight=False, markup=False)


def plain_table(title: str, labels: Sequence[str], numbers: Sequence[str], **style: Any) -> Table:
    """Return a table without rows: columns of text on the left, columns of numbers on the right.

    Args:
        title: title above the table.
        labels: headings of the columns of text.
        numbers: headings of the columns of numbers, which are not wrapped.
        style: further arguments of ``rich.table.Table``.
    """
    style = {"title_justify": "left", "title_style": "bold", "box": SIMPLE_HEAD, "show_edge": False, **style}
    table = Table(title=Text(title) if title else None, **style)
    for heading in labels:
        table.add_column(heading)
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=True)
    return table
