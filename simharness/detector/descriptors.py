"""Descriptors without pictures: drawn so that their distances are what a re-ID network's are.

A descriptor is a unit vector in the direction of

    who (as alike as the scene's people are)  +  from where (what front, side and back show)  +  noise

How much of each there is, and in how many dimensions, follows from the distances that were measured when the network
was trained and that its card states: of one person and of two, by the angle between the bearings from which the two
crops see their people, by how much of the person is hidden, and by the ``look_alike`` dial.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from simharness.random import stream

Floats = NDArray[np.float64]

_FEWEST, _MOST = 6, 256  # dimensions


@dataclass(frozen=True)
class Look:
    """What descriptors are made of, at one value of the dial.

    Attributes:
        who: share of a clear crop's variance that says who it is; the rest says from where it is seen.
        alike: how much of who they are the people of a scene have in common.
        alike_sides: the same of what their sides look like.
        noise: how much noise there is, beside that at other values of the dial.
    """

    who: float
    alike: float
    alike_sides: float
    noise: float


@dataclass(frozen=True)
class DescriptorModel:
    """The distances of one network.

    Attributes:
        dimensions: of the descriptors that are drawn: as many as spread distances as much as the network's.
        dials: values of ``look_alike`` at which it was measured, ascending, (d,).
        looks: what was found at each.
        covers: shares of hidden joints, ascending, (h,).
        noise: mean variance of the noise there at the first dial, in units of a clear crop's variance, (h,).
        uneven: how that differs from crop to crop: deviation of its logarithm.
    """

    dimensions: int
    dials: tuple[float, ...]
    looks: tuple[Look, ...]
    covers: tuple[float, ...]
    noise: tuple[float, ...]
    uneven: float

    @classmethod
    def of_network(cls, model: Path) -> Self:
        """The model of a network, from the card beside its file.

        Raises:
            ValueError: there is no card, or it states no distances.
        """
        path = model.with_suffix(".json")
        try:
            card = json.loads(path.read_text(encoding="utf-8"))
            return cls.fitted(card["distances"])
        except (OSError, json.JSONDecodeError, KeyError) as error:
            raise ValueError(
                f"{path}: no card with the distances of {model.name} ({error}); they are measured by "
                "python -m simharness.train.reid. For a network without them take descriptors from pictures"
            ) from None

    @classmethod
    def fitted(cls, distances: Mapping[str, Any]) -> Self:
        """Fit the model to measured distances: ``distances`` of a card (:mod:`simharness.train.reid.evaluation`).

        Least squares over the mean cosines of all bins, each weighed by its pairs' share in its kind, and over how the
        cosines of one person's pairs spread.
        """
        edges = np.array(distances["hidden_share_of_the_joints_of_the_worse_crop"])
        turns = np.deg2rad(_middles(np.array(distances["view_difference_degrees"])))
        measured = {float(dial): kinds for dial, kinds in distances["look_alike"].items()}
        dials = sorted(measured)
        covers = len(edges) - 1
        cells = [
            (d, kind == "same", v, h, bin_["cosine"], bin_["pairs"] / measured[dial][kind]["all"]["pairs"])
            for d, dial in enumerate(dials)
            for kind in ("same", "other")
            for v, row in enumerate(measured[dial][kind]["bins"])
            for h, bin_ in enumerate(row)
            if bin_["pairs"]
        ]
        d, same, v, h, cosine, weight = (np.array(column) for column in zip(*cells, strict=True))
        same, turn = same.astype(bool), np.cos(turns)[v]
        # Two people's cosines spread as those of random directions do: that tells in how many dimensions they live.
        strangers = measured[dials[0]]["other"]["all"]
        free = (1 - strangers["cosine"] ** 2) / _cosine_deviation(strangers, distances["quantiles"])
        dimensions = int(np.clip(round(free**2), _FEWEST, _MOST))
        spread = np.array([_cosine_deviation(measured[dial]["same"]["all"], distances["quantiles"]) for dial in dials])

        def parts(x: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats, float]:
            who, alike, sides = (1 / (1 + np.exp(-x[: 3 * len(dials)]))).reshape(3, -1)
            louder = np.exp(np.append(0.0, x[3 * len(dials) : 4 * len(dials) - 1]))
            return who, alike, sides, louder, np.cumsum(np.exp(x[4 * len(dials) - 1 : -1])), float(abs(x[-1]))

        def misfit(x: Floats) -> Floats:
            who, alike, sides, louder, noise, uneven = parts(x)
            signal = np.where(same, 1.0, alike[d]) * who[d] + np.where(same, 1.0, sides[d]) * (1 - who[d]) * turn
            once, twice = _kept(louder[:, None] * noise, uneven)
            mean = signal * once[d, h] * once[d, 0]
            # The law of total variance: within bins that of unlike noise and of few dimensions, and between them.
            variance = (
                signal**2 * (twice[d, h] * twice[d, 0] - (once[d, h] * once[d, 0]) ** 2)
                + (1 - mean**2) ** 2 / dimensions
            )
            share = weight * same / len(dials)
            total = np.array([(share * (d == k)).sum() for k in range(len(dials))])
            center = np.array([(share * (d == k) * mean).sum() for k in range(len(dials))]) / total
            second = np.array([(share * (d == k) * (variance + mean**2)).sum() for k in range(len(dials))]) / total
            return np.concatenate([np.sqrt(weight) * (mean - cosine), np.sqrt(second - center**2) - spread])

        start = np.concatenate([np.full(len(dials), 1.5), np.linspace(-2, 2, len(dials)), np.zeros(len(dials))])
        start = np.concatenate([start, np.zeros(len(dials) - 1), np.log(np.full(covers, 0.1)), [0.5]])
        who, alike, sides, louder, noise, uneven = parts(least_squares(misfit, start).x)
        looks = tuple(Look(*map(float, each)) for each in zip(who, alike, sides, louder, strict=True))
        middles = tuple(map(float, _middles(edges)))
        return cls(dimensions, tuple(dials), looks, middles, tuple(map(float, noise)), uneven)

    def look(self, look_alike: ArrayLike) -> Floats:
        """Who, alike, alike_sides, noise (see :class:`Look`) at values of the dial (...), interpolated, (..., 4)."""
        table = np.array([[look.who, look.alike, look.alike_sides, look.noise] for look in self.looks])
        dial = np.asarray(look_alike, float)
        return np.stack([np.interp(dial, self.dials, column) for column in table.T], axis=-1)

    def draw(
        self,
        who: Sequence[tuple[str | int, ...]],
        *,
        bearing: ArrayLike,
        hidden: ArrayLike,
        noise: ArrayLike,
        unease: ArrayLike,
        look_alike: ArrayLike,
        seed: int,
    ) -> Floats:
        """Draw descriptors of n crops.

        Args:
            who: whom each crop shows, a key of streams, (n,); equal keys are one person.
            bearing: from where, radians about the person's vertical, (n,).
            hidden: share of the joints hidden, (n,).
            noise: each crop's own, standard normal, (n, D).
            unease: how unusually much noise each crop has, standard normal, (n,).
            look_alike: the dial of each crop's person, (n,), or of all.
            seed: of the scenario.

        Returns:
            Unit vectors, (n, D).
        """
        size, count = self.dimensions, len(who)
        bearing, hidden = np.asarray(bearing, float), np.asarray(hidden, float)
        looks = self.look(np.broadcast_to(np.asarray(look_alike, float), count))
        common, keys = _drawn(seed, ("all",), size), dict.fromkeys(who)
        drawn = np.array([_drawn(seed, key, size) for key in keys]).reshape(-1, 3, size)
        place = {key: k for k, key in enumerate(keys)}
        own = drawn[np.array([place[key] for key in who], int)]
        shared = looks[:, [1, 2, 2], None]
        people = np.sqrt(shared) * common + np.sqrt(1 - shared) * own
        direction = np.stack([np.ones(count), np.cos(bearing), np.sin(bearing)], axis=-1)
        amount = direction * np.sqrt(np.stack([looks[:, 0], 1 - looks[:, 0], 1 - looks[:, 0]], axis=-1))
        spoilt = (
            looks[:, 3] * np.interp(hidden, self.covers, self.noise) * _unevenly(np.asarray(unease, float), self.uneven)
        )
        strength = np.sqrt(spoilt / size)[:, None]
        result = np.einsum("nk,nkd->nd", amount, people) + strength * np.asarray(noise, float)
        return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True))


def _drawn(seed: int, key: tuple[str | int, ...], size: int) -> Floats:
    """Who, what front and back, and what left and right look like: vectors of about unit length, (3, D)."""
    return stream(seed, "descriptor", *key).standard_normal((3, size)) / np.sqrt(size)


def _unevenly(normal: Floats, uneven: float) -> Floats:
    """Factors about a mean of 1, log-normal, of standard normal numbers."""
    return np.exp(uneven * normal - 0.5 * uneven**2)


def _kept(noise: Floats, uneven: float) -> tuple[Floats, Floats]:
    """Of a unit vector with noise of variances (...): the mean share that is signal, and the mean of its square."""
    nodes, weights = hermegauss(15)
    variance = noise[..., None] * _unevenly(nodes, uneven)
    weights = weights / weights.sum()
    return (1 / np.sqrt(1 + variance)) @ weights, (1 / (1 + variance)) @ weights


def _middles(edges: Floats) -> Floats:
    return 0.5 * (edges[1:] + edges[:-1])


def _cosine_deviation(summary: Mapping[str, Any], quantiles: Sequence[float]) -> float:
    """Deviation of the cosines whose distances have the quantiles of a summary."""
    ranks = (np.arange(1000) + 0.5) / 1000
    return float(np.std(1 - np.interp(ranks, quantiles, summary["quantiles"]) ** 2 / 2))
