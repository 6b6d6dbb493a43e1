"""Command line of the planted bugs; see ``--help``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.planted_bugs import report
from benchmarks.planted_bugs.catalogue import Bug, read_catalogue, unplantable
from benchmarks.planted_bugs.checkout import ROOT, digest_of_checkout
from benchmarks.planted_bugs.hunting import HUNTED
from benchmarks.planted_bugs.records import Records
from benchmarks.planted_bugs.work import Bench


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        0; 1 if more than two bugs with a real effect were missed by all that was run, or a clean run was red; 2 for
        bad input, such as a bug that no longer applies.
    """
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


_MISSED = 2  # bugs with a real effect that may go unnoticed


def _run(options: argparse.Namespace) -> int:
    catalogue = read_catalogue()
    if unknown := set(options.only or ()) - catalogue.keys():
        raise ValueError(f"--only: no bug {', '.join(sorted(unknown))}; --list names them")
    chosen = options.only or (HUNTED if options.by == "hunt" else ())
    bugs = [bug for bug in catalogue.values() if not chosen or bug.id in chosen]
    if messages := unplantable({bug.id: bug for bug in bugs}, ROOT):
        raise ValueError("\n".join(messages))
    if options.list:
        print("\n".join(f"{bug.id:32} {bug.effect:10} {bug.breaks}" for bug in bugs))
        return 0
    if options.folder is None:
        raise ValueError("expected a folder for copies and results")
    records = Records(options.folder / "records.jsonl", digest_of_checkout())
    bench = Bench(options.folder, records, workers=options.workers, limit=options.limit)
    if options.clean_runs:
        return _clean_runs(bench, options.clean_runs)
    gate = bench.gate(bugs) if options.by in ("both", "gate") else {}
    tests = bench.tests(bugs) if options.by in ("both", "tests") else {}
    hunts = bench.hunts(bugs) if options.by == "hunt" else {}
    effects = bench.effects(_with_scores(bugs), seeds=options.seeds) if options.effects else {}
    results = report.rows(bugs, gate, tests, effects, hunts)
    print(f"{report.table(results)}\n\n{report.totals(results)}")
    missed = [row for row in results if row.bug.effect == "real" and not row.caught]
    return int(options.by != "none" and len(missed) > _MISSED)


def _clean_runs(bench: Bench, count: int) -> int:
    runs = bench.clean_runs(count)
    red = {name: each.what for name, each in runs.items() if each.caught}
    print(f"{len(red)} false alarms in {len(runs)} clean runs")
    print("\n".join(f"{name}: {what}" for name, what in red.items()))
    return int(bool(red))


def _with_scores(bugs: Sequence[Bug]) -> list[Bug]:
    """Return the bugs whose effect can be measured by scores."""
    return [bug for bug in bugs if bug.effect != "outside"]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planted_bugs", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="folder for copies, kernels, simulations and results")
    parser.add_argument(
        "--by", choices=("both", "gate", "tests", "hunt", "none"), default="both", help="what has to notice"
    )
    parser.add_argument("--only", nargs="+", metavar="ID", help="some bugs only")
    parser.add_argument("--list", action="store_true", help="check that the bugs apply to the code, and list them")
    parser.add_argument("--effects", action="store_true", help="measure effects on scores with fresh seeds")
    parser.add_argument("--seeds", type=int, default=60, metavar="N", help="fresh seeds of --effects (default: 60)")
    parser.add_argument("--clean-runs", type=int, metavar="N", help="count false alarms in N runs without bugs")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="bugs at a time (default: 2)")
    parser.add_argument("--limit", type=float, default=600.0, metavar="S", help="seconds of one run (default: 600)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
