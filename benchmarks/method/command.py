"""The command line of a benchmark made of sections, each a module that measures and makes a table."""

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
    here, software, begin = machine(), versions(), time.perf_counter()
    title = f"{here.cpu}, {here.cores} cores\n" + ", ".join(
        f"{_TITLES.get(name, name)} {number}" for name, number in software.items()
    )
    warning = " · quick: these figures are not to be quoted" if options.quick else ""
    _say(f"{package} benchmark · ✓ target met, ✗ missed{warning}\n{title}")
    measured: dict[str, Any] = {}
    for name in options.only or sections:
        section = sections[name]
        rows = section.measure(quick=options.quick)
        measured[name] = [asdict(row) for row in rows]
        _say(f"\n\n{name.upper()}: {(section.__doc__ or '').splitlines()[0].rstrip('.')}\n\n{section.table_of(rows)}")
    if options.json:
        results = {
            "command": _command(package, options),
            "machine": asdict(here),
            "versions": software,
            "seconds": round(time.perf_counter() - begin, 1),
            "quick": options.quick,
            **measured,
        }
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n")
    return 0


def _command(package: str, options: argparse.Namespace) -> str:
    """What was asked for, on any machine: of the file only the name."""
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
    parser.add_argument("--only", nargs="+", choices=sections, metavar="NAME", help="these sections")
    parser.add_argument("--quick", action="store_true", help="few, small frames: to see that it runs, not to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a file as well")
    return parser


def _say(text: str) -> None:
    print(encodable(text, sys.stdout.encoding), flush=True)
