"""Picture of the floors of both packages, from the tables of ``docs/architecture.md``: ``python -m tools.floor_plan``.

Writes ``docs/floors.svg``: a column of floors for each package, the lowest at the bottom; imports go down only.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from html import escape
from pathlib import Path
from textwrap import wrap

DOCS = Path(__file__).parents[1] / "docs"
PACKAGES = ("mvpose", "simharness")

_STYLE = """
text { font: 13px system-ui, sans-serif; fill: #1f2328; }
.name { font: 600 14px ui-monospace, monospace; }
.title { font: 600 20px system-ui, sans-serif; }
.note { font-size: 12px; fill: #59636e; }
rect { fill: #f6f8fa; stroke: #d1d9e0; }
.mvpose { stroke: #0969da; } .simharness { stroke: #bc4c00; }
path { stroke: #59636e; stroke-width: 1.5; fill: none; }
@media (prefers-color-scheme: dark) {
  text { fill: #e6edf3; } .note { fill: #9198a1; } rect { fill: #151b23; }
  .mvpose { stroke: #4493f8; } .simharness { stroke: #db6d28; } path { stroke: #9198a1; }
}
"""
_WIDTH, _GAP, _TOP, _LINE = 560, 60, 64, 17  # of a column, between columns, above them, of a line of text; px
_LETTERS = 84  # of a line of text within a column


def floors(package: str, text: str) -> list[tuple[list[str], str]]:
    """Return the rows of a package's table, the lowest first: names of rooms, and what they hold.

    Args:
        package: ``mvpose`` or ``simharness``.
        text: ``docs/architecture.md``.

    Raises:
        ValueError: the text has no table of the package.
    """
    section = re.search(rf"^## Floors of {package}\n(.*?)(?=^## |\Z)", text, re.S | re.M)
    rows = re.findall(r"^\| (`[\w./]+`(?:, `[\w./]+`)*) \| (.*) \|$", section[1], re.M) if section else []
    if not rows:
        raise ValueError(f"docs/architecture.md: expected a table under '## Floors of {package}', found none")
    return [(re.findall(r"`([\w./]+)`", names), content.replace("`", "")) for names, content in rows]


def picture(text: str) -> str:
    """Return the picture of both tables as SVG.

    Args:
        text: ``docs/architecture.md``.

    Raises:
        ValueError: a table is missing.
    """
    rows = {package: floors(package, text) for package in PACKAGES}
    bottom = _TOP + max(sum(_height(*row) + 8 for row in each) for each in rows.values())
    columns = [list(_column(package, rows[package], k * (_WIDTH + _GAP), bottom)) for k, package in enumerate(PACKAGES)]
    height = bottom + 32
    width = 2 * _WIDTH + _GAP
    drawn = "\n".join(element for column in columns for element in column)
    middle, y = _WIDTH + _GAP / 2, bottom - 60
    arrow = (
        f'<path d="M {middle + 24} {y} H {middle - 24} m 8 -5 l -8 5 l 8 5"/>'
        f'<text class="note" x="{middle}" y="{y - 10}" text-anchor="middle">imports</text>'
    )
    note = f'<text class="note" x="2" y="{height - 12}">Each room imports only rooms below its own.</text>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-2 0 {width + 4} {height}" role="img" '
        f'aria-label="Floors of mvpose and simharness, the lowest at the bottom">\n<style>{_STYLE}</style>\n'
        f"{drawn}\n{arrow}\n{note}\n</svg>\n"
    )


def _column(package: str, rows: list[tuple[list[str], str]], x: float, bottom: float) -> Iterator[str]:
    """Yield the elements of a column that stands on ``bottom``, px, from its top on."""
    y = bottom - sum(_height(*row) + 8 for row in rows)
    yield f'<text class="title" x="{x + 2}" y="{y - 24}">{package}</text>'
    for names, content in reversed(rows):
        height = _height(names, content)
        yield f'<rect class="{package}" x="{x}" y="{y}" width="{_WIDTH}" height="{height}" rx="6"/>'
        for k, (kind, line) in enumerate(_lines(names, content)):
            place = f'x="{x + 12}" y="{y + 20 + _LINE * k}"'
            yield f'<text class="{kind}" {place} xml:space="preserve">{escape(line)}</text>'
        y += height + 8


def _height(names: list[str], content: str) -> int:
    return 14 + _LINE * len(_lines(names, content))


def _lines(names: list[str], content: str) -> list[tuple[str, str]]:
    """Return the lines of a floor, each with its class."""
    titles = [("name", each) for each in wrap("   ".join(names), _LETTERS - 20)]
    return titles + [("note", each) for each in wrap(content, _LETTERS)]


def main() -> int:
    """Write the picture; return the exit code."""
    file = DOCS / "floors.svg"
    file.write_text(picture((DOCS / "architecture.md").read_text(encoding="utf-8")), encoding="utf-8")
    print(file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
