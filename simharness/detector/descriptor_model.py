"""Descriptors without pictures: drawn so that their distances are what a re-ID network's are.

A descriptor is a unit vector in the direction of

    who (as alike as the scene's people are)  +  from where (what front, side and back show)  +  noise

Seen from bearings that are t apart, a person's signals have the cosine a + b cos t + c cos 2t, a + b + c = 1: what b
stands for differs most between front and back, what c stands for between either and the sides, as outlines do. All
three are positive, so there are vectors like that for any set of bearings.

How much of each there is, and in how many dimensions, follows from the distances that were measured when the network
was trained and that its card states: of one person and of two, by the angle between the bearings from which the two
crops see their people, by how much of the person is hidden, and by the ``look_alike`` dial.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from mvpose.arrays import Floats
from mvpose.networks.session import check_content
from simharness.types.random_streams import stream

_FEWEST, _MOST = 6, 256  # dimensions
_PARTS = 5  # of a person's signal: one for who it is, two for each wave of the bearing


@dataclass(frozen=True)
class Look:
    """What descriptors are made of, at one value of the dial.

    Attributes:
        who: share of a clear crop's variance that says who it is; the rest says from where it is seen.
        facing: share of that rest that tells front from back; what is left tells both from the sides.
        alike: how much of who they are the people of a scene have in common.
        alike_sides: the same of what their sides look like.
        noise: how much noise there is, beside that at other values of the dial.
    """

    who: float
    facing: float
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
        common: share of the noise's variance that all crops have in common, as what hides people looks alike: hidden
            crops of two people are as near as clear ones, though less of either is seen.
    """

    dimensions: int
    dials: tuple[float, ...]
    looks: tuple[Look, ...]
    covers: tuple[float, ...]
    noise: tuple[float, ...]
    uneven: float
    common: float

    @classmethod
    def of_network(cls, model: Path) -> Self:
        """The model of a network, from the card beside its file.

        Raises:
            ValueError: there is no card, it states no distances, or it is that of another network.
        """
        path = model.with_suffix(".json")
        if model.is_file():  # distances can be drawn without the network, but not with another's card
            check_content(model)
        try:
            card = json.loads(path.read_text(encoding="utf-8"))
            return cls.fitted(card["distances"])
        except (OSError, json.JSONDecodeError, KeyError, TypeError) as error:
            raise ValueError(
                f"{path}: no card with the distances of {model.name} ({error}); they are measured by "
                "python -m tools.reid. For a network without them take descriptors from pictures"
            ) from None

    @classmethod
    def fitted(cls, distances: Mapping[str, Any]) -> Self:
        """Fit the model to measured distances: ``distances`` of a card (:mod:`tools.reid.metrics`).

        Least squares over the mean cosines of all bins, each weighed by its pairs' share in its kind, and over how the
        cosines of one person's pairs spread.
        """
        edges = np.array(distances["hidden_share_of_the_joints_of_the_worse_crop"])
        turns = _waves(np.deg2rad(distances["view_difference_degrees"]))
        measured = {float(dial): kinds for dial, kinds in distances["look_alike"].items()}
        dials = sorted(measured)
        covers = len(edges) - 1
        better = _better(measured, covers)
        cells = [
            (d, kind == "same", v, h, bin_["cosine"], bin_["pairs"] / measured[dial][kind]["all"]["pairs"])
            for d, dial in enumerate(dials)
            for kind in ("same", "other")
            for v, row in enumerate(measured[dial][kind]["bins"])
            for h, bin_ in enumerate(row)
            if bin_["pairs"]
        ]
        d, same, v, h, cosine, weight = (np.array(column) for column in zip(*cells, strict=True))
        same, turn = same.astype(bool), turns[v]
        # Two people's cosines spread as those of random directions do: that tells in how many dimensions they live.
        strangers = measured[dials[0]]["other"]["all"]
        free = (1 - strangers["cosine"] ** 2) / _cosine_deviation(strangers, distances["quantiles"])
        dimensions = int(np.clip(round(free**2), _FEWEST, _MOST))
        spread = np.array([_cosine_deviation(measured[dial]["same"]["all"], distances["quantiles"]) for dial in dials])

        def parts(x: Floats) -> tuple[Floats, Floats, Floats, float, float]:
            shares = (1 / (1 + np.exp(-x[: 4 * len(dials)]))).reshape(4, -1)
            louder = np.exp(np.append(0.0, x[4 * len(dials) : 5 * len(dials) - 1]))
            noise = np.cumsum(np.exp(x[5 * len(dials) - 1 : -2]))
            return shares, louder, noise, float(abs(x[-2])), float(1 / (1 + np.exp(-x[-1])))

        def misfit(x: Floats) -> Floats:
            (who, facing, alike, sides), louder, noise, uneven, common = parts(x)
            turned = (1 - who[d]) * (facing[d] * turn[:, 0] + (1 - facing[d]) * turn[:, 1])
            signal = np.where(same, 1.0, alike[d]) * who[d] + np.where(same, 1.0, sides[d]) * turned
            once, twice, lost = _kept(louder[:, None] * noise, uneven)
            kept = signal * once[d, h] * (once @ better)[d, h]
            mean = kept + common * lost[d, h] * (lost @ better)[d, h]
            # The law of total variance: within bins that of unlike noise and of few dimensions, and between them.
            variance = signal**2 * (twice[d, h] * (twice @ better)[d, h]) - kept**2 + (1 - mean**2) ** 2 / dimensions
            share = weight * same / len(dials)
            total = np.array([(share * (d == k)).sum() for k in range(len(dials))])
            center = np.array([(share * (d == k) * mean).sum() for k in range(len(dials))]) / total
            second = np.array([(share * (d == k) * (variance + mean**2)).sum() for k in range(len(dials))]) / total
            return np.concatenate([np.sqrt(weight) * (mean - cosine), np.sqrt(second - center**2) - spread])

        none, up = np.zeros(len(dials)), np.linspace(-2, 2, len(dials))
        start = np.concatenate([none + 1.5, none, up, none])
        start = np.concatenate([start, np.zeros(len(dials) - 1), np.log(np.full(covers, 0.1)), [0.5, -3.0]])
        shares, louder, noise, uneven, common = parts(least_squares(misfit, start).x)
        looks = tuple(Look(*map(float, each)) for each in zip(*shares, louder, strict=True))
        middles = tuple(map(float, _middles(edges)))
        return cls(dimensions, tuple(dials), looks, middles, tuple(map(float, noise)), uneven, common)

    def look(self, look_alike: ArrayLike) -> Floats:
        """The numbers of a :class:`Look`, in their order, at values of the dial (...), interpolated, (..., 5)."""
        table = np.array([astuple(look) for look in self.looks])
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
        shares = self.look(np.broadcast_to(np.asarray(look_alike, float), count))
        is_who, facing, alike, alike_sides, louder = shares.T
        everyone, keys = _drawn(seed, ("all",), size), dict.fromkeys(who)
        drawn = np.array([_drawn(seed, key, size) for key in keys]).reshape(-1, _PARTS, size)
        place = {key: k for k, key in enumerate(keys)}
        own = drawn[np.array([place[key] for key in who], int)]
        shared = np.stack([alike, *[alike_sides] * (_PARTS - 1)], axis=-1)[..., None]
        people = np.sqrt(shared) * everyone + np.sqrt(1 - shared) * own
        direction = [np.ones(count), *(wave(k * bearing) for k in (1, 2) for wave in (np.cos, np.sin))]
        back, side = (1 - is_who) * facing, (1 - is_who) * (1 - facing)
        amount = np.stack(direction, axis=-1) * np.sqrt(np.stack([is_who, back, back, side, side], axis=-1))
        spoilt = louder * np.interp(hidden, self.covers, self.noise)
        spoilt = spoilt * _unevenly(np.asarray(unease, float), self.uneven)
        strength = np.sqrt(spoilt / size)[:, None]
        signal = np.einsum("nk,nkd->nd", amount, people)  # of unit length but for what chance adds in few dimensions
        cover = stream(seed, "descriptor", "cover").standard_normal(size)
        spoiling = np.sqrt(self.common) * cover + np.sqrt(1 - self.common) * np.asarray(noise, float)
        return _unit(_unit(signal) + strength * spoiling)


def _drawn(seed: int, key: tuple[str | int, ...], size: int) -> Floats:
    """Who it is, and how that looks by cos t, sin t, cos 2t and sin 2t: vectors of about unit length, (5, D)."""
    return stream(seed, "descriptor", *key).standard_normal((_PARTS, size)) / np.sqrt(size)


def _waves(edges: Floats) -> Floats:
    """Means of cos t and cos 2t between edges (b + 1,), (b, 2)."""
    return np.stack([np.diff(np.sin(k * edges)) / (k * np.diff(edges)) for k in (1, 2)], axis=-1)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _unevenly(normal: Floats, uneven: float) -> Floats:
    """Factors about a mean of 1, log-normal, of standard normal numbers."""
    return np.exp(uneven * normal - 0.5 * uneven**2)


def _kept(noise: Floats, uneven: float) -> tuple[Floats, Floats, Floats]:
    """Of a unit vector with noise of variances (...): mean length and square of the signal, mean length of noise."""
    nodes, weights = hermegauss(15)
    variance = noise[..., None] * _unevenly(nodes, uneven)
    weights = weights / weights.sum()
    kept = 1 / (1 + variance)
    return np.sqrt(kept) @ weights, kept @ weights, np.sqrt(1 - kept) @ weights


def _better(measured: Mapping[float, Any], covers: int) -> Floats:
    """Where the better of two crops is, whose worse one is in some bin of hidden shares: columns add up to 1, (h, h).

    As if both crops of a pair were hidden independently: then the worse one's distribution is the square of either's.
    """
    rows = [row for kinds in measured.values() for kind in ("same", "other") for row in kinds[kind]["bins"]]
    pairs = np.array([[bin_["pairs"] for bin_ in row] for row in rows], float).sum(axis=0)
    single = np.diff(np.sqrt(np.cumsum(pairs) / pairs.sum()), prepend=0.0)
    chances = np.triu(np.broadcast_to(single[:, None], (covers, covers)), 1) * 2 + np.diag(single)
    return np.asarray(chances / np.maximum(chances.sum(axis=0), 1e-9))


def _middles(edges: Floats) -> Floats:
    return 0.5 * (edges[1:] + edges[:-1])


def _cosine_deviation(summary: Mapping[str, Any], quantiles: Sequence[float]) -> float:
    """Deviation of the cosines whose distances have the quantiles of a summary."""
    ranks = (np.arange(1000) + 0.5) / 1000
    return float(np.std(1 - np.interp(ranks, quantiles, summary["quantiles"]) ** 2 / 2))
