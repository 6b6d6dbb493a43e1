"""Command line of the benchmark of the tracker; see ``--help``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from benchmarks.method.command import Section, run
from benchmarks.tracking import cost, endurance
from benchmarks.tracking.shelf import Shelf

SECTIONS: dict[str, Section] = {"cost": cost, "endurance": endurance}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested sections; see :func:`benchmarks.method.command.run`."""
    return run(
        "benchmarks.tracking",
        "The tracker on synthetic streams, on one core, and on a recording.",
        SECTIONS,
        arguments,
        recorded={"shelf": Shelf},
    )


if __name__ == "__main__":
    sys.exit(main())
