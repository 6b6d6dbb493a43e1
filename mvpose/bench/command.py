"""The command line of a benchmark made of sections, each a module that measures and makes a table."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from mvpose.bench.measure import machine
from mvpose.bench.report import encodable


class Section(Protocol):
    """What a module of a benchmark offers."""

    __doc__: str | None

    def measure(self, *, quick: bool = False) -> list[Any]:
        """Rows of the result, dataclasses of plain numbers and text."""
        ...

    def table_of(self, rows: list[Any], /) -> str:
        """Their text."""
        ...


def run(package: str, about: str, sections: Mapping[str, Section], arguments: Sequence[str] | None = None) -> int:
    """Run the sections asked for; 0 whatever the figures are: this measures and does not judge.

    Args:
        package: what is measured, "mvpose".
        about: what the sections say, for ``--help``.
        sections: by name, in their order.
        arguments: of the command line; by default the process's.
    """
    options = _parser(package, about, sections).parse_args(arguments)
    here = machine()
    title = f"{here.cpu}, {here.cores} cores · Python {here.python}, NumPy {here.numpy}, numba {here.numba}"
    warning = " · quick: these figures are not to be quoted" if options.quick else ""
    _say(f"{package} benchmark · ✓ target met, ✗ missed{warning}\n{title}")
    results: dict[str, Any] = {"machine": asdict(here), "quick": options.quick}
    for name in options.only or sections:
        section = sections[name]
        rows = section.measure(quick=options.quick)
        results[name] = [asdict(row) for row in rows]
        _say(f"\n\n{name.upper()}: {(section.__doc__ or '').splitlines()[0].rstrip('.')}\n\n{section.table_of(rows)}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n")
    return 0


def _parser(package: str, about: str, sections: Mapping[str, Section]) -> argparse.ArgumentParser:
    listed = "\n".join(f"  {name:10} {(module.__doc__ or '').splitlines()[0]}" for name, module in sections.items())
    parser = argparse.ArgumentParser(
        prog=f"python -m {package}.bench",
        description=f"{about} Sections:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", choices=sections, metavar="NAME", help="these sections")
    parser.add_argument("--quick", action="store_true", help="few, small frames: to see that it runs, not to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a file as well")
    return parser


def _say(text: str) -> None:
    print(encodable(text, sys.stdout.encoding), flush=True)
