"""Command line of a benchmark with sections; each section is a module that measures and formats a table."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from benchmarks.method.measure import machine, versions
from benchmarks.method.report import encodable

_NONE: Mapping[str, Any] = MappingProxyType({})
_TITLES = {"python": "Python", "numpy": "NumPy", "scipy": "SciPy"}


class Section(Protocol):
    """Interface of a benchmark section, a module or an object of a class."""

    __doc__: str | None

    def measure(self, *, quick: bool = False) -> list[Any]:
        """Measure and return the rows of the result, dataclasses of plain numbers and text."""
        ...

    def table_of(self, rows: list[Any], /) -> str:
        """Format the rows as text."""
        ...


def run(
    package: str,
    about: str,
    sections: Mapping[str, Section],
    arguments: Sequence[str] | None = None,
    *,
    recorded: Mapping[str, Callable[[Path], Section]] = _NONE,
) -> int:
    """Run the requested sections and return exit code 0, even if a target is missed.

    Args:
        package: name of the benchmark package, for example "benchmarks.method".
        about: one-line description for ``--help``.
        sections: sections by name, in order.
        arguments: command line arguments; by default those of the process.
        recorded: sections that need a folder of recorded data, by name. ``--NAME FOLDER`` runs one of them, and of the
            others those of ``--only``.
    """
    options = _parser(package, about, sections, recorded).parse_args(arguments)
    given = {name: make(getattr(options, name)) for name, make in recorded.items() if getattr(options, name)}
    chosen = options.only or ([] if given else list(sections))
    sections = {name: section for name, section in sections.items() if name in chosen} | given
    hardware, software, start = machine(), versions(), time.perf_counter()
    title = f"{hardware.cpu}, {hardware.cores} cores\n" + ", ".join(
        f"{_TITLES.get(name, name)} {number}" for name, number in software.items()
    )
    warning = " · quick: do not quote these figures" if options.quick else ""
    _print(f"{package} benchmark · ✓ target met, ✗ missed{warning}\n{title}")
    measured: dict[str, Any] = {}
    for name, section in sections.items():
        rows = section.measure(quick=options.quick)
        measured[name] = [asdict(row) for row in rows]
        _print(f"\n\n{name.upper()}: {(section.__doc__ or '').splitlines()[0].rstrip('.')}\n\n{section.table_of(rows)}")
    if options.json:
        results = {
            "command": _command(package, options, given),
            "machine": asdict(hardware),
            "versions": software,
            "seconds": round(time.perf_counter() - start, 1),
            "quick": options.quick,
            **measured,
        }
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n")
    return 0


def _command(package: str, options: argparse.Namespace, given: Iterable[str]) -> str:
    """Return the command line without folders, so that it holds on any machine."""
    folders = [word for name in given for word in (f"--{name}", getattr(options, name).name)]
    only = ["--only", *options.only] if options.only else []
    quick = ["--quick"] if options.quick else []
    return shlex.join(["python", "-m", package, *folders, *only, *quick, "--json", options.json.name])


def _parser(
    package: str, about: str, sections: Mapping[str, Section], recorded: Mapping[str, Callable[[Path], Section]]
) -> argparse.ArgumentParser:
    listed = "\n".join(f"  {name:10} {(module.__doc__ or '').splitlines()[0]}" for name, module in sections.items())
    parser = argparse.ArgumentParser(
        prog=f"python -m {package}",
        description=f"{about} Sections:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", choices=sections, metavar="NAME", help="run these sections only")
    for name, make in recorded.items():
        parser.add_argument(f"--{name}", type=Path, metavar="FOLDER", help=(make.__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="time few, small frames, to check that the benchmark runs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to a file")
    return parser


def _print(text: str) -> None:
    print(encodable(text, sys.stdout.encoding), flush=True)
