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

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig

DATA = Path(__file__).parent / "data" / "poses_in_pictures.npz"
"""Means and covariances, made by ``python -m tools.poses``."""

BEARINGS = 12
"""Number of bearings of the camera from the trunk, in equal steps from straight ahead towards the left."""

_SIZE = 2 * len(COCO17)
_LOCALISED = 0.03  # deviation of localised joints from their true places, metres
_PLACE = 1.0  # deviation of a person from the given centre, metres: wide, so that localised joints determine the place
_ROWS = 1000  # poses at once: some ten megabytes


@dataclass(frozen=True)
class PosesInPictures:
    """Distribution of poses in pictures by the bearing of the camera from the trunk.

    Attributes:
        mean: joints right and down of the mean of all joints, (BEARINGS, 34), metres: x and y of joint after joint.
        covariance: covariance of these numbers, (BEARINGS, 34, 34).
    """

    mean: Floats
    covariance: Floats

    def at(self, bearings: Floats) -> tuple[Floats, Floats]:
        """Return mean (n, 34) and covariance (n, 34, 34) at bearings (n,), radians, by linear interpolation."""
        place = np.mod(bearings, 2 * np.pi) * (BEARINGS / (2 * np.pi))
        low = place.astype(int) % BEARINGS
        high, share = (low + 1) % BEARINGS, place - np.floor(place)
        mean = self.mean[low] + share[:, None] * (self.mean[high] - self.mean[low])
        between = self.covariance[high] - self.covariance[low]
        return mean, self.covariance[low] + share[:, None, None] * between


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
    result = places.copy()
    for start in range(0, len(places), _ROWS):
        part = slice(start, start + _ROWS)
        relative = (places[part] - center[part, None]) / scale[part, None, None]
        likely = _conditional_mean(relative, localised[part], bearings[part])
        result[part] = np.where(
            localised[part, :, None], places[part], center[part, None] + scale[part, None, None] * likely
        )
    return result


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


def _conditional_mean(places: Floats, localised: Bools, bearings: Floats) -> Floats:
    """Return the mean of all joints given the localised ones, (n, 17, 2) metres from the centre.

    Args:
        places: joints, (n, 17, 2) metres from the centre.
        localised: which of them are given, (n, 17).
        bearings: bearings of the cameras, (n,) radians.
    """
    mean, covariance = poses_in_pictures().at(bearings)
    given = np.repeat(localised, 2, axis=-1)
    covariance = covariance + _PLACE**2 * np.tile(np.eye(2), (len(COCO17), len(COCO17)))
    # Rows and columns of joints that are not given become those of the identity: they take no part.
    among = np.where(given[:, :, None] & given[:, None], covariance, 0.0)
    among[:, np.arange(_SIZE), np.arange(_SIZE)] += np.where(given, _LOCALISED**2, 1.0)
    away = np.where(given, places.reshape(-1, _SIZE) - mean, 0.0)
    weighted = np.linalg.solve(among, away[..., None])
    return (mean + (covariance @ weighted)[..., 0]).reshape(-1, len(COCO17), 2)
