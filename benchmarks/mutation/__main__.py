"""Command line of the mutation testing; see ``--help``."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.mutation.near import near_tests
from benchmarks.mutation.operators import Mutation, sample
from benchmarks.planted_bugs.catalogue import Bug
from benchmarks.planted_bugs.checkout import ROOT
from benchmarks.planted_bugs.records import Outcome, Records
from benchmarks.planted_bugs.work import Bench

PACKAGES = (
    "mvpose/affinity", "mvpose/matching", "mvpose/reconstruction", "mvpose/tracking", "mvpose/calibration",
    "simharness/detector", "simharness/scoring", "simharness/statistics",
)  # fmt: skip
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
_ENOUGH = 0.9  # share of the mutants that change a correct result


@dataclass(frozen=True)
class Mutant:
    """Mutant of one file.

    Attributes:
        package: package of the sample that it belongs to.
        file: file that it changes, relative to the checkout.
        mutation: the change.
        described: the change, on one line.
        bug: the change as a bug to be planted.
    """

    package: str
    file: str
    mutation: Mutation
    described: str
    bug: Bug


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        0; 1 if fewer than 90 % of the mutants of a package that are not equivalent were killed; 2 for bad input.
    """
    options = _parser().parse_args(arguments)
    if unknown := [each for each in options.packages if not (ROOT / each).is_dir()]:
        print(f"error: --packages: no folder {', '.join(unknown)}", file=sys.stderr)
        return 2
    mutants = [each for package in options.packages for each in mutants_of(package, options.sample, options.seed)]
    if options.list:
        print("\n".join(f"{each.bug.id} {each.file} {each.described}" for each in mutants))
        return 0
    # A mutant that tests killed is known for as long as its file stays; new tests may kill survivors.
    records = Records(options.folder / "records.jsonl", "")
    for each in mutants:
        outcome = records.outcome("tests", each.bug.id, each.bug.digest)
        if outcome is not None and not outcome.caught:
            records.forget("tests", each.bug.id, each.bug.digest)
    bench = Bench(options.folder, records, workers=options.workers, limit=options.limit)
    outcomes = bench.tests([each.bug for each in mutants])
    equivalent = read_equivalent()
    print(table(mutants, outcomes, equivalent))
    shares = [killed / max(count, 1) for killed, count in scores(mutants, outcomes, equivalent).values()]
    return int(min(shares) < _ENOUGH)


def mutants_of(package: str, count: int, seed: int) -> list[Mutant]:
    """Return a sample of the mutants of a package."""
    files = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in (ROOT / package).rglob("*.py")
    }
    result = []
    for file, mutation in sample(files, count, seed=seed):
        described = mutation.described(files[file])
        name = f"{Path(file).stem}-{mutation.line}-{mutation.rank(file, 0)[:6]}"
        # The edit of a bug is found by its text, so it takes the whole file.
        edit = ((files[file], mutation.applied(files[file])),)
        bug = Bug(name, file, edit, described, near_tests(file), "outside", why="mutant")
        result.append(Mutant(package, file, mutation, described, bug))
    return result


def read_equivalent(path: Path = EQUIVALENT) -> dict[tuple[str, str], str]:
    """Return the reason why a mutant changes no correct result, by its file and its place and text."""
    entries = tomllib.loads(path.read_text(encoding="utf-8")).get("mutant", [])
    return {(entry["file"], entry["change"]): entry["why"] for entry in entries}


def scores(
    mutants: Sequence[Mutant], outcomes: Mapping[str, Outcome], equivalent: Mapping[tuple[str, str], str]
) -> dict[str, tuple[int, int]]:
    """Return the number of mutants of each package that were killed, and of those that are not equivalent."""
    counts: dict[str, tuple[int, int]] = defaultdict(lambda: (0, 0))
    for each in mutants:
        if _key(each) not in equivalent:
            killed, count = counts[each.package]
            counts[each.package] = killed + outcomes[each.bug.id].caught, count + 1
    return dict(counts)


def table(mutants: Sequence[Mutant], outcomes: Mapping[str, Outcome], equivalent: Mapping[tuple[str, str], str]) -> str:
    """Return the scores of all packages and the survivors as Markdown."""
    lines = ["| package | mutants | equivalent | killed | score |", "|:--|--:|--:|--:|--:|"]
    for package, (killed, count) in scores(mutants, outcomes, equivalent).items():
        alike = sum(each.package == package for each in mutants) - count
        lines.append(f"| `{package}` | {count + alike} | {alike} | {killed} | {100 * killed / max(count, 1):.0f} % |")
    lines += ["", "| survivor | change | equivalent because |", "|:--|:--|:--|"]
    for each in sorted(mutants, key=lambda each: (each.file, each.mutation)):
        outcome = outcomes[each.bug.id]
        if not outcome.caught:
            why = equivalent.get(_key(each), outcome.what)
            lines.append(f"| `{each.file}` | {each.described.replace('|', chr(92) + '|')} | {why} |")
    return "\n".join(lines)


def _key(mutant: Mutant) -> tuple[str, str]:
    return mutant.file, mutant.described.partition(", ")[2]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutation", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder for copies, kernels and results")
    parser.add_argument("--packages", nargs="+", default=list(PACKAGES), metavar="FOLDER", help="packages to mutate")
    parser.add_argument("--sample", type=int, default=20, metavar="N", help="mutants of each package (default: 20)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the sample (default: 0)")
    parser.add_argument("--list", action="store_true", help="print the sample, run nothing")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="mutants at a time (default: 2)")
    parser.add_argument("--limit", type=float, default=300.0, metavar="S", help="seconds of one run (default: 300)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
