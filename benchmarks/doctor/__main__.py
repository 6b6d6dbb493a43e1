"""Benchmark of the doctor.

    python -m benchmarks.doctor --prepare recordings.npz --shelf FOLDER     # needs simharness
    python -m benchmarks.doctor --from recordings.npz --trials trials.jsonl --workers 16 --out results/doctor

The first command simulates the recordings and reads real Shelf; the second needs mvpose, NumPy and SciPy only
(and ``mvpose[recordings]`` for ``--out``). Trials that are in the file already are not run again. Tables are printed
and written to the folder.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.doctor.experiments import EXPERIMENTS, trials
from benchmarks.doctor.recordings import Recordings, write
from benchmarks.doctor.report import print_report, write_report
from benchmarks.doctor.runner import read_results, run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark and return the exit code: 0, or 1 if a trial failed."""
    options = _parser().parse_args(arguments)
    if options.prepare is not None:
        from benchmarks.doctor.prepare import recordings

        write(options.prepare, recordings(options.shelf, some=options.some))
    failed = 0
    if options.recordings is not None:
        try:
            keys = list(trials(Recordings(options.recordings), options.seeds))
        except ValueError as error:
            print(error, file=sys.stderr)
            return 2
        chosen = [key for key in keys if key.experiment in (options.only or EXPERIMENTS)]
        failed = run(options.recordings, chosen, options.trials, workers=options.workers)
    if options.trials.is_file():
        results = read_results(options.trials)
        print_report(results)
        if options.out is not None:
            from benchmarks.doctor.confusion_page import write_page  # needs the extra mvpose[recordings]

            write_report(results, options.out)
            write_page(options.out)
    return int(failed > 0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.doctor", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--prepare", type=Path, metavar="FILE.npz", help="make the recordings and write them here")
    parser.add_argument("--shelf", type=Path, metavar="FOLDER", help="with --prepare: folder of real Shelf")
    parser.add_argument("--some", type=int, metavar="N", help="with --prepare: most recordings of a kind")
    parser.add_argument("--from", dest="recordings", type=Path, metavar="FILE.npz", help="measure on these recordings")
    parser.add_argument("--trials", type=Path, default=Path("doctor-trials.jsonl"), help="results, one trial a line")
    parser.add_argument("--only", nargs="+", choices=EXPERIMENTS, help="experiments; by default all")
    parser.add_argument("--seeds", type=int, metavar="N", help="draws of each case, instead of those of the benchmark")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help="write tables here: doctor.json, doctor.md, confusion.html"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
