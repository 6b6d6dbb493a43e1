"""Scenes of the benchmark, rigs and stick figures made without the simulator, and the calls on them that are timed.

People stand on a jittered grid in a room, and cameras on a ring around them see all of them. Detections have noise,
misses and phantoms according to :class:`Conditions`. A seed gives the same scene on every machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mvpose
from mvpose.arrays import Floats
from mvpose.camera import Camera, Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.matching import Method, match
from mvpose.pipeline import Pipeline
from mvpose.rays import viewing_rays
from mvpose.skeleton import COCO17

SPACING = 1.0  # metres between neighbours on the grid
JITTER = 0.1  # metres; greatest distance from the grid point, so neighbours are 0.8 to 1.2 m apart
CLEARANCE = 0.4  # metres; least distance of a phantom from every person
FOCAL, SIZE = 800.0, (1280, 960)
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


STAGES = ("affinity", "matching", "reconstruction")


@dataclass(frozen=True)
class Conditions:
    """Error rates of the detector.

    Attributes:
        noise: standard deviation of a keypoint in each axis, pixels.
        joints_missing: probability that a keypoint of a detected person is not detected.
        people_missed: probability that a view misses a person.
        phantoms: number of false-positive detections per view.
    """

    noise: float = 4.0
    joints_missing: float = 0.10
    people_missed: float = 0.05
    phantoms: int = 0


LIVE = Conditions()
HARD = Conditions(noise=12.0, people_missed=0.30, phantoms=1)


@dataclass(frozen=True)
class Scene:
    """Detections of one frame and its truth.

    Attributes:
        rig: V cameras.
        detections: m detections, sorted by view, in random order within a view.
        person: true person of each detection, -1 for a phantom, (m,).
        joints: true joints of the people, metres, (P, 17, 3).
        phantoms: joints from which the phantoms of each view are projected, metres, (V, F, 17, 3).
    """

    rig: Rig
    detections: Detections
    person: NDArray[np.int64]
    joints: Floats
    phantoms: Floats


def frames(views: int, people: int, count: int, *, conditions: Conditions = LIVE, seed: int = 0) -> list[Scene]:
    """Return ``count`` independent frames with one rig; ``seed`` is the seed of the first frame."""
    rig = ring(views, people)
    return [film(rig, people, seed=seed + k, conditions=conditions) for k in range(count)]


def ring(views: int, people: int) -> Rig:
    """Return cameras 2 to 2.5 m high on a ring, with a radius at which all people are in every image.

    Bearings advance by the golden angle. So they are spread evenly for any number, no two cameras face each other
    (points between facing cameras cannot be triangulated), and a larger rig contains the smaller.
    """
    crowd_radius = np.sqrt(people / np.pi) * SPACING + SPACING / np.sqrt(2) + 0.5  # radius of the grid plus an arm
    radius = max(crowd_radius + 2.3, crowd_radius * 2 * FOCAL / SIZE[0] * 1.3)  # for near feet and for far arms
    return Rig([_camera(k, radius) for k in range(views)])


def _camera(k: int, radius: float) -> Camera:
    bearing, height = k * _GOLDEN_ANGLE, 2.0 + 0.5 * (k * np.sqrt(2) % 1)
    center = np.array([radius * np.cos(bearing), radius * np.sin(bearing), height])
    forward = np.array([0.0, 0.0, 1.0]) - center
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    K = np.array([[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1]])
    return Camera(K, R, -R @ center, size=SIZE, name=f"ring{k}")


def film(rig: Rig, people: int, *, seed: int = 0, conditions: Conditions = LIVE) -> Scene:
    """Simulate the detections of one frame; the people depend on the seed and their number only."""
    people_rng, phantom_rng, detector_rng = (np.random.default_rng([seed, stream]) for stream in range(3))
    places = _places(people, people_rng)
    joints = stick_people(places, people_rng)
    # Blocks are drawn whole and masked afterwards, so that a condition changes no other draw.
    views, bodies_per_view = len(rig), people + conditions.phantoms
    phantoms = stick_people(_free_places(places, views * conditions.phantoms, phantom_rng), phantom_rng)
    phantoms = phantoms.reshape(views, conditions.phantoms, len(COCO17), 3)
    bodies = np.concatenate([np.broadcast_to(joints, (views, *joints.shape)), phantoms], axis=1)
    pixels = np.stack([camera.project(body) for camera, body in zip(rig, bodies, strict=True)])
    pixels += conditions.noise * detector_rng.standard_normal(pixels.shape)
    scores = detector_rng.uniform(0.5, 1.0, pixels.shape[:3])
    scores[detector_rng.random(scores.shape) < conditions.joints_missing] = 0.0
    kept = detector_rng.random((views, bodies_per_view)) >= conditions.people_missed
    kept[:, people:] = True
    view, person = np.nonzero(kept)
    order = np.lexsort([detector_rng.random(len(view)), view])
    view, person = view[order], person[order]
    detections = Detections.from_keypoints(view, pixels[view, person], scores[view, person])
    return Scene(rig, detections, np.where(person < people, person, -1), joints, phantoms)


def _places(people: int, rng: np.random.Generator) -> Floats:
    """Return the grid points nearest to the origin, each with jitter, (P, 2), metres."""
    reach = np.arange(-int(np.sqrt(people)) - 2, int(np.sqrt(people)) + 3) * SPACING
    grid = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2) + rng.uniform(-0.5, 0.5, 2) * SPACING
    grid = grid[np.argsort(np.linalg.norm(grid, axis=1), kind="stable")[:people]]
    turn, angle, off = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi, people), JITTER * rng.random(people)
    c, s = np.cos(turn), np.sin(turn)
    return grid @ np.array([[c, s], [-s, c]]) + off[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _free_places(places: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Return random places in the room at a distance from all people, (count, 2), metres."""
    radius = np.linalg.norm(places, axis=1).max(initial=0.0) + SPACING / 2
    angle = rng.uniform(0, 2 * np.pi, (count, 64))
    tries = radius * np.sqrt(rng.random((count, 64)))[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    clear = (np.linalg.norm(tries[:, :, None] - places, axis=3) >= CLEARANCE).all(axis=2)
    return tries[np.arange(count), clear.argmax(axis=1)]


def stick_people(places: Floats, rng: np.random.Generator) -> Floats:
    """Draw standing and walking adults in COCO-17 with random headings, (n, 17, 3), metres.

    Segment lengths are fractions of stature after Drillis and Contini (1966, in Winter, "Biomechanics and motor
    control of human movement", figure 4.1); the spans of shoulders and hips are those of the joint centres.

    Args:
        places: positions on the floor z = 0, metres, (n, 2).
        rng: generator of statures, poses and headings.
    """
    count = len(places)
    body = np.zeros((count, len(COCO17), 3))  # x ahead, y left, z up, in statures, from the mid-hip
    neck = np.array([0.0, 0.0, 0.288])
    face = {"nose": (0.07, 0, 0.10), "left_eye": (0.055, 0.018, 0.12), "left_ear": (0, 0.043, 0.11)}
    for name, offset in face.items():
        body[:, COCO17.index(name)] = neck + offset
        body[:, COCO17.mirror[COCO17.index(name)]] = neck + offset * np.array([1, -1, 1])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, wrist, hip, knee, ankle = (
            COCO17.index(f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        )
        arm, out, bend = rng.uniform(-0.4, 1.2, count), rng.uniform(0.05, 0.6, count), rng.uniform(0.0, 1.6, count)
        leg, apart, flex = rng.uniform(-0.4, 0.5, count), rng.uniform(0.0, 0.12, count), rng.uniform(0.0, 0.5, count)
        body[:, shoulder] = neck + [0, sign * 0.097, 0]
        body[:, elbow] = body[:, shoulder] + 0.186 * _limb_directions(arm, sign * out)
        body[:, wrist] = body[:, elbow] + 0.146 * _limb_directions(arm + bend, sign * out)
        body[:, hip] = [0, sign * 0.052, 0]
        body[:, knee] = body[:, hip] + 0.245 * _limb_directions(leg, sign * apart)
        body[:, ankle] = body[:, knee] + 0.246 * _limb_directions(leg - flex, sign * apart)
    body[..., 2] += 0.039 - body[..., 2].min(axis=1, keepdims=True)  # the lower ankle is 0.039 statures above the floor
    body *= rng.uniform(1.55, 1.90, count)[:, None, None]
    heading = rng.uniform(0, 2 * np.pi, count)
    c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x, y = c * body[..., 0] - s * body[..., 1], s * body[..., 0] + c * body[..., 1]
    return np.stack([x + places[:, :1], y + places[:, 1:], body[..., 2]], axis=-1)


def _limb_directions(ahead: Floats, aside: Floats) -> Floats:
    """Return unit directions, (n, 3), of limbs rotated from straight down by angles ahead and aside, radians."""
    return np.stack([np.sin(ahead) * np.cos(aside), np.sin(aside), -np.cos(ahead) * np.cos(aside)], axis=1)


@dataclass(frozen=True)
class Case:
    """Scene with its precomputed affinity, (m, m), of the preset ``full``."""

    scene: Scene
    affinity: NDArray[np.float64]


def prepare(scenes: Iterable[Scene]) -> list[Case]:
    """Compute the affinities of scenes."""
    affinity = Pipeline().affinity
    return [
        Case(scene, affinity(scene.rig, scene.detections, viewing_rays(scene.rig, scene.detections)))
        for scene in scenes
    ]


@dataclass(frozen=True)
class Task:
    """Function to time.

    Attributes:
        call: timed function of a case.
        note: function that returns figures of the result to record with the time; not timed.
    """

    call: Callable[[Case], Any]
    note: Callable[[Case, Any], Mapping[str, float]] = lambda case, result: {}


def estimating(preset: str) -> Task:
    """Create the task of a whole preset; it records the milliseconds of its stages."""
    pipeline = mvpose.preset(preset)

    def note(case: Case, estimate: Estimate) -> Mapping[str, float]:
        return {stage: 1e3 * estimate.timings[stage] for stage in STAGES}

    return Task(lambda case: pipeline.estimate(case.scene.rig, case.scene.detections), note)


def matching(method: Method, note: Callable[[Case, Matching], Mapping[str, float]] = lambda case, result: {}) -> Task:
    """Create the task of matching only."""
    return Task(lambda case: match(case.affinity, case.scene.detections.view, method=method), note)


def decomposing() -> Task:
    """Create the task of one eigendecomposition of the size of the frame, the yardstick of matching by ADMM."""
    return Task(lambda case: np.linalg.eigh(case.affinity))
