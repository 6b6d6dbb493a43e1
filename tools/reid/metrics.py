"""How well descriptors tell people apart: retrieval across cameras, and the distances behind it."""

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
    """How well a gallery answers queries.

    Attributes:
        ranks: share of queries whose nearest one, five and ten have the person among them, by their number.
        mean_average_precision: mean over queries of the area under precision over recall.
        queries: how many had an answer in the gallery.
    """

    ranks: Mapping[int, float]
    mean_average_precision: float
    queries: int

    @property
    def rank1(self) -> float:
        """Share of queries that are answered rightly at once."""
        return self.ranks[1]


def retrieve(distances: Floats, identity: Integers, camera: Integers, *, within: Integers | None = None) -> Retrieval:
    """Let each of N crops look for its person among those of other cameras.

    Crops of a query's own camera are not in its gallery, whoever they show (Zheng et al., "Scalable person
    re-identification", ICCV 2015, leave out only those of the same person; here a camera is one picture).

    Args:
        distances: between the crops' descriptors, (N, N).
        identity: who they show, (N,).
        camera: which camera took them, (N,).
        within: where given, galleries hold only crops with the query's number, (N,).

    Raises:
        ValueError: no crop has its person elsewhere.
    """
    ranks, precisions = [], []
    for query, row in enumerate(distances):
        others = camera != camera[query]
        if within is not None:
            others &= within == within[query]
        mine = identity[others] == identity[query]
        if not mine.any():
            continue
        found = np.flatnonzero(mine[np.argsort(row[others], kind="stable")])
        ranks.append(found[0])
        precisions.append(np.mean((np.arange(len(found)) + 1) / (found + 1)))
    if not ranks:
        raise ValueError("no crop has its person in another camera: nothing can be retrieved")
    first = np.array(ranks)
    return Retrieval(
        ranks=MappingProxyType({k: float((first < k).mean()) for k in (1, 5, 10)}),
        mean_average_precision=float(np.mean(precisions)),
        queries=len(ranks),
    )


def euclidean(descriptors: ArrayLike) -> Floats:
    """Distances between unit descriptors, (N, N) of (N, D)."""
    values = np.asarray(descriptors, np.float32)
    return np.sqrt(np.maximum(2.0 - 2.0 * (values @ values.T), 0.0)).astype(float)


@dataclass(frozen=True)
class Pairs:
    """Pairs of crops of different cameras.

    Attributes:
        distance: (n,).
        same: whether both show one person, (n,).
        turn: angle between the bearings from which the two see their person, degrees 0 to 180, (n,).
        hidden: share of joints that is hidden in the crop that shows less, (n,).
        people: identities of the two, the lesser number first, (n, 2).
    """

    distance: Floats
    same: NDArray[np.bool_]
    turn: Floats
    hidden: Floats
    people: Integers

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """All in one, each part's people told from those of the others."""
        starts = np.cumsum([0, *(1 + part.people.max(initial=-1) for part in parts)])
        columns = {key: np.concatenate([getattr(part, key) for part in parts]) for key in _MEASURED}
        people = [part.people + start for part, start in zip(parts, starts, strict=False)]
        return cls(**columns, people=np.concatenate(people))


_MEASURED = ("distance", "same", "turn", "hidden")


def pairs(
    distances: Floats, identity: Integers, moment: Integers, view: Integers, azimuth: Floats, hidden: Floats
) -> Pairs:
    """All pairs of crops of one moment in different views: those that a matcher has before it.

    Args:
        distances: (N, N).
        identity: (N,).
        moment: number of the moment, of no other scene, (N,).
        view: camera in it, (N,).
        azimuth: bearing of the camera from the person, radians, (N,).
        hidden: share of hidden joints, (N,).
    """
    one, two = np.triu_indices(len(identity), 1)
    met = (moment[one] == moment[two]) & (view[one] != view[two])
    one, two = one[met], two[met]
    turn = np.degrees(np.abs((azimuth[one] - azimuth[two] + np.pi) % (2 * np.pi) - np.pi))
    people = np.sort(np.column_stack([identity[one], identity[two]]), axis=1)
    return Pairs(distances[one, two], people[:, 0] == people[:, 1], turn, np.maximum(hidden[one], hidden[two]), people)


def fitted_sigmoid(met: Pairs) -> tuple[float, float]:
    """Midpoint and slope of the sigmoid of distance that best tells the chance of one person.

    Both kinds of pairs weigh the same in all, so at the midpoint a pair is as likely of one person as of two where
    those are equally common (Platt scaling; Platt, "Probabilistic outputs for support vector machines", 1999).
    """
    if met.same.all() or not met.same.any():
        raise ValueError("a sigmoid needs pairs of one person and pairs of two")
    weight = np.where(met.same, 0.5 / met.same.sum(), 0.5 / (~met.same).sum())

    def loss(at: Floats) -> float:
        chance = expit((at[0] - met.distance) / np.exp(at[1]))
        return float(-(weight * np.log(np.maximum(np.where(met.same, chance, 1 - chance), 1e-9))).sum())

    start = np.array([(met.distance[met.same].mean() + met.distance[~met.same].mean()) / 2, np.log(0.1)])
    midpoint, slope = minimize(loss, start, method="Nelder-Mead").x
    return float(midpoint), float(np.exp(slope))


def summary(distance: Floats) -> dict[str, object]:
    """What distances (n,) are like; None where there are none.

    How many, mean, deviation, the mean cosine that goes with them, and the values at ``QUANTILES``.
    """
    if not len(distance):
        return {"pairs": 0, "mean": None, "deviation": None, "cosine": None, "quantiles": None}
    return {
        "pairs": len(distance),
        "mean": round(float(distance.mean()), 4),
        "deviation": round(float(distance.std()), 4),
        "cosine": round(float(1 - (distance**2).mean() / 2), 4),
        "quantiles": [round(float(value), 4) for value in np.quantile(distance, QUANTILES)],
    }


def distributions(met: Pairs) -> dict[str, object]:
    """Distances of one person's and of two people's pairs: of all, and by view difference and occlusion.

    Under "same" and under "other":

    - "all": the :func:`summary` of all pairs;
    - "between": deviation of the means of pairs of one and the same two people (of one, for "same"), and "within": the
      root mean square deviation from those means: how much of the spread lasts, and how much is the crops';
    - "bins": ``[v][h]``, the summary of pairs in bin v of ``VIEW_EDGES`` and bin h of ``HIDDEN_EDGES``.

    A uniform draw put through the quantiles, between which one may interpolate, is a distance.
    """
    views, covers = len(VIEW_EDGES) - 1, len(HIDDEN_EDGES) - 1
    v = np.clip(np.digitize(met.turn, VIEW_EDGES) - 1, 0, views - 1)
    h = np.clip(np.digitize(met.hidden, HIDDEN_EDGES) - 1, 0, covers - 1)
    result: dict[str, object] = {}
    for name, kind in (("same", met.same), ("other", ~met.same)):
        between, within = _spread(met.distance[kind], met.people[kind])
        result[name] = {
            "all": summary(met.distance[kind]),
            "between": between,
            "within": within,
            "bins": [
                [summary(met.distance[kind & (v == row) & (h == column)]) for column in range(covers)]
                for row in range(views)
            ],
        }
    return result


def _spread(distance: Floats, people: Integers) -> tuple[float | None, float | None]:
    """Deviation of the means of each two people, and root mean square deviation from them."""
    if not len(distance):
        return None, None
    pair = np.unique(people, axis=0, return_inverse=True)[1].reshape(-1)
    count = np.bincount(pair)
    mean = np.bincount(pair, distance) / count
    within = np.sqrt(np.mean((distance - mean[pair]) ** 2))
    return round(float(np.sqrt(np.average((mean - distance.mean()) ** 2, weights=count))), 4), round(float(within), 4)
