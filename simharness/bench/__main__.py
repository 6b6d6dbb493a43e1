"""The command line of the benchmark; ``--help`` says what there is."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mvpose.bench.measure import machine
from mvpose.bench.report import encodable

SECTIONS = ("rendering", "simulation")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the sections asked for; 0 whatever the figures are: this measures and does not judge."""
    options = _parser().parse_args(arguments)
    here = machine()
    title = f"{here.cpu}, {here.cores} cores · Python {here.python}, NumPy {here.numpy}, numba {here.numba}"
    warning = " · quick: these figures are not to be quoted" if options.quick else ""
    _say(f"simharness benchmark · ✓ target met, ✗ missed{warning}\n{title}")
    results: dict[str, Any] = {"machine": asdict(here), "quick": options.quick}
    for name in options.sections or SECTIONS:
        section = importlib.import_module(f"simharness.bench.{name}")
        rows = section.measure(quick=options.quick)
        results[name] = [asdict(row) for row in rows]
        _say(f"\n\n{name.upper()}: {(section.__doc__ or '').splitlines()[0].rstrip('.')}\n\n{section.table_of(rows)}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=2, allow_nan=False) + "\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m simharness.bench", description="What simharness costs.")
    parser.add_argument("sections", nargs="*", type=_section, metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument("--quick", action="store_true", help="few frames: to see that it runs, not to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a file as well")
    return parser


def _section(name: str) -> str:
    if name not in SECTIONS:
        raise argparse.ArgumentTypeError(f"no section {name!r}; there are {', '.join(SECTIONS)}")
    return name


def _say(text: str) -> None:
    print(encodable(text, sys.stdout.encoding), flush=True)


if __name__ == "__main__":
    sys.exit(main())
