"""Scores of a network file on crops, run as in use, and of the baseline: colour histograms.

The baseline follows Gray & Tao, "Viewpoint invariant pedestrian recognition", ECCV 2008, who describe six horizontal
stripes of a crop.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.networks.session import Session
from tools.reid.crops import Crops
from tools.reid.metrics import Pairs, Retrieval, euclidean_distances, fit_sigmoid, pairs_in_shots, retrieve

BATCH = 20  # crops per batch when the network is timed
_HIDDEN = (0.0, 0.15, 0.3, 0.5)

_STRIPES = 6
_BINS = np.array([12, 4, 4])  # bins of hue, saturation, value
_RANGES = np.array([180, 256, 256])  # ranges of hue, saturation, value in OpenCV
_MARGIN = 0.15  # fraction of the width left out on either side, where there is mostly background


def network_descriptors(session: Session, crops: Crops) -> NDArray[np.float32]:
    """Return the unit descriptors of crops by a network, (N, D)."""
    (values,) = session(crops.images)
    return values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-12)


def histogram_descriptors(images: NDArray[np.uint8], *, balanced: bool = True) -> NDArray[np.float32]:
    """Return histograms of hue, saturation and value in stripes of crops as unit descriptors, (N, D).

    The entries are square roots of frequencies, so that distances are Hellinger distances (times the square root of 2).

    Args:
        images: crops, sRGB, (N, h, w, 3).
        balanced: apply a grey-world white balance first, which removes a colour cast.
    """
    height, width = images.shape[1:3]
    side = round(_MARGIN * width)
    rows = np.arange(height) * _STRIPES // height
    result = np.empty((len(images), _STRIPES * int(_BINS.prod())), np.float32)
    for k, image in enumerate(images):
        if balanced:
            mean = np.maximum(image.reshape(-1, 3).mean(axis=0), 1.0)
            image = np.clip(image * (mean.mean() / mean), 0, 255).astype(np.uint8)  # noqa: PLW2901
        hsv = cv2.cvtColor(image[:, side : width - side], cv2.COLOR_RGB2HSV).astype(int)
        hue, saturation, value = np.moveaxis(hsv * _BINS // _RANGES, -1, 0)
        cell = ((rows[:, None] * _BINS[0] + hue) * _BINS[1] + saturation) * _BINS[2] + value
        shares = np.bincount(cell.ravel(), minlength=result.shape[1]) / cell.size
        result[k] = np.sqrt(shares)
    return result


def score_sites(session: Session, sites: Sequence[Crops]) -> dict[str, object]:
    """Score retrieval among all people of a site, by network and by histograms; means over the sites.

    The gallery of a crop is all crops of the other cameras at the site. "hidden" has the scores of the network for
    crops with at most that fraction of hidden joints.

    Args:
        session: network.
        sites: crops of every site.
    """
    distances = [euclidean_distances(network_descriptors(session, crops)) for crops in sites]
    result: dict[str, object] = {
        "identities": [len(np.unique(crops.identity)) for crops in sites],
        "crops": [len(crops) for crops in sites],
        "network": percentages([_at_site(row, crops) for row, crops in zip(distances, sites, strict=True)]),
        "of_each_site": [percentages([_at_site(row, crops)]) for row, crops in zip(distances, sites, strict=True)],
        "hidden": {
            f"{most:g}": percentages(
                [_at_site(row, crops, crops.hidden <= most) for row, crops in zip(distances, sites, strict=True)]
            )
            for most in _HIDDEN
        },
    }
    for name, balanced in (("histogram", False), ("histogram_balanced", True)):
        baseline = [euclidean_distances(histogram_descriptors(crops.images, balanced=balanced)) for crops in sites]
        result[name] = percentages([_at_site(row, crops) for row, crops in zip(baseline, sites, strict=True)])
    return result


def score_scenes(session: Session, crops: Crops) -> tuple[dict[str, object], Pairs]:
    """Score retrieval among the people of one group at one moment, by network and by histograms.

    Args:
        session: network.
        crops: crops of groups with one value of ``look_alike``.

    Returns:
        Scores, and the pairs of crops with the distances of the network.
    """
    distances = euclidean_distances(network_descriptors(session, crops))
    result: dict[str, object] = {
        "identities": len(np.unique(crops.identity)),
        "people_in_a_scene": max(len(np.unique(crops.person[crops.seed == seed])) for seed in np.unique(crops.seed)),
        "network": percentages([_in_scene(distances, crops)]),
        "hidden": {f"{most:g}": percentages([_in_scene(distances, crops, crops.hidden <= most)]) for most in _HIDDEN},
    }
    for name, balanced in (("histogram", False), ("histogram_balanced", True)):
        baseline = euclidean_distances(histogram_descriptors(crops.images, balanced=balanced))
        result[name] = percentages([_in_scene(baseline, crops)])
    return result, pairs_of_crops(distances, crops)


def fit_affinity(session: Session, crops: Crops) -> tuple[float, float]:
    """Fit midpoint and slope of the sigmoid of appearance affinity to the pairs of crops in shots."""
    return fit_sigmoid(pairs_of_crops(euclidean_distances(network_descriptors(session, crops)), crops))


def pairs_of_crops(distances: Floats, crops: Crops) -> Pairs:
    """Return the pairs of crops of one shot in different views."""
    return pairs_in_shots(distances, crops.identity, crops.shot, crops.view, crops.azimuth, crops.hidden)


def milliseconds(session: Session, *, rounds: int = 15) -> float:
    """Measure the median time per crop in batches of :data:`BATCH`, with normalisation, on the session's threads."""
    width, height = session.size
    crops = np.random.default_rng(0).integers(0, 256, (BATCH, height, width, 3), np.uint8)
    session(crops)
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        session(crops)
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times)) / BATCH


def percentages(retrievals: Sequence[Retrieval]) -> dict[str, float]:
    """Return mean scores of retrievals in percent, and their total number of queries."""
    ranks = {
        f"rank{k}": round(100 * float(np.mean([each.ranks[k] for each in retrievals])), 2) for k in retrievals[0].ranks
    }
    precision = round(100 * float(np.mean([each.mean_average_precision for each in retrievals])), 2)
    return {**ranks, "mAP": precision, "queries": sum(each.queries for each in retrievals)}


def _at_site(distances: Floats, crops: Crops, rows: NDArray[np.bool_] | slice = slice(None)) -> Retrieval:
    """Retrieve among all crops of a site."""
    chosen = crops[rows]
    return retrieve(distances[rows][:, rows], chosen.identity, chosen.view)


def _in_scene(distances: Floats, crops: Crops, rows: NDArray[np.bool_] | slice = slice(None)) -> Retrieval:
    """Retrieve among the crops of the same group and moment."""
    chosen = crops[rows]
    return retrieve(distances[rows][:, rows], chosen.identity, chosen.view, within=chosen.group_moment)
