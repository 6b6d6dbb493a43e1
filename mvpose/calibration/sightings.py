"""Sightings: keypoints matched over time and views, the input of all that judges or repairs a rig."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.tracklet_matching import PeopleGroups, RigUncertainty, match_tracklets
from mvpose.calibration.tracklets import Tracklets, link
from mvpose.camera import Rig
from mvpose.checks import Sealed, as_array
from mvpose.detections import Detections
from mvpose.skeleton import Skeleton

UNCERTAINTIES = (
    RigUncertainty(np.radians(0.3), 0.02, 0.05),  # a careful calibration
    RigUncertainty(np.radians(1.5), 0.10, 0.05),  # cameras that were touched
    RigUncertainty(np.radians(3.0), 0.20, 0.05),  # cameras that were measured by eye
)
"""Uncertainties of the rig that :func:`gather` tries; the one under which the detections are likeliest is taken."""

_CLEARLY_BETTER = 0.02  # share of the score by which a rig that is further off must be likelier
_LEAST_BETTER = 10.0


@dataclass(frozen=True)
class Sightings(Sealed):
    """k sightings of joints in pictures, each by one view.

    Raises:
        ValueError: arrays of different lengths, or indices beyond the frames, the views or the joints.
    """

    frame: Integers
    """Frame of each sighting, (k,)."""
    view: Integers
    """View, (k,)."""
    person: Integers
    """Person, 0, 1, ..., (k,): the same number for one person in all views and frames. A person seen by one view alone,
    or not matched to other views, has a separate number."""
    joint: Integers
    """Index of the joint in ``skeleton``, (k,)."""
    pixels: Floats
    """Keypoint as detected, with the distortion of the lens, (k, 2)."""
    sigma: Floats
    """Standard deviation of the keypoint, pixels, (k,)."""
    times: Floats
    """Time of each picture, (F, V), seconds; NaN where there is none."""
    skeleton: Skeleton
    """The joints."""
    velocity: Floats | None = None
    """Velocity of the keypoint in its picture, pixels/s, (k, 2); 0 where it is unknown."""

    def __post_init__(self) -> None:
        count = len(self.frame)
        times = as_array(self.times, ("F", "V"), "times")
        object.__setattr__(self, "times", times)
        limits = {"frame": times.shape[0], "view": times.shape[1], "person": np.inf, "joint": len(self.skeleton)}
        for key, limit in limits.items():
            index = as_array(getattr(self, key), (count,), key, np.int64)
            if count and not (index.min() >= 0 and index.max() < limit):
                raise ValueError(f"{key} must be indices from 0 to {limit - 1}, got {index.min()} to {index.max()}")
            object.__setattr__(self, key, index)
        object.__setattr__(self, "pixels", as_array(self.pixels, (count, 2), "pixels"))
        object.__setattr__(self, "sigma", as_array(self.sigma, (count,), "sigma"))
        velocity = np.zeros((count, 2)) if self.velocity is None else self.velocity
        object.__setattr__(self, "velocity", as_array(velocity, (count, 2), "velocity"))

    def __len__(self) -> int:
        """Number of sightings."""
        return len(self.frame)

    @property
    def views(self) -> int:
        """Number of views, V, also those without a sighting."""
        return self.times.shape[1]

    def select(self, which: Bools | Integers) -> Self:
        """Return some sightings, by a mask (k,) or by indices."""
        names = ("frame", "view", "person", "joint", "pixels", "sigma", "velocity")
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    @property
    def points(self) -> tuple[Integers, int]:
        """Number of the point that each sighting shows (a joint of a person in a frame), (k,), and their count."""
        joints = len(self.skeleton)
        key = (self.person * len(self.times) + self.frame) * joints + self.joint
        unique, index = np.unique(key, return_inverse=True)
        return index.astype(np.int64), len(unique)

    @property
    def shared(self) -> Bools:
        """Mask of the sightings whose joint is seen by another view as well in that frame, (k,)."""
        index, count = self.points
        seen = np.bincount(index, minlength=count)
        return seen[index] > 1


def gather(rig: Rig, frames: Sequence[Detections], *, period: float = 0.04) -> Sightings:
    """Match the keypoints of all views and frames, over seconds, so that it works with a rig that is far off.

    Detections are linked over time in each view, and the tracklets are matched between views
    (:mod:`mvpose.calibration.tracklet_matching`). Each camera may be off by about 4 degrees and 0.4 m.

    Args:
        rig: believed cameras.
        frames: detections of each frame, all views.
        period: seconds between frames whose detections carry no time.

    Raises:
        ValueError: frames of different skeletons, a view that the rig does not have, or wrong times.
    """
    tracklets = link(rig, frames, period=period)
    return sightings_of(tracklets, match_over_time(rig, tracklets).person)


def match_over_time(rig: Rig, tracklets: Tracklets) -> PeopleGroups:
    """Match tracklets under each of :data:`UNCERTAINTIES` of the rig, in rising order, and return the likeliest result.

    A rig that is further off must explain clearly more: with enough freedom, people who walk alike fit each other.
    """
    best = match_tracklets(rig, tracklets, UNCERTAINTIES[0])
    for each in UNCERTAINTIES[1:]:
        other = match_tracklets(rig, tracklets, each)
        if other.score > best.score + max(_LEAST_BETTER, _CLEARLY_BETTER * abs(best.score)):
            best = other
    return best


def sightings_of(tracklets: Tracklets, person: Integers) -> Sightings:
    """Return the sightings of tracklets whose people are known.

    Args:
        tracklets: from :func:`mvpose.calibration.tracklets.link`.
        person: person of each tracklet, (tracklets,).
    """
    row, joint = np.nonzero(np.isfinite(tracklets.sigma))
    return Sightings(
        tracklets.frame[row],
        tracklets.view[row],
        person[tracklets.tracklet[row]],
        joint,
        tracklets.keypoints[row, joint],
        tracklets.sigma[row, joint],
        tracklets.times,
        tracklets.skeleton,
        tracklets.velocity[row, joint],
    )
