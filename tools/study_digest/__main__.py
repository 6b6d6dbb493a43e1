"""Write the digest of a finished study: ``python -m tools.study_digest results/studies/views results/views``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from simharness.study.study_folder import read_study
from tools.study_digest.digest import write_digest


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 2 where the study cannot be read or the folder cannot be written."""
    parser = argparse.ArgumentParser(prog="python -m tools.study_digest", description=__doc__)
    parser.add_argument("study", type=Path, help="result folder of the study")
    parser.add_argument("folder", type=Path, help="folder of digest.json, table.md and curves.svg")
    options = parser.parse_args(arguments)
    try:
        write_digest(read_study(options.study), options.folder)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"digest: {options.folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
