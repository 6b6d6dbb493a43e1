"""The command line of the benchmark; ``--help`` says what there is."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from benchmarks.method.command import Section, run
from benchmarks.simulator import rendering, simulation

SECTIONS: dict[str, Section] = {"rendering": rendering, "simulation": simulation}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the sections asked for: see :func:`benchmarks.method.command.run`."""
    return run("benchmarks.simulator", "What simulation and pictures cost.", SECTIONS, arguments)


if __name__ == "__main__":
    sys.exit(main())
