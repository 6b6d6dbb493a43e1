"""Fast layer: what a set of cameras will make of the people in a volume, in milliseconds and without a simulation.

It is a Monte Carlo estimate on scenes that all cameras share (:mod:`simharness.planning.standing_people`): what one
camera sees and reports of them is computed once (:meth:`FastLayer.terms`), by the simulator's own rule of visibility
and its own detector, and then combined for any set of cameras (:meth:`FastLayer.predict`) by the method itself. What
the simulator adds are motion, correlation of errors in time, clutter of any shape, calibration and clocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mvpose import COCO17, Detections, Pipeline, Rig
from mvpose.arrays import Bools, Floats
from mvpose.camera import Camera
from mvpose.rays import Rays, viewing_rays
from mvpose.reconstruction import Triangulation
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.conditions import oks_units
from simharness.detector.detection_block import DetectionBlock
from simharness.pairing.pairing import LIMIT, pair
from simharness.planning.joint_error import covariance, information
from simharness.planning.prediction import Prediction
from simharness.planning.sightings import detect_in
from simharness.planning.standing_people import ACTIVITIES, StandingScenes, pose_pool, standing_scenes
from simharness.planning.visibility import Obstacle, see, seen_joints
from simharness.planning.volume import Volume
from simharness.scenario.sections.detector import Detector
from simharness.scoring.pcp import Part, nearest, part_states

_TRUNK = (5, 6, 11, 12)  # shoulders and hips
_SCENES_AT_ONCE = 64  # whose people are triangulated in one call


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


_LIMBS = np.arange(5, 17)  # shoulders to ankles


@dataclass(frozen=True)
class FastLayer:
    """Fast layer of a volume, its people, its obstacles and a detector; :meth:`of` makes one.

    Attributes:
        volume: where people stand.
        scenes: the scenes that all cameras share.
        detector: profile of the detector.
        obstacles: boxes that hide people.
        seed: seed of all draws.
    """

    volume: Volume
    scenes: StandingScenes = field(repr=False)
    detector: Detector = field(repr=False)
    obstacles: tuple[Obstacle, ...] = ()
    seed: int = 0

    @classmethod
    def of(
        cls,
        volume: Volume,
        *,
        detector: Detector,
        people: int = 4,
        spacing: float = 0.5,
        orientations: int = 8,
        draws: int = 1,
        obstacles: Sequence[Obstacle] = (),
        activities: Sequence[str] = ACTIVITIES,
        children: float = 0.0,
        seed: int = 0,
    ) -> FastLayer:
        """Draw the scenes of a volume.

        Args:
            volume: where people stand.
            detector: profile of the detector (:func:`simharness.scenario.presets.read_profile`).
            people: number of people at a time; where the volume has tracks, those people stand as recorded.
            spacing: metres between the places of the map.
            orientations: number of directions in which somebody stands at each place, per draw.
            draws: number of draws of everything else at each place and direction.
            obstacles: boxes that hide people; nobody stands in them.
            activities: activities of the simulator from which poses are taken.
            children: share of children.
            seed: seed of all draws.

        Raises:
            ValueError: no people, or no place where a person can stand.
        """
        pool = pose_pool(tuple(activities), children=children)
        scenes = standing_scenes(
            volume,
            pool,
            people=people,
            spacing=spacing,
            repeats=orientations * draws,
            blocked=[each.floor for each in obstacles if each.blocks],
            seed=seed,
        )
        return cls(volume, scenes, detector, tuple(obstacles), seed)

    @property
    def places(self) -> Floats:
        """Places of the map, (P, 2), metres."""
        return self.scenes.places

    def terms(self, camera: Camera) -> CameraTerms:
        """Return what one camera contributes; tens of milliseconds.

        Raises:
            ValueError: it is no camera.
        """
        if not isinstance(camera, Camera):
            raise ValueError(f"terms: expected a mvpose.Camera, got {type(camera).__name__}")
        views = see(camera, self.scenes, self.obstacles)
        block = detect_in(camera, self.scenes, views, self.detector, seed=self.seed)
        seen = seen_joints(views)
        keypoints = self.detector.keypoints
        usual = np.array(keypoints.scatter.by_joint()) * oks_units(views.boxes[:, 0])
        deviation = usual * np.where(views.visibility[:, 0] == 0, 1.0, keypoints.scatter_hidden)
        return CameraTerms(camera, self.scenes, seen, block, np.maximum(deviation, 0.5))

    def predict(self, terms: Sequence[CameraTerms], *, variant: str = "") -> Prediction:
        """Return what a set of cameras makes of the people.

        Args:
            terms: what each camera contributes (:meth:`terms` of this layer).
            variant: variant of the method that works on the drawn detections, "full" or "fast" (a millisecond a scene);
                "": triangulation of every person by robust rays, with the right detections matched (much faster, and
                too good where people are mistaken for each other: few cameras, many people).

        Raises:
            ValueError: fewer than two cameras, cameras that all stand in one point, or an unknown variant.
        """
        return _prediction(self.scenes, terms, self.reconstruct(terms, variant=variant))

    def reconstruct(self, terms: Sequence[CameraTerms], *, variant: str = "") -> Reconstruction:
        """Return what the method makes of everyone in every scene; arguments as of :meth:`predict`."""
        rig = Rig([each.camera for each in terms])
        return _by_variant(rig, terms, self.scenes, variant) if variant else _by_truth(rig, terms)


@dataclass(frozen=True)
class Reconstruction:
    """Estimates of everyone in S scenes of Q people.

    Attributes:
        nearest: joints of the estimate nearest to everyone, by which PCP is scored, (S, Q, 17, 3), metres; NaN where
            missing.
        paired: joints of the estimate paired one to one with everyone, (S, Q, 17, 3), metres; NaN where missing.
        mixed: who is matched with a detection of somebody else, or twice, (S, Q), 0 or 1; NaN where matching was not
            tried.
    """

    nearest: Floats
    paired: Floats
    mixed: Floats


def _prediction(scenes: StandingScenes, terms: Sequence[CameraTerms], made: Reconstruction) -> Prediction:
    """Return the maps of a reconstruction."""
    truth = scenes.joints
    states = part_states(coco17_to_shelf14(truth), coco17_to_shelf14(made.nearest))
    pcp = 100.0 * (states == Part.CORRECT).mean(axis=-1)
    distance = np.linalg.norm(made.paired - truth, axis=-1)
    placed = np.isfinite(distance)
    count = placed.sum(axis=-1)
    error = np.divide(
        1000.0 * np.where(placed, distance, 0.0).sum(axis=-1), count, out=np.full(count.shape, np.nan), where=count > 0
    )
    total = np.sum([each.information for each in terms], axis=0)
    floor = covariance(total)[..., :2, :2].mean(axis=2)
    ellipse = np.stack(
        [scenes.mean_by_place(floor[..., i, j]) for i, j in ((0, 0), (0, 1), (1, 0), (1, 1))], axis=-1
    ).reshape(-1, 2, 2)
    views = sum(each.sees_whole.astype(float) for each in terms)
    return Prediction(
        places=scenes.places,
        pcp=scenes.mean_by_place(pcp),
        recall=scenes.mean_by_place((count > 0).astype(float)),
        error_mm=scenes.mean_by_place(error),
        views=scenes.mean_by_place(np.asarray(views)),
        ellipse=ellipse,
        risk=scenes.mean_by_place(made.mixed),
        person_pcp=np.where(scenes.present, pcp, np.nan),
        person_error_mm=np.where(scenes.present, error, np.nan),
    )


def _by_truth(rig: Rig, terms: Sequence[CameraTerms]) -> Reconstruction:
    """Return estimates by robust triangulation of each person's own detections."""
    scenes = terms[0].scenes
    count, people = len(scenes), scenes.people
    rows = count * people
    method, parts = Triangulation(), []
    rays = [_rays_of_people(rig, view, each) for view, each in enumerate(terms)]
    here = [each.block.present[:, 0, :people] for each in terms]
    for start in range(0, count, _SCENES_AT_ONCE):
        chosen = slice(start, min(start + _SCENES_AT_ONCE, count))
        many = (chosen.stop - start) * people
        labels = [np.where(each[chosen].ravel(), np.arange(many), -1) for each in here]
        own = slice(start * people, chosen.stop * people)
        together = _joined([each.select(np.arange(rows)[own]) for each in rays])
        poses = method(together, np.concatenate(labels), COCO17)
        joints = np.full((many, 17, 3), np.nan)
        joints[: len(poses.joints)] = poses.joints
        parts.append(joints)
    everyone = np.concatenate(parts).reshape(count, people, 17, 3)
    return Reconstruction(everyone, everyone, np.full((count, people), np.nan))


_RAY_FIELDS = ("view", "origins", "directions", "weights", "pixel")


def _rays_of_people(rig: Rig, view: int, terms: CameraTerms) -> Rays:
    """Return the rays of all people of all scenes in one camera, S Q rows."""
    people, block = terms.scenes.people, terms.block
    rows = len(terms.scenes) * people
    keypoints = block.keypoints[:, 0, :people].reshape(rows, 17, 2)
    scores = block.scores[:, 0, :people].reshape(rows, 17)
    parts = []
    for start in range(0, rows, _MOST_ROWS):
        chosen = slice(start, start + _MOST_ROWS)
        size = len(scores[chosen])
        detections = Detections(
            np.full(size, view), keypoints[chosen], scores[chosen], np.ones((size, 4)), np.ones(size), COCO17
        )
        parts.append(viewing_rays(rig, detections))
    return _joined(parts)


def _joined(parts: Sequence[Rays]) -> Rays:
    """Return the rays of all parts as one."""
    fields: dict[str, Any] = {key: np.concatenate([getattr(each, key) for each in parts]) for key in _RAY_FIELDS}
    return Rays(**fields)


_MOST_ROWS = 256


def _by_variant(rig: Rig, terms: Sequence[CameraTerms], scenes: StandingScenes, variant: str) -> Reconstruction:
    """Return the estimates of a variant of the method."""
    pipeline = Pipeline.preset(variant)
    shape = (len(scenes), scenes.people)
    close, paired = np.full((*shape, 17, 3), np.nan), np.full((*shape, 17, 3), np.nan)
    mixed = np.zeros(shape)
    for s in range(len(scenes)):
        detections, person = _detections(terms, s)
        estimate = pipeline.estimate(rig, detections)
        truth = np.where(scenes.present[s][:, None, None], scenes.joints[s], np.nan)
        if len(estimate.joints):
            partner = nearest(coco17_to_shelf14(truth), coco17_to_shelf14(estimate.joints))
            close[s] = np.where((partner >= 0)[:, None, None], estimate.joints[partner], np.nan)
            partner = pair(truth, estimate.joints, limit=LIMIT).estimate
            paired[s] = np.where((partner >= 0)[:, None, None], estimate.joints[partner], np.nan)
        labels = estimate.matching.labels_of(len(detections))
        for q in range(scenes.people):
            own = np.unique(labels[(person == q) & (labels >= 0)])
            mixed[s, q] = len(own) > 1 or (person[np.isin(labels, own)] != q).any()
    return Reconstruction(close, paired, mixed)


def _detections(terms: Sequence[CameraTerms], scene: int) -> tuple[Detections, np.ndarray]:
    """Return the detections of one scene in all cameras, ordered as detectors report them, and whom each shows."""
    columns: dict[str, list[np.ndarray]] = {key: [] for key in ("keypoints", "scores", "boxes", "box_scores", "person")}
    view = []
    for v, each in enumerate(terms):
        block = each.block
        slots = np.flatnonzero(block.present[scene, 0])
        slots = slots[np.argsort(-block.box_scores[scene, 0, slots], kind="stable")]
        for key, values in columns.items():
            values.append(getattr(block, key)[scene, 0, slots])
        view.append(np.full(len(slots), v))
    keypoints, scores, boxes, box_scores, person = (np.concatenate(each) for each in columns.values())
    return Detections(np.concatenate(view), keypoints, scores, boxes, box_scores, COCO17), person
