"""The fast layer beside the simulator, on random rigs.

    python -m benchmarks.planning.simulated_rigs trials [--count 40] [--first 7000]
    python -m benchmarks.planning.simulated_rigs maps [--count 6] [--first 7000] [--recordings 6]

``trials``: the PCP that ``full`` reaches in short simulated recordings, and the share of them that the predicted 90 %
intervals hold. ``maps``: the mean error of the joints at every place, from several recordings of one rig, beside the
predicted one. Rigs, rooms, people, detectors and activities are drawn from the seed.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from mvpose import Rig, preset
from mvpose.arrays import Floats
from simharness import simulate
from simharness.planning import FastLayer, Prediction, Volume
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import Part
from simharness.trial.stages.build_trial import true_rig
from simharness.types.random_streams import stream

SECONDS, RATE = 8.0, 2.5
"""Duration of a recording, seconds, and its frames per second."""

DETECTORS = ("typical", "topdown", "excellent", "openpose-shelf")
ACTIVITIES = ("walk", "wave", "turn", "reach", "talk", "point")

_FEWEST = 25  # people at a place, below which its mean error is too noisy to be compared


def random_scenario(seed: int, *, walking: bool = False) -> Scenario:
    """Return a scenario with 3 to 8 cameras on the walls of a room and 1 to 6 people.

    Args:
        seed: seed of everything.
        walking: whether everyone walks, so that all places are visited.
    """
    rng = stream(seed, "benchmark of planning")
    x, y = rng.uniform(5.0, 9.0, 2).round(1)
    area = round(min(x, y) / 2 - 0.9, 2)
    fits = min(6, int(2.2 * area))
    cameras = int(rng.integers(3, 9))
    along = rng.permutation(cameras) + rng.uniform(-0.3, 0.3, cameras)
    size = [[800, 600], [1280, 720], [1032, 776]][rng.integers(3)]
    positions = [[*_on_wall(share / cameras, x, y), float(rng.uniform(1.6, 2.7))] for share in along]
    aims = [[*rng.uniform(-0.4, 0.4, 2) * area, 0.9] for _ in positions]
    activities = ["walk"] if walking else rng.permutation(ACTIVITIES)[: rng.integers(1, 4)].tolist()
    people = int(rng.integers(1, fits + 1))
    detector = str(rng.choice(DETECTORS))
    return Scenario.model_validate(
        {
            "name": "planning",
            "seed": seed,
            "duration": SECONDS,
            "rate": RATE,
            "room": {"size": [x, y, 3.0]},
            "people": {"count": people, "area": area, "activities": activities},
            "cameras": {
                "layout": "free",
                "positions": np.round(positions, 3).tolist(),
                "aims": np.round(aims, 3).tolist(),
                "fov": round(float(rng.uniform(60, 95)), 1),
                "size": size,
            },
            "detector": read_profile(detector).model_dump(),
            "rendering": {"renderer": "rays"},
        }
    )


def _on_wall(share: float, x: float, y: float) -> tuple[float, float]:
    """Return the point at a share of the way round a room, a hand's breadth from the wall."""
    x, y = x - 0.3, y - 0.3
    way = (share % 1.0) * 2 * (x + y)
    for length, corner, direction in (
        (x, (-x / 2, -y / 2), (1, 0)),
        (y, (x / 2, -y / 2), (0, 1)),
        (x, (x / 2, y / 2), (-1, 0)),
        (y, (-x / 2, y / 2), (0, -1)),
    ):
        if way <= length:
            return corner[0] + direction[0] * way, corner[1] + direction[1] * way
        way -= length
    return -x / 2, -y / 2


@dataclass(frozen=True)
class Outcome:
    """What the method made of a simulated recording.

    Attributes:
        pcp: PCP of ``full``, percent.
        position: place of every true person in every frame, (n, 2), metres.
        error_mm: mean error of their joints, (n,), millimetres; NaN for people who are not found.
    """

    pcp: float
    position: Floats
    error_mm: Floats


def simulated(scenario: Scenario) -> Outcome:
    """Simulate a scenario and score ``full`` on it."""
    recording, pipeline = simulate(scenario), preset("full")
    truth = np.stack([each.joints for each in recording.truth])
    scores = score_frames(truth, [pipeline.estimate(recording.rig, each).joints for each in recording.detections])
    pcp = 100.0 * (scores.parts == Part.CORRECT).sum() / (scores.parts != Part.UNDEFINED).sum()
    positions = truth[:, :, 11:13, :2].mean(axis=2)
    return Outcome(float(pcp), positions.reshape(-1, 2), 1000.0 * scores.error.ravel())


def predicted(scenario: Scenario, *, spacing: float = 0.5, draws: int = 1) -> Prediction:
    """Return the prediction of the fast layer for ``full``."""
    side = 2 * scenario.people.area
    layer = FastLayer.in_volume(
        Volume.box(side, side),
        detector=scenario.detector,
        people=scenario.people.count,
        activities=scenario.people.activities,
        spacing=spacing,
        draws=draws,
        seed=scenario.seed,
    )
    rig: Rig = true_rig(scenario)
    return layer.predict([layer.terms(camera) for camera in rig], variant="full")


def possible(first: int, *, walking: bool = False) -> Iterator[Scenario]:
    """Yield random scenarios from a seed on, without those that have no room for their people."""
    for seed in range(first, first + 10_000):
        scenario = random_scenario(seed, walking=walking)
        try:
            true_rig(scenario)
        except ValueError:
            continue
        yield scenario


def trials(count: int, first: int) -> None:
    """Print predicted intervals beside the PCP of one recording each."""
    inside, done, apart = 0, 0, []
    for scenario in possible(first):
        if done == count:
            break
        try:
            real = simulated(scenario).pcp
        except ValueError:  # the people do not fit
            continue
        figure = predicted(scenario).summary(seconds=SECONDS)["pcp"]
        done, inside = done + 1, inside + (figure.low <= real <= figure.high)
        apart.append(abs(real - figure.mean))
        print(
            f"seed {scenario.seed}: {len(scenario.cameras.positions)} cameras, {scenario.people.count} people: PCP "
            f"{real:.1f}, predicted {figure.mean:.1f} ({figure.low:.1f} to {figure.high:.1f}); so far {inside} of "
            f"{done} inside, {100 * inside / done:.1f} % (bound 85 to 95), mean difference {np.mean(apart):.2f}",
            flush=True,
        )


def _error_by_place(outcomes: Sequence[Outcome], places: Floats) -> tuple[Floats, Floats]:
    """Return the mean error at each place, (P,), millimetres, NaN where nobody was, and how many people were there."""
    position = np.concatenate([each.position for each in outcomes])
    error = np.concatenate([each.error_mm for each in outcomes])
    known = np.isfinite(error)
    place = ((position[known][:, None] - places) ** 2).sum(axis=-1).argmin(axis=1)
    count = np.bincount(place, minlength=len(places)).astype(float)
    total = np.bincount(place, error[known], minlength=len(places))
    return np.divide(total, count, out=np.full(len(places), np.nan), where=count > 0), count


def _agreement(one: Floats, other: Floats) -> str:
    """Return how well two lists of errors agree."""
    off = 100 * np.median(np.abs(other / one - 1))
    return f"Spearman {spearmanr(one, other)[0]:.3f}, median relative error {off:.1f} %"


def maps(count: int, first: int, recordings: int) -> None:
    """Print how well the predicted error of each place agrees with that of simulated recordings.

    Beside it: how well one half of the recordings agrees with the other, which no prediction can exceed by much.
    """
    pairs: list[tuple[float, float, float, float]] = []  # simulated, predicted, in either half
    done = 0
    for scenario in possible(first, walking=True):
        if done == count:
            break
        outcomes = []
        for number in range(recordings):
            again = scenario.model_copy(update={"seed": scenario.seed + 100_000 * (number + 1), "duration": 20.0})
            try:
                outcomes.append(simulated(again))
            except ValueError:  # the people do not fit
                continue
        if len(outcomes) < 2:
            continue
        prediction = predicted(scenario, spacing=1.0, draws=4)
        real, number_at = _error_by_place(outcomes, prediction.places)
        halves = [_error_by_place(outcomes[k::2], prediction.places)[0] for k in range(2)]
        chosen = (number_at >= _FEWEST) & np.isfinite([prediction.error_mm, *halves]).all(axis=0)
        if not chosen.any():
            continue
        done += 1
        rows = np.stack([real, prediction.error_mm, *halves])[:, chosen]
        pairs += [tuple(row) for row in rows.T.tolist()]
        print(
            f"seed {scenario.seed}: {len(scenario.cameras.positions)} cameras, {scenario.people.count} people, "
            f"{chosen.sum()} places: {rows[0].mean():.0f} mm, predicted {rows[1].mean():.0f} mm, "
            f"{_agreement(rows[0], rows[1])}",
            flush=True,
        )
        simulated_error, expected, *parts = np.array(pairs).T
        print(
            f"  so far {len(pairs)} places: {_agreement(simulated_error, expected)} (bound .9, 20 %); of the two "
            f"halves of the recordings: {_agreement(*parts)}",
            flush=True,
        )


def main() -> None:
    """Run one of the comparisons."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("what", choices=("trials", "maps"))
    parser.add_argument("--count", type=int, default=6)
    parser.add_argument("--first", type=int, default=7000, help="first seed")
    parser.add_argument("--recordings", type=int, default=6, help="recordings of each rig for the maps")
    arguments = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    if arguments.what == "trials":
        trials(arguments.count, arguments.first)
    else:
        maps(arguments.count, arguments.first, arguments.recordings)


if __name__ == "__main__":
    main()
