"""What a network is worth: figures of its ONNX file, run as it will be run, beside those of colours alone."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.networks.session import Session
from tools.reid import histogram
from tools.reid.crops import Crops
from tools.reid.metrics import Pairs, Retrieval, euclidean, fitted_sigmoid, pairs, retrieve

BATCH = 20  # crops, in which the network is timed
_HIDDEN = (0.0, 0.15, 0.3, 0.5)


def describe(session: Session, crops: Crops) -> NDArray[np.float32]:
    """Unit descriptors, (N, D)."""
    (values,) = session(crops.images)
    return values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-12)


def held_out(session: Session, sites: Sequence[Crops]) -> dict[str, object]:
    """Retrieval across the cameras of a site among all people, by the network and by colours; the mean over sites.

    A crop's gallery are the crops that the other cameras took at that site, of everyone. "hidden" has the network's
    figures among the crops of which at most that share of the joints is hidden.
    """
    ours = [euclidean(describe(session, crops)) for crops in sites]
    result: dict[str, object] = {
        "identities": [len(np.unique(crops.identity)) for crops in sites],
        "crops": [len(crops) for crops in sites],
        "network": figures([_across(row, crops) for row, crops in zip(ours, sites, strict=True)]),
        "of_each_site": [figures([_across(row, crops)]) for row, crops in zip(ours, sites, strict=True)],
        "hidden": {
            f"{most:g}": figures(
                [_across(row, crops, crops.hidden <= most) for row, crops in zip(ours, sites, strict=True)]
            )
            for most in _HIDDEN
        },
    }
    for name, balanced in (("histogram", False), ("histogram_balanced", True)):
        colors = [euclidean(histogram.describe(crops.images, balanced=balanced)) for crops in sites]
        result[name] = figures([_across(row, crops) for row, crops in zip(colors, sites, strict=True)])
    return result


def in_scenes(session: Session, crops: Crops) -> tuple[dict[str, object], Pairs]:
    """Retrieval among the people of one group at one time, by the network and by colours; and the network's pairs.

    Args:
        session: the network.
        crops: of groups dressed at one value of the dial.
    """
    distances = euclidean(describe(session, crops))
    result: dict[str, object] = {
        "identities": len(np.unique(crops.identity)),
        "people_in_a_scene": max(len(np.unique(crops.person[crops.seed == seed])) for seed in np.unique(crops.seed)),
        "network": figures([_within(distances, crops)]),
        "hidden": {f"{most:g}": figures([_within(distances, crops, crops.hidden <= most)]) for most in _HIDDEN},
    }
    for name, balanced in (("histogram", False), ("histogram_balanced", True)):
        colors = euclidean(histogram.describe(crops.images, balanced=balanced))
        result[name] = figures([_within(colors, crops)])
    return result, met(distances, crops)


def scale(session: Session, crops: Crops) -> tuple[float, float]:
    """Midpoint and slope of the sigmoid of appearance affinity, from pairs that a matcher has before it."""
    return fitted_sigmoid(met(euclidean(describe(session, crops)), crops))


def met(distances: Floats, crops: Crops) -> Pairs:
    """The pairs of crops of one moment."""
    return pairs(distances, crops.identity, crops.scene, crops.view, crops.azimuth, crops.hidden)


def milliseconds(session: Session, *, rounds: int = 15) -> float:
    """Median time a crop in batches of :data:`BATCH`, normalisation included, on as many threads as the session has."""
    width, height = session.size
    crops = np.random.default_rng(0).integers(0, 256, (BATCH, height, width, 3), np.uint8)
    session(crops)
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        session(crops)
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times)) / BATCH


def figures(found: Sequence[Retrieval]) -> dict[str, float]:
    """Percent, the mean over several retrievals, and how many queries in all."""
    ranks = {f"rank{k}": round(100 * float(np.mean([each.ranks[k] for each in found])), 2) for k in found[0].ranks}
    precision = round(100 * float(np.mean([each.mean_average_precision for each in found])), 2)
    return {**ranks, "mAP": precision, "queries": sum(each.queries for each in found)}


def _across(distances: Floats, crops: Crops, rows: NDArray[np.bool_] | slice = slice(None)) -> Retrieval:
    chosen = crops[rows]
    return retrieve(distances[rows][:, rows], chosen.identity, chosen.view)


def _within(distances: Floats, crops: Crops, rows: NDArray[np.bool_] | slice = slice(None)) -> Retrieval:
    chosen = crops[rows]
    return retrieve(distances[rows][:, rows], chosen.identity, chosen.view, within=chosen.take)
