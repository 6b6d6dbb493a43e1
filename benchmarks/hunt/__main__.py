"""``python -m benchmarks.hunt FOLDER``: run searches of the same budget, and compare what they find."""

import argparse
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from mvpose.arrays import Floats, Integers
from mvpose.commands.progress import Silence
from simharness.hunt.hunt_run import BATCH, Hunt, HuntedPoint, Search, distinct, next_points, run_hunt
from simharness.hunt.properties import USUAL
from simharness.scenario.load import read_plan

SCENARIO = Path(__file__).with_name("reported.toml")


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


def main() -> None:
    """Run the searches that have no results yet, and print what they found."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hunt", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder of results; a second run continues the first")
    parser.add_argument("--scenario", type=Path, default=SCENARIO)
    parser.add_argument("--trials", type=int, default=500, help="of each search (default: 500)")
    parser.add_argument("--seeds", type=int, default=5, help="of each search (default: 5)")
    parser.add_argument("--only", nargs="+", help="some searches only")
    options = parser.parse_args()
    searches: dict[str, Search] = {
        "map-elites": next_points,
        "random": anywhere,
        "hypercube": partial(latin_hypercube, trials=options.trials),
    }
    for seed in range(options.seeds):
        for name, search in searches.items():
            if options.only and name not in options.only:
                continue
            plan = read_plan(options.scenario, overrides=[f"seed={100_000 * (seed + 1)}"])
            hunt = Hunt(plan, ("full",), USUAL, seed)
            folder = options.folder / f"{name}-{seed}"
            points, _ = run_hunt(hunt, folder, trials=options.trials, keep_most=0, reporter=Silence(), search=search)
            print(seed, name, counts(points), sum(bool(each.error) for each in points), flush=True)


def counts(points: list[HuntedPoint]) -> list[int]:
    """Return the number of distinct failures after each hundred trials."""
    return [len(distinct(points[:n], lambda each: each.cell)) for n in range(50, len(points) + 1, 50)]


if __name__ == "__main__":
    main()
