"""Leaderboard: ``python -m benchmarks.leaderboard FOLDER --shelf SHELF``.

Runs the methods of :mod:`benchmarks.leaderboard.entries` in the studies ``conditions.toml``, ``views.toml`` and
``rigs.toml`` of this folder, and on the recording Shelf where its files are given, prints a table of each, and writes
into FOLDER the page ``leaderboard.html`` and a CSV file for each part. The part of rigs stands beside what papers on
learned methods publish (``published_rigs.toml``). Trials and methods that are finished are kept in FOLDER: the same
command continues an interrupted run. Methods whose packages are not installed are left out, with the reason.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.leaderboard.entries import Entry, chosen
from benchmarks.leaderboard.figures import RIG_SCORES, Figure, rig_changes, study_figures, write_csv
from benchmarks.leaderboard.page import TITLES, render, rig_rows, text_rows
from benchmarks.leaderboard.shelf import NAME, evaluated
from mvpose.commands.progress import reporter
from mvpose.files.atomic_files import write_atomic
from simharness.cli.score_tables import ScoreTable
from simharness.reality.recording_file import read_recording
from simharness.scenario.load import load_study
from simharness.study.study_run import run_study

STUDIES = {"conditions": "case", "views": "cameras.count", "rigs": "cameras.preset"}
"""Studies of this folder, each with the column that tells its settings apart."""

PAGE = "leaderboard.html"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the leaderboard, print its tables and write its page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.leaderboard", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--shelf", type=Path, help="folder of the files of Shelf; without it Shelf is left out")
    parser.add_argument(
        "--only", nargs="+", choices=(*STUDIES, NAME), default=(*STUDIES, NAME), help="default: all parts"
    )
    parser.add_argument("--method", nargs="+", help="default: all methods; one of mvpose's at least")
    parser.add_argument("--seeds", type=int, help="default: those of the studies")
    parser.add_argument("--set", nargs="+", default=(), help="overrides of keys of the studies, KEY=VALUE")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args(arguments)
    try:
        entries, skipped = chosen(options.method)
        parts: dict[str, list[Figure]] = {}
        for name in STUDIES:
            if name in options.only:
                parts[name] = _study(name, entries, options)
        if NAME in options.only:
            if options.shelf is None:
                skipped["real Shelf"] = "its files were not given: --shelf FOLDER"
            else:
                with reporter() as bars, bars.stage(NAME, len(entries)) as advance:
                    recording = read_recording(NAME, options.shelf)
                    parts[NAME] = evaluated(recording, entries, options.folder / NAME, advance)
    except ValueError as error:
        parser.error(str(error))
    write(parts, entries, skipped, options.folder)
    return 0


def write(parts: dict[str, list[Figure]], entries: Sequence[Entry], skipped: dict[str, str], folder: Path) -> None:
    """Print the tables of all parts, and write the CSV files and the page."""
    console = Console()
    headings = ("PCP\n%", "minus best\nof mvpose", "precision\n%", "recall\n%", "MPJPE\nmm", "ms\nper frame")
    for name, figures in parts.items():
        ScoreTable(TITLES[name], ("method",), headings, text_rows(figures, entries)).print_to(console)
        if name == "rigs":
            columns = ("AP25\n%", "mAP\n%", "MPJPE\nmm", "mAP minus\nthat of cmu0", "MPJPE minus\nthat of cmu0")
            ScoreTable("Other rigs, the best of mvpose", ("rig",), columns, rig_rows(figures, entries)).print_to(
                console
            )
        write_csv(figures, folder / f"{name}.csv")
    for name, why in skipped.items():
        console.print(f"left out: {name}, because {why}", soft_wrap=True, highlight=False, markup=False)
    write_atomic(folder / PAGE, render(parts, entries, skipped).encode())
    console.print(f"page: {folder / PAGE}", soft_wrap=True, highlight=False, markup=False)


def _study(name: str, entries: Sequence[Entry], options: argparse.Namespace) -> list[Figure]:
    """Run one of the studies, and return its figures."""
    study = load_study(
        Path(__file__).parent / f"{name}.toml",
        overrides=options.set,
        seeds=options.seeds,
        variants=[entry.name for entry in entries],
    )
    with reporter() as bars:
        results = run_study(study, out=options.folder, workers=options.workers, reporter=bars)
    for each in results.info["failed"]:
        print(f"failed: {name}, {each['case']} seed {each['seed']}: {each['error']}")
    if name != "rigs":
        return study_figures(results.trials, entries, STUDIES[name])
    figures = study_figures(results.trials, entries, STUDIES[name], RIG_SCORES)
    return figures + rig_changes(results.trials, entries, STUDIES[name])


if __name__ == "__main__":
    raise SystemExit(main())
