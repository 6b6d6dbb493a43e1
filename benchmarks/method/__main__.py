"""The command line of the benchmark; ``--help`` says what there is."""

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
    """Run the sections asked for: see :func:`benchmarks.method.command.run`."""
    return run("benchmarks.method", "What mvpose costs on one core, on synthetic scenes.", SECTIONS, arguments)


if __name__ == "__main__":
    sys.exit(main())
