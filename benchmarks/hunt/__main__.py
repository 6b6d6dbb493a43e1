"""``python -m benchmarks.hunt FOLDER``: run searches of the same budget, and compare what they find.

FOLDER keeps the trials, so that an interrupted run goes on.
"""

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from scipy import stats
from scipy.stats import qmc

from mvpose.arrays import Floats, Integers
from mvpose.commands.progress import Silence
from simharness.hunt.hunt_run import BATCH, Hunt, HuntedPoint, Search, distinct, next_points, run_hunt
from simharness.hunt.properties import USUAL
from simharness.scenario.load import read_plan

SCENARIO = Path(__file__).with_name("reported.toml")
SEARCHES = ("map-elites", "random", "hypercube")
_APART = 100_000  # between the seeds of the scenes of two searches


def anywhere(elites: Floats, weights: Floats, dimensions: int, seed: int, batch: int) -> tuple[Floats, Integers]:
    """Return independent points."""
    return next_points(elites[:0], weights[:0], dimensions, seed, batch)


def latin_hypercube(
    elites: Floats, weights: Floats, dimensions: int, seed: int, batch: int, *, trials: int
) -> tuple[Floats, Integers]:
    """Return the points of a batch of one Latin hypercube of all trials (McKay et al., Technometrics 1979)."""
    rows = -(-trials // BATCH) * BATCH
    points = qmc.LatinHypercube(dimensions, seed=seed).random(rows)
    return np.asarray(points[batch * BATCH :][:BATCH]), np.full(BATCH, -1)


def hunted(name: str, seed: int, folder: Path, *, scenario: Path, trials: int) -> list[HuntedPoint]:
    """Return the trials of a search, which are run where the folder does not have them; nothing is kept."""
    searches: dict[str, Search] = {
        "map-elites": next_points,
        "random": anywhere,
        "hypercube": partial(latin_hypercube, trials=trials),
    }
    plan = read_plan(scenario, overrides=[f"seed={_APART * (seed + 1)}"])
    hunt = Hunt(plan, (plan.base.method.variants[0],), USUAL, seed)
    points, _ = run_hunt(
        hunt, folder / f"{name}-{seed}", trials=trials, keep_most=0, reporter=Silence(), search=searches[name]
    )
    return points


def table(found: Mapping[str, Sequence[int]]) -> str:
    """Return the numbers of distinct failures by search and seed as a Markdown table.

    Ratios to independent points of the same seed have geometric means, and intervals of 95 % by Student's t
    distribution of their logarithms; a search that finds nothing counts as one that finds half a failure.
    """
    lines = ["| search | distinct failures, by seed | mean | ratio to random, lowest to highest |", "|:--|:--|--:|:--|"]
    for name, numbers in found.items():
        each = np.maximum(numbers, 0.5) / np.maximum(found["random"][: len(numbers)], 0.5)
        ratio = f"{stats.gmean(each):.2f}, {each.min():.2f} to {each.max():.2f}"
        if len(each) > 1 and np.ptp(each) > 0:
            low, high = np.exp(stats.t.interval(0.95, len(each) - 1, np.log(each).mean(), stats.sem(np.log(each))))
            ratio = f"{stats.gmean(each):.2f} ({low:.2f} to {high:.2f}), {each.min():.2f} to {each.max():.2f}"
        lines.append(f"| {name} | {', '.join(map(str, numbers))} | {np.mean(numbers):.1f} | {ratio} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hunt", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder of the trials")
    parser.add_argument("--scenario", type=Path, default=SCENARIO, help="scenario with a section [search]")
    parser.add_argument("--trials", type=int, default=500, help="of each search (default: 500)")
    parser.add_argument("--seeds", type=int, default=5, help="seeds of each search (default: 5)")
    options = parser.parse_args(arguments)
    found: dict[str, list[int]] = {name: [] for name in SEARCHES}
    for seed in range(options.seeds):
        for name, numbers in found.items():
            points = hunted(name, seed, options.folder, scenario=options.scenario, trials=options.trials)
            numbers.append(len(distinct(points, lambda each: each.cell)))
        print(table(found), flush=True)


if __name__ == "__main__":
    main()
