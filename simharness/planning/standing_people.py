"""People of the fast layer: a pool of poses, and scenes in which people in these poses stand in the volume.

Bodies and poses are those of the simulator. A scene is one moment: everyone in it stands at a place, turned somewhere,
in a pose of the pool, and everyone both hides others and is looked at. All cameras see the same scenes, so that sets of
cameras are compared on the same people (common random numbers).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple, Self, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from mvpose.arrays import Bools, Floats, Integers
from simharness.detector.viewing_conditions import body_axes
from simharness.planning.floor_coverage import grid_spacing
from simharness.scenario.sections.people_section import ActivityName
from simharness.types.floor import Floor, Volume
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box

ACTIVITIES = ("walk", "wave", "turn", "talk", "reach", "point")
"""Activities from which poses are taken unless others are given: people who walk, stand and use their arms."""

APART = 0.6
"""Least distance of two people in a scene, metres, unless the volume is too small for so many."""

_BODIES, _POSES = 6, 48  # bodies of the pool, and poses of each
_FIRST, _LAST = 0.5, 9.5  # seconds of the motion from which poses are taken
_AREA = 6.0  # metres, half the side of the square in which the people of the pool move
_NOWHERE = np.array([0.0, 0.0, -1e4])  # position of absent people: no ray goes there
_EXTREMES = 100  # directions in which the outermost vertices of a pose are taken
_CLEARANCE = 0.25  # metres around an obstacle where nobody stands: half the width of a person
_OVERHEAD = 1.9  # metres: people stand under an obstacle that begins higher
_TRIES = 40  # open scenes that a person is tried in before the rule of the least distance is dropped


class Silhouettes(NamedTuple):
    """Shapes of K poses, from which boxes in pictures follow."""

    body: Integers
    """Body of each pose, (K,)."""
    outlines: Floats
    """Outermost vertices of the skin of all poses, one after the other, (n, 3), metres."""
    outline_of: Integers
    """First vertex of each pose, and the end, (K + 1,)."""
    extremes: Floats
    """Outermost of these, which suffice where the whole person is in the picture, (m, 3), metres."""
    extremes_of: Integers
    """First of them of each pose, and the end, (K + 1,)."""
    edges: Integers
    """Edges of the outlines of all bodies, one after the other, as vertices of a pose, (e, 2)."""
    edges_of: Integers
    """First edge of each body, and the end."""


@dataclass(frozen=True)
class PosePool:
    """Poses of a few bodies, each standing over the origin and facing +x: K poses, C capsules."""

    landmarks: Floats = field(repr=False)
    """Positions of ``simharness.types.sequence.LANDMARKS``, (K, L, 3), metres."""
    capsules: Floats = field(repr=False)
    """Ends of the axes of the capsules that hide, (K, C, 2, 3), metres."""
    radii: Floats = field(repr=False)
    """Radii of the capsules, (K, C), metres."""
    depths: Floats = field(repr=False)
    """Largest distance of the skin in front of each COCO-17 joint, (K, 17), metres."""
    silhouettes: Silhouettes = field(repr=False)
    """Shapes in pictures."""

    def __len__(self) -> int:
        return len(self.landmarks)


def pose_pool(activities: Sequence[str] = ACTIVITIES) -> PosePool:
    """Simulate the poses of a pool; the result is kept, because this takes a second or two.

    Args:
        activities: activities of the simulator, assigned to the bodies in turn.

    Raises:
        ValueError: an activity that the simulator does not have.
    """
    known = [name for name in get_args(ActivityName) if name != "mocap"]
    if not activities or (unknown := [name for name in activities if name not in known]):
        got = f"{unknown[0]!r}" if activities else "none"
        raise ValueError(f"activities: expected one or more of {', '.join(known)}, got {got}")
    return _pose_pool(tuple(activities))


@cache
def _pose_pool(activities: tuple[str, ...]) -> PosePool:
    from simharness.capture.body_outlines import Outline, even_directions
    from simharness.capture.ray_casting import RayCaster
    from simharness.scenario.sections.cameras_section import CamerasSection
    from simharness.scenario.sections.people_section import PeopleSection
    from simharness.scenario.sections.room_section import ClutterSection, RoomSection
    from simharness.scenario.sections.scenario import Scenario
    from simharness.world.rigs.layouts import build_rig
    from simharness.world.scene.build import build
    from simharness.world.scene.playback import Playback

    scenario = Scenario(
        name="planning",
        seed=0,
        duration=_LAST + 0.5,
        room=RoomSection.model_validate({"size": (2 * _AREA + 2, 2 * _AREA + 2, 3.0), "walls": False}),
        people=PeopleSection.model_validate({"count": _BODIES, "activities": activities, "area": _AREA}),
        clutter=ClutterSection(),
        cameras=CamerasSection(),
    )
    scene = build(scenario, build_rig(scenario.cameras, seed=0, room=None))
    ways = even_directions(_EXTREMES).T
    caster, outlines = RayCaster(scene), [Outline.from_body(body) for body in scene.bodies]
    landmarks, capsules, radii, depths, bodies, skins = [], [], [], [], [], []
    for state in Playback(scene).over(np.linspace(_FIRST, _LAST, _POSES)):
        caster.place(state)
        for person, body in enumerate(scene.bodies):
            ends, radius = caster.capsules_of(person)
            joints = state.joints[person]
            here, turn = np.append(joints[11:13, :2].mean(axis=0), 0.0), _turns(bearings_of(joints))
            landmarks.append((state.landmarks[person] - here) @ turn)
            capsules.append((ends - here) @ turn)
            radii.append(radius)
            depths.append(body.joint_radii)
            bodies.append(person)
            skins.append((outlines[person].at(state.bones[person]) - here) @ turn)
    return PosePool(
        np.array(landmarks),
        np.array(capsules),
        np.array(radii),
        np.array(depths),
        Silhouettes(
            np.array(bodies),
            *_joined(skins),
            *_joined([skin[np.unique((skin @ ways).argmax(axis=0))] for skin in skins]),
            *_joined([outline.edges for outline in outlines]),
        ),
    )


def _joined(parts: Sequence[NDArray]) -> tuple[NDArray, Integers]:
    """Return arrays as one, and the first row of each, and the end."""
    return np.concatenate(parts), np.cumsum([0, *map(len, parts)])


def bearings_of(joints: Floats) -> Floats:
    """Return the directions in which people (..., 17, 3) face, (...), radians from +x."""
    ahead = body_axes(joints)[..., 0, :]
    return np.arctan2(ahead[..., 1], ahead[..., 0])


def _turns(angle: Floats) -> Floats:
    """Return rotations about z by angles (...), (..., 3, 3); ``points @ turn`` turns them back."""
    cos, sin, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    rows = [[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@dataclass(frozen=True)
class StandingScenes:
    """S scenes of Q people who stand in a volume."""

    pool: PosePool
    """The poses."""
    places: Floats
    """Places of the map, (P, 2), metres."""
    place: Integers
    """Index of the place of each person, (S, Q)."""
    pose: Integers
    """Index of the pose of each person, (S, Q)."""
    position: Floats
    """Position on the floor, (S, Q, 3), metres; far below it for absent people."""
    turn: Floats
    """Rotation about z, (S, Q, 3, 3)."""
    present: Bools
    """Who is in each scene, (S, Q)."""
    landmarks: Floats
    """Positions of all landmarks, (S, Q, L, 3), metres."""
    capsules: Floats
    """Ends of the axes of all capsules, (S, Q, C, 2, 3), metres."""

    @classmethod
    def posed(
        cls, pool: PosePool, places: Floats, place: Integers, pose: Integers, position: Floats, angle: Floats
    ) -> Self:
        """Return the scenes with people at positions (S, Q, 2), NaN where absent, facing angles (S, Q), radians."""
        present = np.isfinite(position).all(axis=-1) & np.isfinite(angle)
        turn = _turns(np.where(present, angle, 0.0))
        flat = np.concatenate([position, np.zeros((*position.shape[:2], 1))], axis=-1)
        here = np.where(present[..., None], flat, _NOWHERE)
        landmarks = np.einsum("sqij,sqlj->sqli", turn, pool.landmarks[pose]) + here[:, :, None]
        capsules = np.einsum("sqij,sqcej->sqcei", turn, pool.capsules[pose]) + here[:, :, None, None]
        return cls(pool, places, place, pose, here, turn, present, landmarks, capsules)

    def __len__(self) -> int:
        return len(self.place)

    @property
    def people(self) -> int:
        """Q, the number of people of a scene."""
        return self.place.shape[1]

    @property
    def joints(self) -> Floats:
        """COCO-17 joints, (S, Q, 17, 3), metres."""
        return self.landmarks[:, :, :17]

    def mean_by_place(self, values: Floats) -> Floats:
        """Return the mean at each place, (P,), of values (S, Q), without NaN and absent people; NaN without values.

        Neighbours along and across count half as much as the place itself, diagonal ones a quarter: some people at one
        place alone would draw their noise as if it were structure.
        """
        known = self.present & np.isfinite(values)
        cell = tuple(np.rint((self.places - self.places.min(axis=0)) / grid_spacing(self.places)).astype(int).T)
        sums = np.zeros((2, *(np.max(cell, axis=1) + 1)))
        for grid, weights in zip(sums, (None, values[known]), strict=True):
            grid[cell] = np.bincount(self.place[known], weights, minlength=len(self.places))
        own = sums[0][cell]
        for axis in (1, 2):
            sums = convolve1d(sums, [1.0, 2.0, 1.0], axis=axis, mode="constant")
        count, total = sums[0][cell], sums[1][cell]
        return np.divide(total, count, out=np.full(len(self.places), np.nan), where=own > 0)


def standing_scenes(
    volume: Volume,
    pool: PosePool,
    *,
    people: int = 4,
    spacing: float = 0.5,
    repeats: int = 16,
    obstacles: Sequence[Box] = (),
    seed: int = 0,
) -> StandingScenes:
    """Draw scenes in which every place of the volume is taken ``repeats`` times, facing evenly spread directions.

    The others in a scene stand at other places, at random.

    Args:
        volume: where people stand.
        pool: their poses.
        people: number of people of a scene.
        spacing: metres between places.
        repeats: number of times that somebody stands at each place.
        obstacles: boxes in which nobody stands.
        seed: seed of the draws.

    Raises:
        ValueError: no people, no repeats, or no place where a person can stand.
    """
    if people < 1 or repeats < 1:
        raise ValueError(f"expected at least 1 person and 1 repeat, got {people} people and {repeats} repeats")
    blocked = [taken_floor(each) for each in obstacles if each.center[2] - each.half[2] < _OVERHEAD]
    places = volume.places(spacing)
    for taken in blocked:
        places = places[~taken.contains(places)]
    if not len(places):
        raise ValueError("obstacles take the whole floor of the volume: nobody can stand in it; move or remove some")
    rng = stream(seed, "planning", "places")
    target = np.tile(np.arange(len(places)), repeats)
    position = places[target] + spacing * (rng.random((len(target), 2)) - 0.5)
    position = np.where(volume.contains(position)[:, None], position, places[target])
    for taken in blocked:
        position = np.where(taken.contains(position)[:, None], places[target], position)
    # The directions of one place are evenly spread, and begin at a random one.
    angle = rng.random(len(places))[target] + np.repeat(rng.permutation(repeats) / repeats, len(places))
    group = _grouped(position, rng.permutation(len(target)), people)
    pose = stream(seed, "planning", "poses").integers(len(pool), size=group.shape)
    return StandingScenes.posed(pool, places, target[group], pose, position[group], 2 * np.pi * (angle[group] + 0.0))


def taken_floor(obstacle: Box) -> Floor:
    """Return the floor on which nobody stands because of an obstacle: a quarter of a metre around it is included."""
    (x, y, z), (u, v, w) = obstacle.center, obstacle.half
    return Box((x, y, z), (u + _CLEARANCE, v + _CLEARANCE, w), obstacle.yaw).footprint


def _grouped(position: Floats, order: Integers, people: int) -> Integers:
    """Return groups of people, (S, Q), who are apart as far as possible; the last group is filled up with others."""
    count = -(-len(order) // people)
    groups: list[list[int]] = []
    unfilled: list[int] = []
    for person in order.tolist():
        chosen = -1
        for group in unfilled[:_TRIES]:
            away = position[groups[group]] - position[person]
            if ((away**2).sum(axis=1) >= APART**2).all():
                chosen = group
                break
        if chosen < 0 and len(groups) < count:
            chosen = len(groups)
            groups.append([])
            unfilled.append(chosen)
        elif chosen < 0:
            chosen = unfilled[0]
        groups[chosen].append(person)
        if len(groups[chosen]) == people:
            unfilled.remove(chosen)
    spare = iter(order.tolist() * people)
    for incomplete in groups:
        while len(incomplete) < people:
            incomplete.append(next(spare))
    return np.array(groups)
