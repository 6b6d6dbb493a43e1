"""Print the tables."""

from __future__ import annotations

import argparse

from benchmarks.coverage.tables import breaking_points, counts, differences, means


def main() -> None:
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.coverage", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=1000, metavar="N", help="samples of each population")
    repetitions = parser.parse_args().repetitions
    for title, table in (
        ("95 % intervals of means: coverage in percent, width in that of Student's, by number of scenes", means),
        ("Rejected means of zero at level 5 %, one-sided, percent, by number of scenes", differences),
        ("Rejected equal rates at level 5 %, one-sided, percent, by number of scenes", counts),
        ("Breaking points: median, coverage in percent, width of intervals, by number of scenes", breaking_points),
    ):
        print(f"\n{title}\n\n{table(repetitions)}", flush=True)


main()
