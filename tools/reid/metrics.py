"""Metrics of re-ID descriptors: retrieval across cameras, and distances of pairs of crops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.special import expit

from mvpose.arrays import Floats, Integers

VIEW_EDGES = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0)  # degrees
HIDDEN_EDGES = (0.0, 0.05, 0.15, 0.25, 0.35, 0.5)
QUANTILES = (0.0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)


@dataclass(frozen=True)
class Retrieval:
    """Retrieval scores.

    Attributes:
        ranks: cumulative match characteristic at k = 1, 5, 10: fraction of queries with their person among the k
            nearest crops of the gallery.
        mean_average_precision: mean over queries of the area under the precision-recall curve.
        queries: number of queries with their person in the gallery.
    """

    ranks: Mapping[int, float]
    mean_average_precision: float
    queries: int

    @property
    def rank1(self) -> float:
        """Fraction of queries whose nearest crop shows their person."""
        return self.ranks[1]


def retrieve(distances: Floats, identity: Integers, camera: Integers, *, within: Integers | None = None) -> Retrieval:
    """Retrieve each of N crops among those of the other cameras.

    The gallery of a query has no crop of the query's camera. (Zheng et al., "Scalable person re-identification", ICCV
    2015, leave out only those of the same person; here all crops of a camera are from one picture.)

    Args:
        distances: distances between the descriptors of the crops, (N, N).
        identity: identities of the crops, (N,).
        camera: cameras of the crops, (N,).
        within: if given, the gallery has only crops with the same number as the query, (N,).

    Raises:
        ValueError: no crop has its person in another camera.
    """
    ranks, precisions = [], []
    for query, row in enumerate(distances):
        others = camera != camera[query]
        if within is not None:
            others &= within == within[query]
        same = identity[others] == identity[query]
        if not same.any():
            continue
        hits = np.flatnonzero(same[np.argsort(row[others], kind="stable")])
        ranks.append(hits[0])
        precisions.append(np.mean((np.arange(len(hits)) + 1) / (hits + 1)))
    if not ranks:
        raise ValueError("retrieval needs at least one person in two cameras, got none")
    first = np.array(ranks)
    return Retrieval(
        ranks=MappingProxyType({k: float((first < k).mean()) for k in (1, 5, 10)}),
        mean_average_precision=float(np.mean(precisions)),
        queries=len(ranks),
    )


def euclidean_distances(descriptors: ArrayLike) -> Floats:
    """Return the Euclidean distances (N, N) between unit descriptors (N, D)."""
    values = np.asarray(descriptors, np.float32)
    return np.sqrt(np.maximum(2.0 - 2.0 * (values @ values.T), 0.0)).astype(float)


@dataclass(frozen=True)
class Pairs:
    """Pairs of crops of different cameras.

    Attributes:
        distance: distances of the descriptors, (n,).
        same: whether both crops show the same person, (n,).
        angle: difference of the bearings from which the two cameras see their person, degrees 0 to 180, (n,).
        hidden: the larger fraction of hidden joints of the two crops, (n,).
        people: identities of the two crops, the smaller index first, (n, 2).
    """

    distance: Floats
    same: NDArray[np.bool_]
    angle: Floats
    hidden: Floats
    people: Integers

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Concatenate pairs; the people of every part get separate indices."""
        starts = np.cumsum([0, *(1 + part.people.max(initial=-1) for part in parts)])
        columns = {key: np.concatenate([getattr(part, key) for part in parts]) for key in _MEASURED}
        people = [part.people + start for part, start in zip(parts, starts, strict=False)]
        return cls(**columns, people=np.concatenate(people))


_MEASURED = ("distance", "same", "angle", "hidden")


def pairs_in_shots(
    distances: Floats, identity: Integers, shot: Integers, view: Integers, azimuth: Floats, hidden: Floats
) -> Pairs:
    """Return all pairs of crops of one shot in different views: the pairs that a matcher has to decide.

    Args:
        distances: distances of the descriptors, (N, N).
        identity: identities, (N,).
        shot: index of the shot, unique over all groups, (N,).
        view: camera, (N,).
        azimuth: bearing of the camera from the person, radians, (N,).
        hidden: fraction of hidden joints, (N,).
    """
    one, two = np.triu_indices(len(identity), 1)
    paired = (shot[one] == shot[two]) & (view[one] != view[two])
    one, two = one[paired], two[paired]
    angle = np.degrees(np.abs((azimuth[one] - azimuth[two] + np.pi) % (2 * np.pi) - np.pi))
    people = np.sort(np.column_stack([identity[one], identity[two]]), axis=1)
    return Pairs(distances[one, two], people[:, 0] == people[:, 1], angle, np.maximum(hidden[one], hidden[two]), people)


def fit_sigmoid(pairs: Pairs) -> tuple[float, float]:
    """Fit a sigmoid of distance to the probability that a pair shows the same person; return midpoint and slope.

    Pairs of the same person and of two people have equal total weight. So at the midpoint both are equally likely if
    both are equally frequent (Platt scaling; Platt, "Probabilistic outputs for support vector machines", 1999).

    Raises:
        ValueError: the pairs are all of one kind.
    """
    if pairs.same.all() or not pairs.same.any():
        raise ValueError(
            "the sigmoid needs pairs of the same person and pairs of two people, "
            f"got {pairs.same.sum()} and {(~pairs.same).sum()}"
        )
    weight = np.where(pairs.same, 0.5 / pairs.same.sum(), 0.5 / (~pairs.same).sum())

    def loss(at: Floats) -> float:
        chance = expit((at[0] - pairs.distance) / np.exp(at[1]))
        return float(-(weight * np.log(np.maximum(np.where(pairs.same, chance, 1 - chance), 1e-9))).sum())

    start = np.array([(pairs.distance[pairs.same].mean() + pairs.distance[~pairs.same].mean()) / 2, np.log(0.1)])
    midpoint, slope = minimize(loss, start, method="Nelder-Mead").x
    return float(midpoint), float(np.exp(slope))


def summary(distance: Floats) -> dict[str, object]:
    """Return count, mean, deviation, mean cosine similarity and the ``QUANTILES`` of distances (n,); None for n = 0."""
    if not len(distance):
        return {"pairs": 0, "mean": None, "deviation": None, "cosine": None, "quantiles": None}
    return {
        "pairs": len(distance),
        "mean": round(float(distance.mean()), 4),
        "deviation": round(float(distance.std()), 4),
        "cosine": round(float(1 - (distance**2).mean() / 2), 4),
        "quantiles": [round(float(value), 4) for value in np.quantile(distance, QUANTILES)],
    }


def distributions(pairs: Pairs) -> dict[str, object]:
    """Return the distributions of distance for the same person and for two people, by view difference and occlusion.

    Under "same" and under "other":

    - "all": the :func:`summary` of all pairs;
    - "between": standard deviation of the mean distances of the pairs of people (of the people, for "same");
    - "within": root mean square deviation from those means, which is due to the crops;
    - "bins": ``[v][h]``, the summary of pairs in bin v of ``VIEW_EDGES`` and bin h of ``HIDDEN_EDGES``.

    Distances can be drawn from a summary by inverse transform sampling, with interpolation between its quantiles.
    """
    views, covers = len(VIEW_EDGES) - 1, len(HIDDEN_EDGES) - 1
    v = np.clip(np.digitize(pairs.angle, VIEW_EDGES) - 1, 0, views - 1)
    h = np.clip(np.digitize(pairs.hidden, HIDDEN_EDGES) - 1, 0, covers - 1)
    result: dict[str, object] = {}
    for name, kind in (("same", pairs.same), ("other", ~pairs.same)):
        between, within = _spread(pairs.distance[kind], pairs.people[kind])
        result[name] = {
            "all": summary(pairs.distance[kind]),
            "between": between,
            "within": within,
            "bins": [
                [summary(pairs.distance[kind & (v == row) & (h == column)]) for column in range(covers)]
                for row in range(views)
            ],
        }
    return result


def _spread(distance: Floats, people: Integers) -> tuple[float | None, float | None]:
    """Return the deviation of the mean distances of pairs of people, and the root mean square deviation from them."""
    if not len(distance):
        return None, None
    pair = np.unique(people, axis=0, return_inverse=True)[1].reshape(-1)
    count = np.bincount(pair)
    mean = np.bincount(pair, distance) / count
    within = np.sqrt(np.mean((distance - mean[pair]) ** 2))
    return round(float(np.sqrt(np.average((mean - distance.mean()) ** 2, weights=count))), 4), round(float(within), 4)
