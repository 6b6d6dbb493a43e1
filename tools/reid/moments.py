"""Moments to take pictures in: people in some pose each, somewhere at a site, amid things that hide them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.scenario.sections.room import Room
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import ObjectModel
from simharness.world.scene.placement.clutter import CLUTTER_KINDS
from tools.reid.filming_sites import Site
from tools.reid.identities import Figure
from tools.reid.poses import Poses, placed

_REACH = 1.5  # metres: half the side of the square in which people stand
_APART = 0.7  # metres between the middles of two people: they often hide each other
_BESIDE = 0.35  # metres from a person's middle to a thing
_LENS = 0.9  # metres around a camera that people and things leave free
_THINGS = (1, 6)
_TRIES = 60


@dataclass(frozen=True)
class Moment:
    """What is to be pictured.

    Attributes:
        meshes: of the people, then of everything else.
        joints: COCO-17 joints of the people, (P, 17, 3) metres.
        facing: where their pelvises face, radians from the x axis, (P,).
    """

    meshes: tuple[Mesh, ...]
    joints: Floats
    facing: Floats


def make_moment(key: Sequence[str | int], cast: Sequence[Figure], *, poses: Poses, site: Site) -> Moment:
    """Put people into a site, in some pose each, and things around them.

    Args:
        key: of the streams: a seed, and what names the moment.
        cast: P people, at least one.
        poses: of which each takes one.
        site: where it is.
    """
    seed, *rest = key
    rng = stream(int(seed), "train", *rest)
    spots = _spots(rng, len(cast), site.cameras)
    facing = rng.uniform(-np.pi, np.pi, len(cast))
    chosen = rng.integers(len(poses), size=len(cast))
    people, joints = [], []
    for figure, spot, angle, pose in zip(cast, spots, facing.tolist(), chosen, strict=True):
        bones, skin = placed(figure.body, poses.turns[pose], spot, angle)
        people.append(figure.mesh.moved(skin))
        joints.append(figure.body.joints(bones))
    things = _things(rng, site.room, spots, site.cameras)
    return Moment(meshes=(*people, *site.meshes, *things), joints=np.stack(joints), facing=facing)


def _spots(rng: np.random.Generator, count: int, cameras: Sequence[Camera]) -> Floats:
    """Where people stand, (P, 2) metres: not in one another, nor before a lens."""
    lenses = np.stack([camera.center[:2] for camera in cameras])
    tried, spots = rng.uniform(-_REACH, _REACH, (_TRIES, count, 2)), np.zeros((0, 2))
    for person in range(count):
        away = np.linalg.norm(tried[:, person, None] - spots, axis=2).min(axis=1, initial=np.inf)
        clear = np.linalg.norm(tried[:, person, None] - lenses, axis=2).min(axis=1) > _LENS
        best = int(np.argmax(clear & (away > _APART)))  # the first that fits
        spots = np.concatenate([spots, tried[best, person][None]])
    return spots


def _things(rng: np.random.Generator, room: Room, spots: Floats, cameras: Sequence[Camera]) -> list[Mesh]:
    """Things beside people, between them and the cameras more often than elsewhere."""
    lenses = np.stack([camera.center for camera in cameras])
    on_floor = np.column_stack([spots, np.zeros(len(spots))])
    meshes, taken = [], list[Box]()
    for _ in range(rng.integers(*_THINGS)):
        species = CLUTTER_KINDS[rng.integers(len(CLUTTER_KINDS))]
        thing = species.draw(rng, room)
        hull = _free(rng, thing, on_floor, lenses, taken)
        if hull is not None:
            box, where, yaw = hull
            taken.append(box)
            meshes.append(thing.at(where, yaw, kind="clutter", name=species.name).mesh)
    return meshes


def _free(
    rng: np.random.Generator, thing: ObjectModel, spots: Floats, lenses: Floats, taken: Sequence[Box]
) -> tuple[Box, Floats, float] | None:
    """Where a thing is in nobody's way, if there is such a place: its hull there, the place, the turn."""
    drawn = rng.random((_TRIES, 3))
    person, lens = rng.integers(len(spots), size=_TRIES), rng.integers(len(lenses), size=_TRIES)
    for k in range(_TRIES):
        toward = lenses[lens[k]] - spots[person[k]]
        bearing = np.arctan2(toward[1], toward[0]) + (2 * drawn[k, 0] - 1) ** 3 * np.pi
        reach = 0.6 + 1.2 * drawn[k, 1]
        where = spots[person[k], :2] + reach * np.array([np.cos(bearing), np.sin(bearing)])
        yaw = float(2 * np.pi * drawn[k, 2])
        box = thing.hull(where, yaw)
        clear = box.distance_on_floor(spots).min() > _BESIDE and box.distance(lenses).min() > _LENS
        if clear and all(box.gap_on_floor(other) > 0 for other in taken):
            return box, where, yaw
    return None
