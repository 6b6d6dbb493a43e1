"""Types of the sums from which the parameters of a detector are estimated.

The first axis of every array, written ..., is that of the T frames, or of R resamples of them.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from mvpose.arrays import Floats
from simharness.statistics.resampling import resampled


class Trials(NamedTuple):
    """Trials ``n`` and events among them ``k``, both (...) or with further axes."""

    n: Floats
    k: Floats


class MissSums(NamedTuple):
    """Misses of limbs: all, those beyond their reach, and the shares of the boxes beyond 2.35 and beyond the reach."""

    n: Floats
    beyond: Floats
    box: Floats
    box_beyond: Floats


class ScatterSums(NamedTuple):
    """Good keypoints: number and squares by kind of joint, (..., 9), of all and of those not visible.

    Products with frames a lag later and the mean of both squares, (..., L); the same of neighbouring joints, (...).
    """

    n: Floats
    square: Floats
    hidden_n: Floats
    hidden_square: Floats
    later: Floats
    later_square: Floats
    near: Floats
    near_square: Floats


class JitterSums(NamedTuple):
    """Jitters, and the sum of their distances as shares of the way from 1.14 to 2.35, by kind of joint, (..., 9)."""

    n: Floats
    way: Floats


class PairSums(NamedTuple):
    """Pairs of joints that a class took, (...), and those expected for each correlation of the grid, (..., G)."""

    k: Floats
    expected: Floats


class DependenceSums(NamedTuple):
    """Joints taken by the same class: pairs over views, GROSS classes apart, and within limbs.

    ``excess`` and ``weight``, (..., L): products of the deviations from the expectation a lag apart, and their value at
    full correlation. The expectation is the rate for the kind of joint and its occlusion class.
    """

    views: PairSums
    gross_views: PairSums
    limb: PairSums
    excess: Floats
    weight: Floats


class ScoreHistograms(NamedTuple):
    """Histograms of scores on the logit scale: by visibility, class and kind of joint, (..., 2, 6, 9, B).

    Those of false detections, and of joints outside of the image, (..., B) each.
    """

    shown: Floats
    false: Floats
    outside: Floats


class PeopleSums(NamedTuple):
    """People expected and missed: all, (...); by the hidden share of their limb joints, (..., 5); pairs of views
    of one person; the same again a lag later, (..., L). People detected, and their duplicates, (...).
    """

    all: Trials
    hidden: Trials
    views: Trials
    time: Trials
    detected: Floats
    duplicates: Floats


class FalseSums(NamedTuple):
    """False detections by view, (..., V), fragments of people, (...), products of numbers a lag apart and pairs of
    frames, (..., V, 1 + L) and (..., 1 + L), first without a lag.
    """

    n: Floats
    fragments: Floats
    products: Floats
    pairs: Floats


class BoneSums(NamedTuple):
    """Limb lengths on which three views or more agree, for each person and bone, (..., P, B), in metres.

    Number, length less the usual one, and its square; the variance expected from errors of one unit in each view, and
    the squared size of a unit at the joints, (...).
    """

    n: Floats
    length: Floats
    square: Floats
    noise: Floats
    scale: Floats


class FrameSums(NamedTuple):
    """Sums of all that the parameters of a detector are estimated from."""

    classes: Mapping[str, Trials]
    """Joints that each class of errors could have taken and took, by occlusion class and kind, (..., 3, 9)."""
    edge: Trials
    """Limb joints that may be dropped, and those dropped, of the hidden joints beside a visible one: self-occluded and
    occluded, by kind, (..., 2, 9)."""
    depth: Trials
    """Self-occluded limb joints that may be dropped, and those dropped, by kind and depth behind the middle of the
    trunk, from the side, (..., 9, B)."""
    face: Trials
    """Joints of the face that nobody else hides, and those not reported, by kind and bearing, (..., 3, 24)."""
    size: Trials
    """Limb joints that are reported, and those not good, by tercile of the person's size, (..., 3)."""
    size_drop: Trials
    """Limb joints that may be dropped, and those dropped, by tercile, (..., 3)."""
    apart: Trials
    """Limb joints that may be inverted, and those inverted, by the distance of their counterpart, (..., B)."""
    miss: MissSums
    """Misses of limbs."""
    scatter: ScatterSums
    """Good keypoints."""
    jitter: JitterSums
    """Jitters."""
    dependence: DependenceSums
    """Joints taken together."""
    scores: ScoreHistograms
    """Scores."""
    people: PeopleSums
    """People missed and detected."""
    false: FalseSums
    """False detections."""
    bones: BoneSums
    """Lengths of limbs."""
    border: Trials
    """Limb joints outside of the images with a reported parent, and those reported, by distance from the border,
    (..., B)."""
    outside: Trials
    """The same joints by kind, (..., 9)."""

    def total(self) -> "FrameSums":
        """Return the sums over all frames, as one resample."""
        return _mapped(self, lambda each: each.sum(axis=0, keepdims=True))

    def resampled(self, weights: Floats) -> "FrameSums":
        """Return the sums over R resamples of the frames, from their weights (R, T)."""
        return _mapped(self, lambda each: resampled(each, weights))


def _mapped(sums: Any, function: Callable[[Floats], Floats]) -> Any:
    """Return a tree of sums with a function applied to every array."""
    if isinstance(sums, Mapping):
        return {key: _mapped(each, function) for key, each in sums.items()}
    return type(sums)(*(_mapped(each, function) for each in sums)) if isinstance(sums, tuple) else function(sums)
