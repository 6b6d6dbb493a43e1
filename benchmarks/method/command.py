"""Command line of a benchmark with sections; each section is a module that measures and formats a table."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from benchmarks.method.measure import machine, versions
from benchmarks.method.report import encodable

_TITLES = {"python": "Python", "numpy": "NumPy", "scipy": "SciPy"}


class Section(Protocol):
    """Interface of a benchmark section, a module."""

    __doc__: str | None

    def measure(self, *, quick: bool = False) -> list[Any]:
        """Measure and return the rows of the result, dataclasses of plain numbers and text."""
        ...

    def table_of(self, rows: list[Any], /) -> str:
        """Format the rows as text."""
        ...


def run(package: str, about: str, sections: Mapping[str, Section], arguments: Sequence[str] | None = None) -> int:
    """Run the requested sections and return exit code 0, even if a target is missed.

    Args:
        package: name of the benchmark package, for example "benchmarks.method".
        about: one-line description for ``--help``.
        sections: sections by name, in order.
        arguments: command line arguments; by default those of the process.
    """
    options = _parser(package, about, sections).parse_args(arguments)
    hardware, software, start = machine(), versions(), time.perf_counter()
    title = f"{hardware.cpu}, {hardware.cores} cores\n" + ", ".join(
        f"{_TITLES.get(name, name)} {number}" for name, number in software.items()
    )
    warning = " · quick: do not quote these figures" if options.quick else ""
    _print(f"{package} benchmark · ✓ target met, ✗ missed{warning}\n{title}")
    measured: dict[str, Any] = {}
    for name in options.only or sections:
        section = sections[name]
        rows = section.measure(quick=options.quick)
        measured[name] = [asdict(row) for row in rows]
        _print(f"\n\n{name.upper()}: {(section.__doc__ or '').splitlines()[0].rstrip('.')}\n\n{section.table_of(rows)}")
    if options.json:
        results = {
            "command": _command(package, options),
            "machine": asdict(hardware),
            "versions": software,
            "seconds": round(time.perf_counter() - start, 1),
            "quick": options.quick,
            **measured,
        }
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n")
    return 0


def _command(package: str, options: argparse.Namespace) -> str:
    """Return the command line without the folder of the file, so that it holds on any machine."""
    only = ["--only", *options.only] if options.only else []
    quick = ["--quick"] if options.quick else []
    return shlex.join(["python", "-m", package, *only, *quick, "--json", options.json.name])


def _parser(package: str, about: str, sections: Mapping[str, Section]) -> argparse.ArgumentParser:
    listed = "\n".join(f"  {name:10} {(module.__doc__ or '').splitlines()[0]}" for name, module in sections.items())
    parser = argparse.ArgumentParser(
        prog=f"python -m {package}",
        description=f"{about} Sections:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", choices=sections, metavar="NAME", help="run these sections only")
    parser.add_argument("--quick", action="store_true", help="time few, small frames, to check that the benchmark runs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to a file")
    return parser


def _print(text: str) -> None:
    print(encodable(text, sys.stdout.encoding), flush=True)
