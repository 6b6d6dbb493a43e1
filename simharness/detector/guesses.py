"""Guesses of joints that a detector cannot see: the most likely place, given the joints that it localises.

People's poses in the picture are Gaussian here, with one mean and covariance for each of twelve bearings of the camera
from the trunk. They come from the simulated motions of all activities (``tools.poses``). The guess is the mean of
the joint's place given the places of the localised joints of the same person in the same view, so two views of an
unusual pose err together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from simharness.detector.guess_kernels import fill_in

DATA = Path(__file__).parent / "data" / "poses_in_pictures.npz"
"""Means and covariances, made by ``python -m tools.poses``."""

BEARINGS = 12
"""Number of bearings of the camera from the trunk, in equal steps from straight ahead towards the left."""

_LOCALISED = 0.03  # deviation of localised joints from their true places, metres
_PLACE = 1.0  # deviation of a person from the given centre, metres: wide, so that localised joints determine the place


@dataclass(frozen=True)
class PosesInPictures:
    """Distribution of poses in pictures by the bearing of the camera from the trunk.

    Attributes:
        mean: joints right and down of the mean of all joints, (BEARINGS, 34), metres: x and y of joint after joint.
        covariance: covariance of these numbers, (BEARINGS, 34, 34).
    """

    mean: Floats
    covariance: Floats

    def between(self, bearings: Floats) -> tuple[Integers, Floats]:
        """Return the index of the bearing before each of n bearings, radians, and the weight of the next, (n,) each.

        Means and covariances at other bearings are linear between those of the table; the next follows after the last.
        """
        place = np.mod(bearings, 2 * np.pi) * (BEARINGS / (2 * np.pi))
        return place.astype(int) % BEARINGS, place - np.floor(place)


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
            (:func:`simharness.detector.view_geometry.bearings`).
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
