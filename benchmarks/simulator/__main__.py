"""Command line of the benchmark of the simulator; see ``--help``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from benchmarks.method.command import Section, run
from benchmarks.simulator import rendering, simulation

SECTIONS: dict[str, Section] = {"rendering": rendering, "simulation": simulation}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested sections; see :func:`benchmarks.method.command.run`."""
    return run("benchmarks.simulator", "Running time of simulation and rendering.", SECTIONS, arguments)


if __name__ == "__main__":
    sys.exit(main())
