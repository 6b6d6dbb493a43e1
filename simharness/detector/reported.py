"""Which joints a detector reports, by occlusion and for the face by the bearing of the camera; and guesses.

A guess is the most likely place of a joint, given the joints that the detector localises. People's poses in the picture
are Gaussian here, with one mean and covariance for each of twelve bearings of the camera from the trunk. They come from
the simulated motions of all activities (``tools.poses``). The guess is the mean of the joint's place given the places
of the localised joints of the same person in the same view, so two views of an unusual pose err together.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.kernels import njit
from simharness.detector.draws import IN_TREE, ErrorDraws, logistic, with_parents
from simharness.detector.viewing_conditions import (
    OCCLUDED,
    OUTSIDE,
    SELF_OCCLUDED,
    SIDE,
    VISIBLE,
    Conditions,
    at_edges,
    head_bearings,
    trunk_depths,
)
from simharness.scenario.sections.detector_section import (
    KIND_OF_JOINT,
    KINDS,
    DropSection,
    EdgeSection,
    FaceSection,
    KeypointsSection,
)


@dataclass(frozen=True)
class Reported:
    """Joints of one person that are reported."""

    joints: Bools
    """Which joints are reported, (T, V, J)."""
    guessed: Bools
    """Which of them are guesses, (T, V, J)."""
    at_border: Bools
    """Which of them are outside the images, but so near that they are found at the border, (T, V, J)."""


class ReportedJoints:
    """Draws which joints of one person after the other are reported; the shares are computed once."""

    def __init__(
        self,
        target: Floats,
        conditions: Conditions,
        joints: Floats,
        rig: Rig,
        config: KeypointsSection,
        errors: ErrorDraws,
    ) -> None:
        """Compute the shares.

        Args:
            target: true places of the joints for the detector, (T, V, P, J, 2) pixels.
            conditions: viewing conditions.
            joints: true joints in the world, (T, P, J, 3) metres.
            rig: true rig of the V cameras.
            config: shares of drops and guesses.
            errors: draws of the errors.
        """
        self._target, self._conditions, self._border, self._errors = target, conditions, config.border, errors
        self._last = last_pixels(rig)
        head = head_bearings(joints, rig) if config.face != FaceSection() else None
        depth = trunk_depths(joints, rig) if config.drop.depth else None
        self._drop = drop_shares(config.drop, config.face, conditions.occlusion, head, depth)
        guess = config.guess
        by_occlusion = (guess.visible, guess.self_occluded, guess.occluded, guess.outside)
        self._guess = np.array([shares.by_joint() for shares in by_occlusion])

    def of_person(self, person: int) -> Reported:
        """Return which joints of a person are reported."""
        occlusion = self._conditions.occlusion[:, :, person]
        outside = occlusion == OUTSIDE
        at_border = self._near_border(person) & outside
        guessed = self._errors.occurs("guess", person, self._guess[occlusion, np.arange(occlusion.shape[-1])])
        guessed &= ~at_border
        dropped = self._errors.occurs("drop", person, self._drop[:, :, person])
        joints = np.where(outside & ~at_border, guessed, ~dropped)
        if self._errors.tree:
            joints = with_parents(joints)
        joints &= (joints & ~outside).any(axis=-1, keepdims=True)  # nobody is detected wholly outside the image
        return Reported(joints, guessed & joints, at_border & joints)

    def _near_border(self, person: int) -> Bools:
        """Return which joints are at most the configured distance outside the images, (T, V, J)."""
        unit = self._conditions.unit[:, :, person]
        if not self._border:
            return np.zeros(unit.shape, bool)
        return beyond_border(self._target[:, :, person], unit, self._last) <= self._border


def beyond_border(joints: Floats, unit: Floats, last: Floats) -> Floats:
    """Return the distance of joints in pictures from the image, (..., J); 0 inside.

    In mean units of the limb joints, also for the face: how far beyond the border a network sees depends on the size of
    people, not on how exactly joints are annotated.

    Args:
        joints: (..., J, 2) pixels.
        unit: OKS sigma x sqrt(area) of each, (..., J) pixels.
        last: last columns and rows, which pair with the joints.
    """
    away = joints - np.clip(joints, 0.0, last)
    with np.errstate(invalid="ignore", divide="ignore"):
        far = np.hypot(away[..., 0], away[..., 1]) / unit[..., IN_TREE].mean(axis=-1, keepdims=True)
    return np.nan_to_num(far, nan=np.inf)


def last_pixels(rig: Rig) -> Floats:
    """Return the last column and row of the images of V cameras, (V, 1, 2) pixels."""
    return np.array([camera.size for camera in rig], float)[:, None] - 1


_BEHIND = 0.2  # metres behind the middle of the trunk, from the side, at which the shares of drops hold


def drop_shares(
    drop: DropSection,
    face: FaceSection,
    occlusion: NDArray[np.int8],
    bearings: Floats | None,
    depth: Floats | None = None,
) -> Floats:
    """Return the share of each joint that is not reported, (T, V, P, 17); for joints outside the image any value.

    Args:
        drop: shares by occlusion.
        face: shares of the face by bearing.
        occlusion: occlusion classes of the joints, (T, V, P, 17).
        bearings: bearings of the cameras from the heads, (T, V, P), radians to the left of straight ahead; None if
            ``face`` has no shares.
        depth: depth of the joints behind the middle of the trunk from the side, (T, V, P, 17) metres; None: no effect.
    """
    table = np.array([shares.by_joint() for shares in (drop.visible, drop.self_occluded, drop.occluded)])
    result = table[np.where(occlusion == OUTSIDE, VISIBLE, occlusion), np.arange(occlusion.shape[-1])]
    if drop.edge != EdgeSection():
        factors = np.ones(4)
        factors[[SELF_OCCLUDED, OCCLUDED]] = drop.edge.self_occluded, drop.edge.occluded
        result = np.where(at_edges(occlusion), factors[occlusion], 1.0) * result
    if depth is not None:
        deep = (occlusion == SELF_OCCLUDED) & IN_TREE
        result[deep] = logistic(result[deep], drop.depth * (depth[deep] - _BEHIND))
    if bearings is None:
        return result
    for joint, kind in enumerate(KIND_OF_JOINT):
        shares = getattr(face, KINDS[kind], None)
        if shares is not None:
            unhidden = occlusion[..., joint] != OCCLUDED
            result[..., joint] = np.where(unhidden, _by_bearing(shares, SIDE[joint] * bearings), result[..., joint])
    return result


def _by_bearing(shares: tuple[float, ...], bearings: Floats) -> Floats:
    """Return shares interpolated at bearings (...), radians."""
    return np.interp(bearings, np.linspace(0, 2 * np.pi, len(shares), endpoint=False), shares, period=2 * np.pi)


DATA = Path(__file__).parent / "data" / "poses_in_pictures.npz"
"""Means and covariances, made by ``python -m tools.poses``."""

POSE_BEARINGS = 12
"""Number of bearings of the camera from the trunk, in equal steps from straight ahead towards the left."""

_LOCALISED = 0.03  # deviation of localised joints from their true places, metres
_PLACE = 1.0  # deviation of a person from the given centre, metres: wide, so that localised joints determine the place


@dataclass(frozen=True)
class PosesInPictures:
    """Distribution of poses in pictures by the bearing of the camera from the trunk."""

    mean: Floats
    """Joints right and down of the mean of all joints, (BEARINGS, 34), metres: x and y of joint after joint."""
    covariance: Floats
    """Covariance of these numbers, (BEARINGS, 34, 34)."""

    def between(self, bearings: Floats) -> tuple[Integers, Floats]:
        """Return the index of the bearing before each of n bearings, radians, and the weight of the next, (n,) each.

        Means and covariances at other bearings are linear between those of the table; the next follows after the last.
        """
        place = np.mod(bearings, 2 * np.pi) * (POSE_BEARINGS / (2 * np.pi))
        return place.astype(int) % POSE_BEARINGS, place - np.floor(place)


@cache
def poses_in_pictures() -> PosesInPictures:
    """Return the distribution of poses that ships with the package."""
    with np.load(DATA) as file:
        return PosesInPictures(file["mean"].astype(float), file["covariance"].astype(float))


def guess_places(places: ArrayLike, localised: ArrayLike, *, bearings: Floats, scale: Floats, center: Floats) -> Floats:
    """Return the most likely places of the joints that are not localised, given those that are, (n, 17, 2) pixels.

    Localised joints keep their places. The places of the others are not read.

    Args:
        places: COCO-17 joints of n people in pictures, (n, 17, 2) pixels.
        localised: which of them the detector localises, (n, 17).
        bearings: bearings of the cameras from the trunks, (n,), radians to the left of straight ahead
            (:func:`simharness.detector.viewing_conditions.bearings`).
        scale: pixels per metre at each person, (n,).
        center: rough middle of each person, (n, 2) pixels; it counts only where few joints are localised.
    """
    places, localised = np.asarray(places, float), np.asarray(localised, bool)
    relative = (places - center[:, None]) / scale[:, None, None]
    prior = poses_in_pictures()
    low, share = prior.between(bearings)
    fill_in(relative, localised, low, share, prior.mean, prior.covariance, _PLACE**2, _LOCALISED**2)
    return np.where(localised[..., None], places, center[:, None] + scale[:, None, None] * relative)


def pixels_per_metre(joints: Floats, rig: Rig, usable: Bools) -> Floats:
    """Return the scale of one person's pictures at the mean depth of some joints, (T, V).

    Args:
        joints: joints in the world, (T, 17, 3) metres.
        rig: the V cameras.
        usable: joints of which the depth is used, (T, V, 17); all where none is.
    """
    usable = usable | ~usable.any(axis=-1, keepdims=True)
    depth = np.stack([(joints - camera.center) @ camera.R[2] for camera in rig], axis=1)
    mean = (depth * usable).sum(axis=-1) / usable.sum(axis=-1)
    return np.array([camera.K[0, 0] for camera in rig]) / np.maximum(mean, 1e-3)


@njit(cache=True)
def fill_in(
    places: np.ndarray,
    localised: np.ndarray,
    low: np.ndarray,
    share: np.ndarray,
    means: np.ndarray,
    covariances: np.ndarray,
    place_variance: float,
    joint_variance: float,
) -> None:
    """Replace the places of joints that are not localised by their mean given the others, in place.

    The equations of the localised joints are solved by the decomposition of Cholesky, row by row of its upper factor:
    all inner loops run along rows, so that the compiler vectorises them without reordering sums.

    Args:
        places: joints of n people, (n, J, 2), metres from the centre of each person.
        localised: which of them are given, (n, J).
        low: bearing before that of each person, (n,), as index of ``means``; the next follows after the last.
        share: weight of the next bearing, (n,).
        means: mean of x and y of all joints, for each bearing, (B, 2 J).
        covariances: their covariance, (B, 2 J, 2 J).
        place_variance: variance of the centre, added to that of all x and of all y.
        joint_variance: variance of localised joints about their true places.
    """
    count, joints = localised.shape
    factor, solved = np.zeros((2 * joints, 2 * joints)), np.zeros(2 * joints)
    given = np.zeros(2 * joints, np.int64)
    for n in range(count):
        size = 0
        for j in range(joints):
            if localised[n, j]:
                given[size], given[size + 1] = 2 * j, 2 * j + 1
                size += 2
        if size == 2 * joints:
            continue
        one, other, weight = low[n], (low[n] + 1) % len(means), share[n]
        mean, mean_step, before, after = means[one], means[other], covariances[one], covariances[other]
        for i in range(size):
            a = given[i]
            solved[i] = places[n, a // 2, a % 2] - (mean[a] + weight * (mean_step[a] - mean[a]))
            for k in range(i, size):
                b = given[k]
                factor[i, k] = before[a, b] + weight * (after[a, b] - before[a, b])
                factor[i, k] += place_variance if (a - b) % 2 == 0 else 0.0
            factor[i, i] += joint_variance
        for i in range(size):
            scale = 1.0 / math.sqrt(factor[i, i])
            for k in range(i, size):
                factor[i, k] *= scale
            for k in range(i + 1, size):
                lead = factor[i, k]
                for m in range(k, size):
                    factor[k, m] -= lead * factor[i, m]
            solved[i] *= scale
            lead = solved[i]
            for k in range(i + 1, size):
                solved[k] -= lead * factor[i, k]
        for i in range(size - 1, -1, -1):
            total = solved[i]
            for k in range(i + 1, size):
                total -= factor[i, k] * solved[k]
            solved[i] = total / factor[i, i]
        for j in range(joints):
            if localised[n, j]:
                continue
            for axis in range(2):
                a = 2 * j + axis
                total = mean[a] + weight * (mean_step[a] - mean[a])
                for k in range(size):
                    b = given[k]
                    value = before[a, b] + weight * (after[a, b] - before[a, b])
                    total += (value + (place_variance if (a - b) % 2 == 0 else 0.0)) * solved[k]
                places[n, j, axis] = total
