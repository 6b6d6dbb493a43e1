"""Search for failures: ``python -m benchmarks.hunt benchmarks/hunt/room.toml FOLDER --trials 96``.

Runs trials at values of the keys of a search file (:mod:`benchmarks.hunt.search_file`), each with another scene, and
checks every frame. A failure counts if the same person fails in the same way with most of five fresh draws of the
detector's errors, with the same people, motion and cameras. Distinct are failures that differ in property, stage to
blame, or bin of a circumstance. Printed for each property and stage: in how many trials it fails, how many distinct
failures there are, and with how many draws the most reliable one fails again; that one is shrunk, and kept in the
folder ``failures`` of FOLDER. The same command continues an interrupted search. The same seed gives the same trials,
with any number of workers.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.hunt.hunt_run import Hunt, HuntedPoint, distinct, run_hunt
from benchmarks.hunt.hunted_trial import NOISES
from benchmarks.hunt.search_file import read_search
from benchmarks.hunt.search_methods import METHODS
from mvpose.commands.progress import reporter
from simharness.cli.score_tables import ScoreTable
from simharness.hunt.kept_failure import KeptFailure, check_alone
from simharness.hunt.properties import properties_of
from simharness.outputs.hunt.page import write_failures_page
from simharness.trial.run_trial import with_variants


def main(arguments: Sequence[str] | None = None) -> int:
    """Search, keep what was found, and print it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hunt", description=__doc__)
    parser.add_argument("search", type=Path, help="search file")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--trials", type=_count, help="default: until --minutes are over")
    parser.add_argument("--minutes", type=float, help="time of the search; default: 30 without --trials")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--method", choices=METHODS, default="map-elites", help="map-elites needs the extra bench")
    parser.add_argument("--workers", type=_count, default=1)
    parser.add_argument("--keep", type=int, default=10, help="largest number of kept failures")
    parser.add_argument("--variant", help="default: the first of the scenario")
    parser.add_argument("--property", nargs="+", help="what must not fail; default: most")
    parser.add_argument("--rival", help="variant that should agree, for the property disagree")
    options = parser.parse_args(arguments)
    minutes = 30.0 if options.minutes is None and options.trials is None else options.minutes
    try:
        wanted = properties_of(options.property, options.rival)
        search = read_search(options.search)
        chosen = options.variant or search.base.method.variants[0]
        check_alone(with_variants(search.base, [chosen]))
        names = (chosen, options.rival) if options.rival else (chosen,)
        hunted = Hunt(search, names, wanted, options.method, options.seed, options.trials)
        with reporter() as bars:
            points, kept = run_hunt(
                hunted,
                options.folder,
                seconds=None if minutes is None else 60 * minutes,
                keep_most=options.keep,
                workers=options.workers,
                reporter=bars,
            )
    except ValueError as error:
        parser.error(str(error))
    _print(points, kept, Console(), f"{search.base.name}, {chosen}, {options.method}")
    if kept:
        print(f"page: {write_failures_page(options.folder / 'failures')}")
    return 0


def _count(text: str) -> int:
    """Return a number of at least 1.

    Raises:
        ValueError: it is none.
    """
    if (number := int(text)) < 1:
        raise ValueError(text)
    return number


def _print(points: list[HuntedPoint], kept: list[KeptFailure], console: Console, what: str) -> None:
    """Print the kinds of failures with their numbers, and what each kept one is."""
    cells = distinct(points, lambda each: each.cell)
    rows = []
    for (name, stage), (_, best) in sorted(distinct(points, lambda each: each.cell[:2]).items()):
        alike = sum(cell[:2] == (name, stage) for cell in cells)
        robust = ({each.cell[:2] for each in point.findings if each.robust} for point in points)
        trials = sum((name, stage) in each for each in robust)
        rows.append((name, stage or "–", str(trials), str(alike), f"{best.failed} of {NOISES}"))
    failed = sum(bool(point.error) for point in points)
    lost = f", {failed} of which could not be run" if failed else ""
    console.print(f"{what}: {len(cells)} distinct failures in {len(points)} trials{lost}", highlight=False)
    headings = ("trials", "distinct", "fails with\nfresh noise")
    ScoreTable("", ("property", "stage"), headings, rows).print_to(console)
    for each in kept:
        console.print(f"{each.name}: {each.text}", soft_wrap=True, highlight=False, markup=False)


if __name__ == "__main__":
    raise SystemExit(main())
