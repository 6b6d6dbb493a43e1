"""The command line of the benchmark; ``--help`` says what there is."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from mvpose.bench import curve, hard, memory, stages, start
from mvpose.bench.measure import machine
from mvpose.bench.report import encodable


class Section(Protocol):
    """What a module of this package offers."""

    __doc__: str | None

    def measure(self, *, quick: bool = False) -> list[Any]:
        """Rows of the result, dataclasses of plain numbers and text."""
        ...

    def table_of(self, rows: list[Any], /) -> str:
        """Their text."""
        ...


SECTIONS: dict[str, Section] = {"stages": stages, "hard": hard, "curve": curve, "memory": memory, "start": start}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the sections asked for; 0 whatever the figures are: this measures and does not judge."""
    options = _parser().parse_args(arguments)
    here = machine()
    title = f"{here.cpu}, {here.cores} cores, one used · Python {here.python}, NumPy {here.numpy}, numba {here.numba}"
    warning = " · quick: these figures are not to be quoted" if options.quick else ""
    _say(f"mvpose benchmark · ✓ target met, ✗ missed{warning}\n{title}")
    results: dict[str, Any] = {"machine": asdict(here), "quick": options.quick}
    for name in options.only or SECTIONS:
        section = SECTIONS[name]
        rows = section.measure(quick=options.quick)
        results[name] = [asdict(row) for row in rows]
        _say(f"\n\n{name.upper()}: {(section.__doc__ or '').splitlines()[0].rstrip('.')}\n\n{section.table_of(rows)}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    sections = "\n".join(f"  {name:8} {(module.__doc__ or '').splitlines()[0]}" for name, module in SECTIONS.items())
    parser = argparse.ArgumentParser(
        prog="python -m mvpose.bench",
        description=f"What mvpose costs on one core, on synthetic scenes. Sections:\n{sections}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", choices=SECTIONS, metavar="NAME", help="these sections")
    parser.add_argument("--quick", action="store_true", help="few, small frames: to see that it runs, not to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a file as well")
    return parser


def _say(text: str) -> None:
    print(encodable(text, sys.stdout.encoding), flush=True)


if __name__ == "__main__":
    sys.exit(main())
