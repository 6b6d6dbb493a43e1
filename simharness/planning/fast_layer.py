"""Fast layer: what a set of cameras will make of the people in a volume, in milliseconds and without a simulation.

It is a Monte Carlo estimate on scenes that all cameras share (:mod:`simharness.planning.standing_people`): what one
camera sees and reports of them is computed once (:meth:`FastLayer.terms`), by the simulator's own rule of visibility
and its own detector, and then combined for any set of cameras (:meth:`FastLayer.predict`) by the method itself. What
the simulator adds are motion, correlation of errors in time, clutter of any shape, calibration and clocks.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Rig, preset
from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera
from mvpose.rays import Rays
from mvpose.reconstruction import Triangulation
from mvpose.skeleton import coco17_to_shelf14
from simharness.planning.camera_terms import CameraTerms, covariance, detect_in, keypoint_deviation
from simharness.planning.standing_people import ACTIVITIES, StandingScenes, pose_pool, standing_scenes
from simharness.planning.visibility import see, seen_joints
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scoring.pairing import LIMIT, mean_distances, pair, placed_joints
from simharness.scoring.pcp import Part, nearest, part_states
from simharness.statistics.intervals import Interval
from simharness.types.floor import Volume
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box

_FIRST_MOMENTS, _MOMENT = 1.0, 1.0
"""Independent moments of a short recording, and seconds until the next one. Fitted on 32 simulated recordings of 8 s,
seeds 1000 to 1017 and 1300 to 1313 of ``benchmarks.planning.simulated_rigs``, of which the intervals then hold 90 %."""

_RESAMPLES = 2000


@dataclass(frozen=True)
class FastLayer:
    """Fast layer of a volume, its people, its obstacles and a detector; :meth:`in_volume` makes one."""

    volume: Volume
    """Where people stand."""
    scenes: StandingScenes = field(repr=False)
    """The scenes that all cameras share."""
    detector: DetectorSection = field(repr=False)
    """Profile of the detector."""
    obstacles: tuple[Box, ...] = ()
    """Boxes that hide people."""
    seed: int = 0
    """Seed of all draws."""

    @classmethod
    def in_volume(
        cls,
        volume: Volume,
        *,
        detector: DetectorSection,
        people: int = 4,
        spacing: float = 0.5,
        orientations: int = 8,
        draws: int = 1,
        obstacles: Sequence[Box] = (),
        activities: Sequence[str] = ACTIVITIES,
        seed: int = 0,
    ) -> "FastLayer":
        """Draw the scenes of a volume.

        Args:
            volume: where people stand.
            detector: profile of the detector (:func:`simharness.scenario.presets.read_profile`).
            people: number of people at a time.
            spacing: metres between the places of the map.
            orientations: number of directions in which somebody stands at each place, per draw.
            draws: number of draws of everything else at each place and direction.
            obstacles: boxes that hide people; nobody stands in them.
            activities: activities of the simulator from which poses are taken.
            seed: seed of all draws.

        Raises:
            ValueError: no people, or no place where a person can stand.
        """
        scenes = standing_scenes(
            volume,
            pose_pool(activities),
            people=people,
            spacing=spacing,
            repeats=orientations * draws,
            obstacles=obstacles,
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
        return CameraTerms(camera, self.scenes, seen_joints(views), block, keypoint_deviation(self.detector, views))

    def predict(self, terms: Sequence[CameraTerms], *, variant: str = "") -> "Prediction":
        """Return what a set of cameras makes of the people.

        Args:
            terms: what each camera contributes (:meth:`terms` of this layer).
            variant: variant of the method that works on the drawn detections, "full" or "fast" (a millisecond a scene);
                "": triangulation of every person by robust rays, with the right detections matched (much faster, and
                too good where people are mistaken for each other: few cameras, many people).

        Raises:
            ValueError: fewer than two cameras, cameras that all stand in one point, terms of another layer, or an
                unknown variant.
        """
        return _prediction(self.scenes, terms, reconstruct(terms, variant=variant))


@dataclass(frozen=True)
class Prediction:
    """Maps of a set of cameras over P places, NaN where nothing is known."""

    places: Floats
    """(P, 2), metres."""
    pcp: Floats
    """Percentage of correct parts, 0 to 100, (P,)."""
    recall: Floats
    """Probability that a person is found, (P,)."""
    error_mm: Floats
    """Expected error of the joints of people who are found, millimetres, (P,)."""
    views: Floats
    """Mean number of cameras that see a person whole, (P,)."""
    ellipse: Floats
    """Covariance of a joint of the trunk on the floor, (P, 2, 2), square metres."""
    risk: Floats
    """Probability of a wrong match, (P,): a person has a detection of somebody else, or is two people in the end; NaN
    where matching was not tried."""
    person_pcp: Floats
    """Percentage of correct parts of everyone in every scene, (S, Q); NaN for absent people."""
    person_error_mm: Floats
    """Mean error of the joints of everyone, (S, Q), millimetres; NaN for people not found."""

    def summary(self, *, seconds: float = 10.0) -> dict[str, Interval]:
        """Return ``pcp`` and ``mpjpe_mm`` of the volume, with the 90 % intervals of a recording of some seconds.

        The interval is that of the mean over as many moments as are independent in so many seconds: people stay
        where they are for a while, and so do the errors of the detector.
        """
        moments = _FIRST_MOMENTS + seconds / _MOMENT
        return {"pcp": _figure(self.person_pcp, moments), "mpjpe_mm": _figure(self.person_error_mm, moments)}


def _prediction(scenes: StandingScenes, terms: Sequence[CameraTerms], made: "Reconstruction") -> Prediction:
    """Return the maps of a reconstruction."""
    truth = coco17_to_shelf14(scenes.joints)
    states = part_states(truth, coco17_to_shelf14(made.nearest))
    pcp = 100.0 * (states == Part.CORRECT).mean(axis=-1)
    # Over the 14 joints of which the simulation is scored: the five of a face are far more exact than the others.
    distance = np.linalg.norm(coco17_to_shelf14(made.paired) - truth, axis=-1)
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


def _figure(values: Floats, moments: float) -> Interval:
    """Return the mean of values of people (S, Q) and the interval of the mean of some scenes, drawn from all."""
    known = np.isfinite(values).any(axis=1)
    if not known.any():
        return Interval(np.nan, np.nan, np.nan, 0)
    scenes = np.nanmean(values[known], axis=1)
    drawn = stream(0, "planning", "interval").choice(scenes, (_RESAMPLES, max(round(moments), 1))).mean(axis=1)
    low, high = np.quantile(drawn, [0.05, 0.95])
    return Interval(float(np.nanmean(values)), float(low), float(high), len(scenes))


_SCENES_AT_ONCE = 64  # whose people are triangulated in one call, which searches its detections for each of them


@dataclass(frozen=True)
class Reconstruction:
    """Estimates of everyone in S scenes of Q people."""

    nearest: Floats
    """Joints of the estimate nearest to everyone, by which PCP is scored, (S, Q, 17, 3), metres; NaN where missing."""
    paired: Floats
    """Joints of the estimate paired one to one with everyone, (S, Q, 17, 3), metres; NaN where missing."""
    mixed: Floats
    """Who is matched with a detection of somebody else, or twice, (S, Q), 0 or 1; NaN where matching was not tried."""


def reconstruct(terms: Sequence[CameraTerms], *, variant: str = "") -> Reconstruction:
    """Return what the method makes of everyone in every scene.

    Args:
        terms: what each camera contributes.
        variant: variant of the method; "": robust triangulation of each person's own detections.

    Raises:
        ValueError: fewer than two cameras, cameras that all stand in one point, terms of different scenes, or an
            unknown variant.
    """
    rig = Rig([each.camera for each in terms])
    if any(each.scenes is not terms[0].scenes for each in terms):
        raise ValueError("all terms must be of the same scenes: compute those of all cameras with one FastLayer")
    return _by_variant(rig, terms, terms[0].scenes, variant) if variant else _by_truth(terms)


def _by_truth(terms: Sequence[CameraTerms]) -> Reconstruction:
    """Return estimates by robust triangulation of each person's own detections."""
    scenes, method = terms[0].scenes, Triangulation()
    count, people = len(scenes), scenes.people
    parts = []
    for start in range(0, count, _SCENES_AT_ONCE):
        chosen = slice(start, min(start + _SCENES_AT_ONCE, count))
        many = (chosen.stop - start) * people
        labels = [np.where(each.block.present[chosen, 0, :people].ravel(), np.arange(many), -1) for each in terms]
        poses = method(_rays(terms, chosen, many), np.concatenate(labels), COCO17)
        joints = np.full((many, 17, 3), np.nan)
        joints[: len(poses.joints)] = poses.joints
        parts.append(joints)
    everyone = np.concatenate(parts).reshape(count, people, 17, 3)
    distance = np.linalg.norm(everyone - scenes.joints, axis=-1)
    known = np.isfinite(distance)
    total = np.where(known, distance, 0.0).sum(axis=-1)
    paired = np.where((total <= LIMIT * known.sum(axis=-1))[..., None, None], everyone, np.nan)
    return Reconstruction(everyone, paired, np.full((count, people), np.nan))


def _rays(terms: Sequence[CameraTerms], chosen: slice, many: int) -> Rays:
    """Return the rays of the people of some scenes, ``many`` of them in each camera."""
    directions, scores = (
        np.concatenate([each.rays[k][chosen].reshape(many, *each.rays[k].shape[2:]) for each in terms])
        for k in range(2)
    )
    focal = [np.sqrt(each.camera.K[0, 0] * each.camera.K[1, 1]) for each in terms]
    return Rays(
        view=np.repeat(np.arange(len(terms)), many),
        origins=np.repeat([each.camera.center for each in terms], many, axis=0),
        directions=directions,
        weights=scores,
        pixel=np.repeat(1.0 / np.array(focal), many),
    )


def _by_variant(rig: Rig, terms: Sequence[CameraTerms], scenes: StandingScenes, variant: str) -> Reconstruction:
    """Return the estimates of a variant of the method."""
    pipeline = preset(variant)
    shape = (len(scenes), scenes.people)
    close, paired, mixed = np.empty((*shape, 17, 3)), np.empty((*shape, 17, 3)), np.zeros(shape)
    for s in range(len(scenes)):
        detections, person = _detections(terms, s)
        estimate = pipeline.estimate(rig, detections)
        truth = np.where(scenes.present[s][:, None, None], scenes.joints[s], np.nan)
        partner = nearest(mean_distances(coco17_to_shelf14(truth), coco17_to_shelf14(estimate.joints)))
        close[s] = placed_joints(partner, estimate.joints)
        paired[s] = placed_joints(pair(truth, estimate.joints, limit=LIMIT).estimate, estimate.joints)
        labels = estimate.matching.labels_of(len(detections))
        for q in range(scenes.people):
            own = np.unique(labels[(person == q) & (labels >= 0)])
            mixed[s, q] = len(own) > 1 or (person[np.isin(labels, own)] != q).any()
    return Reconstruction(close, paired, mixed)


def _detections(terms: Sequence[CameraTerms], scene: int) -> tuple[Detections, Integers]:
    """Return the detections of one scene in all cameras, ordered as detectors report them, and whom each shows."""
    columns: dict[str, list[NDArray]] = {key: [] for key in ("keypoints", "scores", "boxes", "box_scores", "person")}
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
