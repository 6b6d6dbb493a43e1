"""Write tables 1 and 2 of the paper: ``python -m tools.paper_tables --shelf FILE ... --out FOLDER``."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from tools.paper_tables.tables import INPUTS, paper_tables, read_inputs, write_tables


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 2 where an input is bad or the folder cannot be written."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(
        prog="python -m tools.paper_tables",
        description="Write tables 1 and 2 of the paper three ways: as printed, on real Shelf, and on simulated twins.",
    )
    for key, wanted in INPUTS.items():
        parser.add_argument(
            wanted.option,
            dest=key,
            type=Path,
            required=True,
            metavar="FILE",
            help=f"{wanted.contents}, all variants of table 2; written by {wanted.command} --json",
        )
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder of tables.md and tables.json")
    options = parser.parse_args(words)
    files = {key: getattr(options, key) for key in INPUTS}
    try:
        command = shlex.join(["python", "-m", "tools.paper_tables", *words])
        write_tables(paper_tables(read_inputs(files), command=command), options.out)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"tables: {options.out / 'tables.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
