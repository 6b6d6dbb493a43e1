"""What one camera contributes to a set of cameras: whom it sees, and what the detector reports of them.

The detector is the simulator's own (:mod:`simharness.detector`), with all its errors, applied to the scenes as to
frames that are far apart in time. Its draws belong to the camera alone, but for those parts that the profile lets all
views share: these are the same for every camera (common random numbers).

A camera that reports a joint at a pixel with standard deviation s (in x and in y) gives the information
``Jᵀ J / s²`` (3, 3), where J (2, 3) is the derivative of the pixel with respect to the joint. The information of
several cameras adds up, and the inverse of the sum is the covariance of the joint (Cramér-Rao bound of triangulation;
Hartley & Zisserman, "Multiple View Geometry", section 5.2).
"""

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.camera import Camera, Rig
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import Key, KeyedDraws
from simharness.detector.steps import Context, registered_steps
from simharness.detector.viewing_conditions import VISIBLE, oks_units
from simharness.planning.standing_people import StandingScenes
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.random_streams import stream
from simharness.types.sequence import Sequence
from simharness.types.views import Views
from simharness.world.rigs.projection import project_to_image

_TRUNK = (5, 6, 11, 12)  # shoulders and hips
_LIMBS = np.arange(5, 17)  # shoulders to ankles
_STEP = 1e-4  # metres, of the differences by which the projection is derived
_SINGULAR = 1e-4  # reciprocal condition of a sum of information below which one direction is unknown
_SHARED = "all"  # part of the key of draws that all views share
_LEAST_DEVIATION = 0.5  # pixels: no keypoint is more exact than the grid from which it is read


@dataclass(frozen=True)
class CameraTerms:
    """What one camera contributes in all S scenes of Q people.

    Attributes:
        camera: the camera.
        scenes: the scenes.
        seen: which joints it sees, whether or not the detector reports them, (S, Q, 17).
        block: what the detector reports, (S, 1, slots); person q in slot q.
        deviation: standard deviation of good keypoints, pixels, (S, Q, 17).
        whole: probability that it sees a person at each place whole, (P,): all limb joints inside the picture and
            none hidden by others or by objects.
    """

    camera: Camera
    scenes: StandingScenes = field(repr=False)
    seen: Bools = field(repr=False)
    block: DetectionBlock = field(repr=False)
    deviation: Floats = field(repr=False)

    @cached_property
    def sees_whole(self) -> Bools:
        """Whom the camera sees whole, (S, Q)."""
        return np.asarray(self.seen[:, :, _LIMBS].all(axis=-1))

    @cached_property
    def whole(self) -> Floats:
        """Probability that the camera sees a person at each place whole, (P,); see the class."""
        return self.scenes.mean_by_place(self.sees_whole.astype(float))

    @cached_property
    def reported(self) -> Bools:
        """Which joints of which people the detector reports, (S, Q, 17)."""
        people = self.scenes.people
        return self.block.present[:, 0, :people, None] & (self.block.scores[:, 0, :people] > 0)

    @cached_property
    def information(self) -> Floats:
        """Information of the reported joints of the trunk, (S, Q, 4, 3, 3), 1/m²; zeros where not reported."""
        joints = self.scenes.joints[:, :, _TRUNK]
        deviation = np.where(self.reported, self.deviation, np.nan)[:, :, _TRUNK]
        return information(self.camera, joints, deviation)

    @cached_property
    def rays(self) -> tuple[Floats, Floats]:
        """Directions (S, Q, 17, 3) and scores (S, Q, 17) of the rays to joints; zeros where a joint is not reported."""
        people = self.scenes.people
        directions = self.camera.rays(self.block.keypoints[:, 0, :people])
        known = self.reported & np.isfinite(directions).all(axis=-1)
        scores = np.where(known, self.block.scores[:, 0, :people], 0.0)
        return np.where(known[..., None], directions, 0.0), scores


def detect_in(
    camera: Camera, scenes: StandingScenes, views: Views, detector: DetectorSection, *, seed: int
) -> DetectionBlock:
    """Return the detections of S scenes in one camera, (S, 1, slots); person q in slot q.

    Phantoms that stand in the room and would be seen by several cameras are drawn in each camera alone.

    Args:
        camera: the camera.
        scenes: the scenes.
        views: what it sees of them (:func:`simharness.planning.visibility.see`).
        detector: profile of the detector.
        seed: seed of the draws.
    """
    time = np.arange(len(scenes), dtype=float)
    sequence = Sequence(scenes.landmarks, np.arange(scenes.people), time, scenes.present)
    draws = _CameraDraws(_seed_of(camera, seed), time, 1, common=seed)
    context = Context(sequence, views, cast(Rig, _OneCamera([camera])), _independent(detector), draws)
    block = DetectionBlock.of_people(views)
    for each in registered_steps():
        block = each.apply(block, context)
    return block


def keypoint_deviation(detector: DetectorSection, views: Views) -> Floats:
    """Return the standard deviation of good keypoints in one camera, pixels, (S, Q, 17)."""
    keypoints = detector.keypoints
    usual = np.array(keypoints.scatter.by_joint()) * oks_units(views.boxes[:, 0])
    deviation = usual * np.where(views.visibility[:, 0] == VISIBLE, 1.0, keypoints.scatter_hidden.by_joint())
    return np.maximum(deviation, _LEAST_DEVIATION)


def information(camera: Camera, joints: Floats, deviation: Floats) -> Floats:
    """Return the information of sightings, (..., 3, 3) per square metre; zeros where nothing is seen.

    Args:
        camera: the camera.
        joints: positions (..., 3), metres.
        deviation: standard deviation of the keypoint, pixels, (...); NaN where the joint is not reported.
    """
    steps = _STEP * np.eye(3)
    ahead = project_to_image(camera, joints[..., None, :] + steps)
    behind = project_to_image(camera, joints[..., None, :] - steps)
    jacobian = (ahead - behind) / (2 * _STEP) / deviation[..., None, None]  # (..., 3, 2): its transpose
    return np.nan_to_num(jacobian @ np.swapaxes(jacobian, -1, -2))


def covariance(total: Floats) -> Floats:
    """Return the covariance of joints, (..., 3, 3) square metres, of the summed information (..., 3, 3).

    NaN where the information leaves a direction open: fewer than two rays, or rays that are nearly parallel.
    """
    values, vectors = np.linalg.eigh(total)
    known = values[..., :1] > _SINGULAR * np.maximum(values[..., -1:], 1e-12)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(known, 1.0 / values, np.nan)
    return (vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def _independent(detector: DetectorSection) -> DetectorSection:
    """Return a profile without correlation in time, because the scenes are far apart."""
    lives = {"life": 0.0, "scatter_life": 0.0}
    return detector.model_copy(
        update={
            "correlation": detector.correlation.model_copy(update=lives),
            "boxes": detector.boxes.model_copy(update={"life": 0.0}),
            "phantoms": detector.phantoms.model_copy(update={"life": 0.0, "views": 0.0}),
            "decoys": detector.decoys.model_copy(update={"share": 0.0}),
        }
    )


def _seed_of(camera: Camera, seed: int) -> int:
    """Return a seed that no other camera of a rig has, so that two cameras never share their errors."""
    numbers = np.concatenate([camera.K.ravel(), camera.R.ravel(), camera.t, camera.distortion, camera.size])
    name = f"{seed} {camera.name} ".encode()
    return int.from_bytes(hashlib.blake2b(name + numbers.tobytes(), digest_size=6).digest(), "little")


class _OneCamera(tuple[Camera]):
    """Rig of one camera, as far as the steps of the detector use a rig; :class:`mvpose.Rig` has two or more."""

    @property
    def centers(self) -> Floats:
        return self[0].center[None]


@dataclass(frozen=True)
class _CameraDraws(KeyedDraws):
    """Draws of the detector in one camera, from its own seed; draws that all views share are from the common seed."""

    common: int = 0
    """Seed of all cameras."""

    def _normal(self, count: int, key: tuple[Key, ...], shape: tuple[int, ...]) -> Floats:
        if _SHARED not in key:
            return super()._normal(count, key, shape)
        return stream(self.common, "planning", "detector", *key).standard_normal((count, *shape))
