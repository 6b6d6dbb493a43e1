"""Moments of the re-ID data set: posed people at a filming site, with objects that occlude them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import ObjectModel
from simharness.world.scene.placement.clutter import CLUTTER_KINDS
from tools.reid.filming_sites import Site
from tools.reid.identities import DressedPerson
from tools.reid.poses import Poses, place_body
from tools.reid.site_rooms import REACH

_APART = 0.7  # least distance between the centres of two people, metres: they often occlude each other
_BESIDE = 0.35  # least distance from the centre of a person to an object, metres
_LENS = 0.9  # radius around a camera without people and objects, metres
_OBJECTS = (1, 6)  # least number of objects, and upper bound, exclusive
_TRIES = 60


@dataclass(frozen=True)
class Moment:
    """Static scene with P people.

    Attributes:
        meshes: meshes of the people, then of everything else.
        joints: COCO-17 joints of the people, (P, 17, 3) metres.
        facing: direction that the pelvis of each person faces, radians from the x axis, (P,).
    """

    meshes: tuple[Mesh, ...]
    joints: Floats
    facing: Floats


def make_moment(key: Sequence[str | int], people: Sequence[DressedPerson], *, poses: Poses, site: Site) -> Moment:
    """Place people in random poses at a site, with objects around them.

    Args:
        key: key of the random stream: a seed, then the names and numbers of the moment.
        people: P people, at least one.
        poses: poses to choose from.
        site: filming site.
    """
    seed, *rest = key
    rng = stream(int(seed), "train", *rest)
    positions = _standing_positions(rng, len(people), site.cameras)
    facing = rng.uniform(-np.pi, np.pi, len(people))
    chosen = rng.integers(len(poses), size=len(people))
    meshes, joints = [], []
    for person, position, angle, pose in zip(people, positions, facing.tolist(), chosen, strict=True):
        bones, skin = place_body(person.body, poses.turns[pose], position, angle)
        meshes.append(person.mesh.moved(skin))
        joints.append(person.body.joints(bones))
    objects = _object_meshes(rng, site, positions)
    return Moment(meshes=(*meshes, *site.meshes, *objects), joints=np.stack(joints), facing=facing)


def _standing_positions(rng: np.random.Generator, count: int, cameras: Sequence[Camera]) -> Floats:
    """Draw the positions of people, (P, 2) metres, apart from each other and from the cameras."""
    lenses = np.stack([camera.center[:2] for camera in cameras])
    candidates, positions = rng.uniform(-REACH, REACH, (_TRIES, count, 2)), np.zeros((0, 2))
    for person in range(count):
        away = np.linalg.norm(candidates[:, person, None] - positions, axis=2).min(axis=1, initial=np.inf)
        clear = np.linalg.norm(candidates[:, person, None] - lenses, axis=2).min(axis=1) > _LENS
        chosen = int(np.argmax(clear & (away > _APART)))  # the first free one, or the first of all if none is free
        positions = np.concatenate([positions, candidates[chosen, person][None]])
    return positions


def _object_meshes(rng: np.random.Generator, site: Site, positions: Floats) -> list[Mesh]:
    """Draw objects near people, more often between them and the cameras than elsewhere.

    The meshes are not still, as those of other moments are not the same: the light of the room is computed without
    them, and once.
    """
    lenses = np.stack([camera.center for camera in site.cameras])
    on_floor = np.column_stack([positions, np.zeros(len(positions))])
    meshes, taken = [], list(site.furniture)
    for _ in range(rng.integers(*_OBJECTS)):
        kind = CLUTTER_KINDS[rng.integers(len(CLUTTER_KINDS))]
        model = kind.draw(rng, site.room)
        placement = _free_placement(rng, model, on_floor, lenses, taken)
        if placement is not None:
            box, position, yaw = placement
            taken.append(box)
            solid = model.at(position, yaw, kind="clutter", name=kind.name)
            meshes.append(replace(solid.mesh, still=False))
    return meshes


def _free_placement(
    rng: np.random.Generator, model: ObjectModel, people: Floats, lenses: Floats, taken: Sequence[Box]
) -> tuple[Box, Floats, float] | None:
    """Return the hull, position and yaw of an object clear of people, lenses and other objects, or None."""
    drawn = rng.random((_TRIES, 3))
    person, lens = rng.integers(len(people), size=_TRIES), rng.integers(len(lenses), size=_TRIES)
    for k in range(_TRIES):
        toward = lenses[lens[k]] - people[person[k]]
        bearing = np.arctan2(toward[1], toward[0]) + (2 * drawn[k, 0] - 1) ** 3 * np.pi
        reach = 0.6 + 1.2 * drawn[k, 1]
        position = people[person[k], :2] + reach * np.array([np.cos(bearing), np.sin(bearing)])
        yaw = float(2 * np.pi * drawn[k, 2])
        box = model.hull(position, yaw)
        clear = box.distance_on_floor(people).min() > _BESIDE and box.distance(lenses).min() > _LENS
        if clear and all(box.gap_on_floor(other) > 0 for other in taken):
            return box, position, yaw
    return None
