"""Which joints a detector reports, by occlusion and for the face by the bearing of the camera, and which it guesses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.detector.bias import SIDE
from simharness.detector.draws import ErrorDraws, with_parents
from simharness.detector.view_geometry import head_bearings
from simharness.detector.viewing_conditions import OCCLUDED, OUTSIDE, VISIBLE, Conditions
from simharness.scenario.sections.detector_section import (
    BEARINGS,
    KIND_OF_JOINT,
    KINDS,
    DropSection,
    FaceSection,
    KeypointsSection,
)


@dataclass(frozen=True)
class Reported:
    """Joints of one person that are reported.

    Attributes:
        joints: which joints are reported, (T, V, J).
        guessed: which of them are guesses, (T, V, J).
        at_border: which of them are outside the images, but so near that they are found at the border, (T, V, J).
    """

    joints: Bools
    guessed: Bools
    at_border: Bools


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
        self._drop = drop_shares(config.drop, config.face, conditions.occlusion, head)
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
        target = self._target[:, :, person]
        away = target - np.clip(target, 0.0, self._last)
        with np.errstate(invalid="ignore"):
            return np.hypot(away[..., 0], away[..., 1]) <= self._border * unit


def last_pixels(rig: Rig) -> Floats:
    """Return the last column and row of the images of V cameras, (V, 1, 2) pixels."""
    return np.array([camera.size for camera in rig], float)[:, None] - 1


def drop_shares(drop: DropSection, face: FaceSection, occlusion: NDArray[np.int8], bearings: Floats | None) -> Floats:
    """Return the share of each joint that is not reported, (T, V, P, 17); for joints outside the image any value.

    Args:
        drop: shares by occlusion.
        face: shares of the face by bearing.
        occlusion: occlusion classes of the joints, (T, V, P, 17).
        bearings: bearings of the cameras from the heads, (T, V, P), radians to the left of straight ahead; None if
            ``face`` has no shares.
    """
    table = np.array([shares.by_joint() for shares in (drop.visible, drop.self_occluded, drop.occluded)])
    result = table[np.where(occlusion == OUTSIDE, VISIBLE, occlusion), np.arange(occlusion.shape[-1])]
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
    return np.interp(bearings, np.deg2rad(BEARINGS), shares, period=2 * np.pi)
