"""What the detector reports of the people of all scenes in one camera.

The detector is the simulator's own (:mod:`simharness.detector`), with all its errors, applied to the scenes as to
frames that are far apart in time. Its draws belong to the camera alone, but for those parts that the profile lets all
views share: these are the same for every camera (common random numbers).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Camera, Rig
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import Key, KeyedDraws
from simharness.detector.steps import Context, registered_steps
from simharness.planning.standing_people import StandingScenes
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.random_streams import stream
from simharness.types.sequence import Sequence
from simharness.types.views import Views

_SHARED = "all"  # part of the key of draws that all views share


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
    context = Context(sequence, views, cast(Rig, _OneCamera(camera)), _independent(detector), draws)
    block = DetectionBlock.of_people(views)
    for each in registered_steps():
        block = each.apply(block, context)
    return block


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


@dataclass(frozen=True)
class _OneCamera:
    """Rig of one camera, as far as the steps of the detector use a rig; :class:`mvpose.Rig` has two or more."""

    camera: Camera

    def __iter__(self) -> Iterator[Camera]:
        return iter((self.camera,))

    def __len__(self) -> int:
        return 1

    def __getitem__(self, view: int) -> Camera:
        return (self.camera,)[view]

    @property
    def centers(self) -> Floats:
        return self.camera.center[None]


@dataclass(frozen=True)
class _CameraDraws(KeyedDraws):
    """Draws of the detector in one camera, of its own seed; what all views share is of the common seed.

    Attributes:
        common: seed of all cameras.
    """

    common: int = 0

    def _normal(self, count: int, key: tuple[Key, ...], shape: tuple[int, ...]) -> Floats:
        if _SHARED not in key:
            return super()._normal(count, key, shape)
        return stream(self.common, "planning", "detector", *key).standard_normal((count, *shape))
