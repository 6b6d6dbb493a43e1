"""Endless stream of detections of people who come and go, made frame by frame, in constant memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.method.scenes import LIVE, SPACING, Conditions, ring, stick_people
from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.pipeline import Pipeline
from mvpose.presets import preset

_PACE = 0.6  # m/s, mean speed of people who stroll


@dataclass(frozen=True)
class Visit:
    """One person from coming to leaving, on a circle around a place in the room.

    Attributes:
        until: time of leaving, seconds.
        body: joints around the origin, (17, 3), metres.
        place: centre of the circle, (2,), metres.
        radius: metres.
        phase: angle on the circle at time 0, radians.
    """

    until: float
    body: Floats
    place: Floats
    radius: float
    phase: float

    def joints(self, time: float) -> Floats:
        """Return the joints at a time, (17, 3), metres."""
        angle = self.phase + _PACE / self.radius * time
        at = self.place + self.radius * np.array([np.cos(angle), np.sin(angle)])
        return self.body + [at[0], at[1], 0.0]


def fast() -> Pipeline:
    """Return the stages of the preset ``fast``."""
    pipeline = preset("fast")
    assert isinstance(pipeline, Pipeline)
    return pipeline


def stream(
    views: int,
    people: int,
    *,
    rate: float = 30.0,
    stay: float = 60.0,
    phantoms: float = 0.2,
    conditions: Conditions = LIVE,
    timed: bool = True,
    seed: int = 0,
) -> tuple[Rig, Iterator[Detections]]:
    """Return a rig and an endless stream of the detections of its frames.

    Args:
        views: number of cameras.
        people: number of people who are there at the start, and on average later.
        rate: frames per second.
        stay: mean time that each person stays, seconds; infinite for nobody who comes or goes.
        phantoms: mean number of false detections in a picture; each stands at a place of its own for one frame.
        conditions: error rates of the detector.
        timed: whether detections carry the times of their pictures.
        seed: seed of all draws.
    """
    rig = ring(views, people)
    return rig, _frames(rig, people, rate, stay, phantoms, conditions, timed, np.random.default_rng(seed))


def _frames(
    rig: Rig, people: int, rate: float, stay: float, phantoms: float, conditions: Conditions, timed: bool,
    rng: np.random.Generator,
) -> Iterator[Detections]:  # fmt: skip
    reach = np.sqrt(people / np.pi) * SPACING
    here = [_visit(0.0, stay, reach, rng) for _ in range(people)]
    frame, coming = 0, rng.exponential(stay / people) if np.isfinite(stay) else np.inf
    while True:
        now = frame / rate
        while coming <= now:
            here.append(_visit(coming, stay, reach, rng))
            coming += rng.exponential(stay / people)
        here = [visit for visit in here if visit.until > now]
        joints = np.array([visit.joints(now) for visit in here]).reshape(-1, 17, 3)
        given = _film(rig, joints, rng.poisson(phantoms, len(rig)), reach, conditions, rng)
        yield replace(given, time=np.full(len(rig), now)) if timed else given
        frame += 1


def _visit(now: float, stay: float, reach: float, rng: np.random.Generator) -> Visit:
    body = stick_people(np.zeros((1, 2)), rng)[0]
    angle, far = rng.uniform(0, 2 * np.pi), reach * np.sqrt(rng.random())
    until = now + (rng.exponential(stay) if np.isfinite(stay) else np.inf)
    return Visit(until, body, far * np.array([np.cos(angle), np.sin(angle)]), rng.uniform(0.2, 0.5), 2 * angle)


def _film(
    rig: Rig, joints: Floats, phantoms: Integers, reach: float, conditions: Conditions, rng: np.random.Generator
) -> Detections:
    views, keypoints = [], []
    ghosts = int(phantoms.sum())
    bodies = stick_people(rng.uniform(-reach, reach, (ghosts, 2)), rng)
    for index, camera in enumerate(rig):
        first = int(phantoms[:index].sum())
        seen = joints[rng.random(len(joints)) >= conditions.people_missed]
        pixels = camera.project(np.concatenate([seen, bodies[first : first + phantoms[index]]]))
        views.append(np.full(len(pixels), index))
        keypoints.append(pixels + conditions.noise * rng.standard_normal(pixels.shape))
    view = np.concatenate(views)
    scores = rng.uniform(0.5, 1.0, (len(view), 17))
    scores[rng.random(scores.shape) < conditions.joints_missing] = 0.0
    return Detections.from_keypoints(view, np.concatenate(keypoints), scores)
