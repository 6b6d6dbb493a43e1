"""Descriptors of detections without pictures: they have the distances that those of a re-ID network have.

A descriptor is a unit vector in the direction of

    identity (similar as far as the people of the scene look alike)  +  bearing (front, side or back)  +  noise

Seen from bearings that are t apart, the signals of a person have the cosine a + b cos t + c cos 2t, a + b + c = 1: the
part b differs most between front and back, the part c between either of them and the sides, as outlines do. All three
are positive, so such vectors exist for any set of bearings.

The shares of these parts and the number of dimensions are fitted to distances that were measured when the network was
trained and that its card states: distances of one person and of two people, by the angle between the bearings of the
two crops, by the share of hidden joints, and by the parameter ``look_alike``.
"""

from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from mvpose.files.message_text import one_line
from mvpose.networks.card import read_card_file
from mvpose.networks.session import check_content
from simharness.detector.detection_block import Origin
from simharness.detector.draws import KeyedDraws
from simharness.detector.viewing_conditions import bearings, hidden_shares, unit
from simharness.types.random_streams import stream
from simharness.types.sequence import Sequence
from simharness.types.views import Views

# Keys of random streams: another word would be another draw.
_STREAM_KEYS: Mapping[Origin, str] = {
    Origin.PERSON: "person",
    Origin.DUPLICATE: "again",
    Origin.LOWER_HALF: "lower",
    Origin.PHANTOM: "phantom",
    Origin.DECOY: "decoy",
}


@dataclass(frozen=True)
class DescriptorSettings:
    """Settings for drawing descriptors."""

    model: "DescriptorModel"
    """Model of the descriptors of a re-ID network."""
    look_alike: float
    """How alike people are dressed, 0 to 1, for the first ``alike`` people."""
    alike: int = 0
    """Number of people who are dressed alike; 0: all."""


class DescriptorSampler:
    """Draws the descriptors of detections of people, decoys, mirror images and phantoms.

    All draws go by what is detected (origin and number), never by the position among other detections: more people,
    phantoms or duplicates change no descriptor of the other detections.

    Args:
        sequence: ground truth in space.
        views: ground truth in the pictures.
        rig: true rig.
        settings: how descriptors are drawn.
        draws: draws of the sequence.
        life: correlation time of the noise of one person's crops, seconds.
    """

    def __init__(
        self,
        sequence: Sequence,
        views: Views,
        rig: Rig,
        settings: DescriptorSettings,
        draws: KeyedDraws,
        *,
        life: float,
    ) -> None:
        self._settings, self._draws, self._life = settings, draws, life
        self._source, self._decoys = views.source, views.lookalikes.names
        self._bearing, self._hidden = bearings(sequence.joints, rig), hidden_shares(views.visibility)

    def __call__(self, frame: Integers, view: Integers, origin: NDArray[np.int8], number: Integers) -> Floats:
        """Draw the descriptors (n, D) of detections by frame, view, origin and number, (n,) each.

        Origin and number are those of :class:`DetectionBlock`.
        """
        picture = self._source[frame, view]
        real = (origin != Origin.PHANTOM) & (origin != Origin.DECOY)
        bearing, hidden = np.zeros(len(frame)), np.zeros(len(frame))
        crop = picture[real], view[real], number[real]
        bearing[real], hidden[real] = self._bearing[crop], self._hidden[crop]
        noise = self._noise(picture, view, origin, number)
        alike = self._settings.alike or self._bearing.shape[2]
        return self._settings.model.draw(
            [self._identity(Origin(kind), which) for kind, which in zip(origin.tolist(), number.tolist(), strict=True)],
            bearing=bearing,
            hidden=hidden,
            noise=noise[:, :-1],
            noise_level=noise[:, -1],
            look_alike=np.where(real & (number < alike), self._settings.look_alike, 0.0),
            seed=self._draws.seed,
        )

    def _noise(self, picture: Integers, view: Integers, origin: NDArray[np.int8], number: Integers) -> Floats:
        """Return standard normal numbers for each detection, (n, D + 1), autoregressive for one object in one view.

        All phantoms of a view share one block, because there may be a new phantom in every frame: each begins at
        another column of the block.
        """
        size = self._settings.model.dimensions + 1
        column = np.where(origin == Origin.PHANTOM, number % size, 0)
        stem = np.where(origin == Origin.PHANTOM, 0, number)
        drawn = np.empty((len(picture), size))
        for v, kind, which in np.unique(np.column_stack([view, origin, stem]), axis=0).tolist():
            rows = np.flatnonzero((view == v) & (origin == kind) & (stem == which))
            key = (self._decoys[which],) if kind == Origin.DECOY else () if kind == Origin.PHANTOM else (which,)
            name = _STREAM_KEYS[Origin(kind)]
            block = self._draws.autoregressive("descriptor", v, name, *key, shape=(size,), life=self._life)
            drawn[rows] = block[picture[rows, None], (np.arange(size) + column[rows, None]) % size]
        return drawn

    def _identity(self, origin: Origin, number: int) -> tuple[str | int, ...]:
        """Return the key of the identity that a detection shows; a phantom has the same identity in all views."""
        if origin == Origin.PHANTOM:
            return "phantom", number
        if origin != Origin.DECOY:
            return "person", number
        name = self._decoys[number]
        _, mirrored, reflected = name.partition("/person")
        return ("person", int(reflected)) if mirrored else ("decoy", name)


_FEWEST, _MOST = 6, 256  # dimensions
_PARTS = 5  # of a person's signal: one for the identity, two for each harmonic of the bearing


@dataclass(frozen=True)
class DescriptorShares:
    """Composition of descriptors at one value of ``look_alike``."""

    identity: float
    """Share of the variance of a clear crop that identifies the person; the rest depends on the bearing."""
    facing: float
    """Share of that rest that distinguishes front from back; the remainder distinguishes both from the sides."""
    alike: float
    """Share of the identity that the people of a scene have in common."""
    alike_sides: float
    """Share of the bearing part that they have in common."""
    noise: float
    """Factor of the noise, relative to the first value of ``look_alike``."""


@dataclass(frozen=True)
class DescriptorModel:
    """Fitted model of the descriptors of one network."""

    dimensions: int
    """Dimensions of drawn descriptors, such that distances spread as the network's do."""
    look_alike: tuple[float, ...]
    """Values of ``look_alike`` at which the network was measured, ascending, (d,)."""
    shares: tuple[DescriptorShares, ...]
    """Composition of descriptors at each of them, (d,)."""
    hidden: tuple[float, ...]
    """Shares of hidden joints, ascending, (h,)."""
    noise: tuple[float, ...]
    """Mean variance of the noise at these shares and the first ``look_alike``, in units of a clear crop's variance,
    (h,)."""
    uneven: float
    """Standard deviation of the logarithm of that variance from crop to crop."""
    common: float
    """Share of the noise's variance that all crops have in common, because occluders look alike: hidden crops of two
    people are as near as clear ones, though less of either person is seen."""

    @classmethod
    def of_network(cls, model: Path) -> Self:
        """Return the model of a network, fitted to the card beside its file.

        Raises:
            ValueError: there is no card, it states no distances, or it belongs to another network.
        """
        path = model.with_suffix(".json")
        if model.is_file():  # the file may be missing, but the card must not be another network's
            check_content(model)
        card = read_card_file(model)
        try:
            if card is None:
                raise ValueError("no such file")
            with np.errstate(invalid="raise"):
                return cls.fitted(card["distances"])
        except Exception as error:  # of another form, in any of many ways
            why = one_line(f"{type(error).__name__}: {error}", 160)
            raise ValueError(
                f"{path}: expected a card with the distances of {model.name}, got none ({why}); measure them with "
                'python -m tools.reid, or set appearance.source = "pictures"'
            ) from None

    @classmethod
    def fitted(cls, distances: Mapping[str, Any]) -> Self:
        """Return the model fitted to measured distances: ``distances`` of a card (``tools.reid.metrics``).

        Least squares over the mean cosines of all bins, each weighted by its share of the pairs of its kind, and over
        the standard deviations of the cosines of each kind's pairs.
        """
        edges = np.array(distances["hidden_share_of_the_joints_of_the_worse_crop"])
        turns = _waves(np.deg2rad(distances["view_difference_degrees"]))
        measured = {float(level): kinds for level, kinds in distances["look_alike"].items()}
        _check_ranges(distances["quantiles"], measured)
        levels = sorted(measured)
        bins = len(edges) - 1
        better = _better(measured, bins)
        cells = [
            (d, kind == "same", v, h, bin_["cosine"], bin_["pairs"] / measured[level][kind]["all"]["pairs"])
            for d, level in enumerate(levels)
            for kind in ("same", "other")
            for v, row in enumerate(measured[level][kind]["bins"])
            for h, bin_ in enumerate(row)
            if bin_["pairs"]
        ]
        d, same, v, h, cosine, weight = (np.array(column) for column in zip(*cells, strict=True))
        same, turn = same.astype(bool), turns[v]
        # Cosines of two people spread as those of random directions: their spread determines the number of dimensions.
        others = measured[levels[0]]["other"]["all"]
        free = (1 - others["cosine"] ** 2) / _cosine_deviation(others, distances["quantiles"])
        dimensions = int(np.clip(round(free**2), _FEWEST, _MOST))
        spread = np.array(
            [
                _cosine_deviation(measured[level][kind]["all"], distances["quantiles"])
                for level in levels
                for kind in ("same", "other")
            ]
        )
        share = np.array([weight * (d == k) * (same == one) for k in range(len(levels)) for one in (True, False)])
        share /= share.sum(axis=1, keepdims=True)

        def unpack(x: Floats) -> tuple[Floats, Floats, Floats, float, float]:
            shares = (1 / (1 + np.exp(-x[: 4 * len(levels)]))).reshape(4, -1)
            louder = np.exp(np.append(0.0, x[4 * len(levels) : 5 * len(levels) - 1]))
            noise = np.cumsum(np.exp(x[5 * len(levels) - 1 : -2]))
            return shares, louder, noise, float(abs(x[-2])), float(1 / (1 + np.exp(-x[-1])))

        def misfit(x: Floats) -> Floats:
            (identity, facing, alike, sides), louder, noise, uneven, common = unpack(x)
            turned = (1 - identity[d]) * (facing[d] * turn[:, 0] + (1 - facing[d]) * turn[:, 1])
            signal = np.where(same, 1.0, alike[d]) * identity[d] + np.where(same, 1.0, sides[d]) * turned
            once, twice, lost = _kept(louder[:, None] * noise, uneven)
            kept = signal * once[d, h] * (once @ better)[d, h]
            mean = kept + common * lost[d, h] * (lost @ better)[d, h]
            # Law of total variance: within bins from uneven noise and few dimensions, and between bins.
            variance = signal**2 * (twice[d, h] * (twice @ better)[d, h]) - kept**2 + (1 - mean**2) ** 2 / dimensions
            deviation = np.sqrt(share @ (variance + mean**2) - (share @ mean) ** 2)
            return np.concatenate([np.sqrt(weight) * (mean - cosine), deviation - spread])

        none, up = np.zeros(len(levels)), np.linspace(-2, 2, len(levels))
        start = np.concatenate([none + 1.5, none, up, none])
        start = np.concatenate([start, np.zeros(len(levels) - 1), np.log(np.full(bins, 0.1)), [0.5, -3.0]])
        shares, louder, noise, uneven, common = unpack(least_squares(misfit, start).x)
        composition = tuple(DescriptorShares(*map(float, each)) for each in zip(*shares, louder, strict=True))
        middles = tuple(map(float, 0.5 * (edges[1:] + edges[:-1])))
        return cls(dimensions, tuple(levels), composition, middles, tuple(map(float, noise)), uneven, common)

    def shares_at(self, look_alike: ArrayLike) -> Floats:
        """Return the fields of :class:`DescriptorShares`, interpolated at values (...) of ``look_alike``, (..., 5)."""
        table = np.array([astuple(each) for each in self.shares])
        level = np.asarray(look_alike, float)
        return np.stack([np.interp(level, self.look_alike, column) for column in table.T], axis=-1)

    def draw(
        self,
        identity: Many[tuple[str | int, ...]],
        *,
        bearing: ArrayLike,
        hidden: ArrayLike,
        noise: ArrayLike,
        noise_level: ArrayLike,
        look_alike: ArrayLike,
        seed: int,
    ) -> Floats:
        """Draw descriptors of n crops.

        Args:
            identity: key of the person or object that each crop shows, (n,); equal keys are one identity.
            bearing: bearing of the camera from the person, radians about the vertical, (n,).
            hidden: share of hidden joints, (n,).
            noise: noise of each crop, standard normal, (n, D).
            noise_level: how strong the noise of each crop is, standard normal, (n,).
            look_alike: how alike the crop's person is dressed to the others, (n,), or one value for all.
            seed: seed of the scenario.

        Returns:
            Unit vectors, (n, D).
        """
        size, count = self.dimensions, len(identity)
        bearing, hidden = np.asarray(bearing, float), np.asarray(hidden, float)
        shares = self.shares_at(np.broadcast_to(np.asarray(look_alike, float), count))
        of_identity, facing, alike, alike_sides, louder = shares.T
        everyone, keys = _drawn(seed, ("all",), size), dict.fromkeys(identity)
        drawn = np.array([_drawn(seed, key, size) for key in keys]).reshape(-1, _PARTS, size)
        place = {key: k for k, key in enumerate(keys)}
        individual = drawn[np.array([place[key] for key in identity], int)]
        shared = np.stack([alike, *[alike_sides] * (_PARTS - 1)], axis=-1)[..., None]
        people = np.sqrt(shared) * everyone + np.sqrt(1 - shared) * individual
        direction = [np.ones(count), *(wave(k * bearing) for k in (1, 2) for wave in (np.cos, np.sin))]
        back, side = (1 - of_identity) * facing, (1 - of_identity) * (1 - facing)
        amount = np.stack(direction, axis=-1) * np.sqrt(np.stack([of_identity, back, back, side, side], axis=-1))
        variance = louder * np.interp(hidden, self.hidden, self.noise)
        variance = variance * _unevenly(np.asarray(noise_level, float), self.uneven)
        strength = np.sqrt(variance / size)[:, None]
        signal = np.einsum("nk,nkd->nd", amount, people)  # of unit length except for chance in few dimensions
        common = stream(seed, "descriptor", "cover").standard_normal(size)
        noise_vector = np.sqrt(self.common) * common + np.sqrt(1 - self.common) * np.asarray(noise, float)
        return unit(unit(signal) + strength * noise_vector)


def _drawn(seed: int, key: tuple[str | int, ...], size: int) -> Floats:
    """Return the vectors of an identity and of cos t, sin t, cos 2t and sin 2t, of about unit length, (5, D)."""
    return stream(seed, "descriptor", *key).standard_normal((_PARTS, size)) / np.sqrt(size)


def _waves(edges: Floats) -> Floats:
    """Return the means of cos t and cos 2t between edges (b + 1,), (b, 2)."""
    return np.stack([np.diff(np.sin(k * edges)) / (k * np.diff(edges)) for k in (1, 2)], axis=-1)


def _unevenly(normal: Floats, uneven: float) -> Floats:
    """Return log-normal factors of mean 1 from standard normal numbers."""
    return np.exp(uneven * normal - 0.5 * uneven**2)


def _kept(noise: Floats, uneven: float) -> tuple[Floats, Floats, Floats]:
    """Return mean and mean square of the signal and the mean length of the noise, for noise variances (...)."""
    nodes, weights = hermegauss(15)
    variance = noise[..., None] * _unevenly(nodes, uneven)
    weights = weights / weights.sum()
    kept = 1 / (1 + variance)
    return np.sqrt(kept) @ weights, kept @ weights, np.sqrt(1 - kept) @ weights


def _better(measured: Mapping[float, Any], bins: int) -> Floats:
    """Return the distribution of the better crop over bins of hidden shares, given the worse one, (h, h).

    Columns sum to 1. Both crops of a pair are assumed to be hidden independently: then the distribution of the worse
    one is the square of that of a single crop.
    """
    rows = [row for kinds in measured.values() for kind in ("same", "other") for row in kinds[kind]["bins"]]
    pairs = np.array([[bin_["pairs"] for bin_ in row] for row in rows], float).sum(axis=0)
    single = np.diff(np.sqrt(np.cumsum(pairs) / pairs.sum()), prepend=0.0)
    probability = np.triu(np.broadcast_to(single[:, None], (bins, bins)), 1) * 2 + np.diag(single)
    return np.asarray(probability / np.maximum(probability.sum(axis=0), 1e-9))


def _check_ranges(ranks: Many[float], measured: Mapping[float, Any]) -> None:
    """Raise a ValueError for ranks, distances or cosines that no measurement gives: the fit to them may not end."""
    if not (np.diff([0.0, *ranks, 1.0]) >= 0).all():
        raise ValueError("quantiles must increase from 0 to 1")
    for kind in (summary for kinds in measured.values() for summary in kinds.values()):
        if not (np.diff([0.0, *kind["all"]["quantiles"], 2.0]) >= 0).all():
            raise ValueError("distances must increase with their quantiles, from 0 to 2")
        cosines = [kind["all"]["cosine"], *(each["cosine"] for row in kind["bins"] for each in row if each["pairs"])]
        if not (np.abs(cosines) <= 1).all():
            raise ValueError("cosines must be between -1 and 1")


def _cosine_deviation(summary: Mapping[str, Any], quantiles: Many[float]) -> float:
    """Return the standard deviation of cosines whose distances have the quantiles of a summary."""
    ranks = (np.arange(1000) + 0.5) / 1000
    return float(np.std(1 - np.interp(ranks, quantiles, summary["quantiles"]) ** 2 / 2))
