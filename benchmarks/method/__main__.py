"""Command line of the benchmark of the method; see ``--help``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from benchmarks.method import curve, hard, memory, published, reid, stages, start
from benchmarks.method.command import Section, run

SECTIONS: dict[str, Section] = {
    "stages": stages,
    "published": published,
    "reid": reid,
    "hard": hard,
    "curve": curve,
    "memory": memory,
    "start": start,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested sections; see :func:`benchmarks.method.command.run`."""
    return run("benchmarks.method", "Running time of mvpose on one core, on synthetic scenes.", SECTIONS, arguments)


if __name__ == "__main__":
    sys.exit(main())
