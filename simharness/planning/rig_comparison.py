"""Rigs that a plan is compared with, those that people hang without a plan, on the same simulated people."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from mvpose.commands.progress import Reporter, Silence
from simharness.planning.candidates import Candidate, candidate, places_in
from simharness.planning.planned_room import Room
from simharness.planning.rehearsal_scene import SceneSettings
from simharness.planning.rehearsal_setup import RehearsalSetup
from simharness.planning.simulated_scenes import Condition, SceneBatch, SceneResult, simulate_scenes
from simharness.planning.value_fit import VARIANT
from simharness.types.random_streams import stream

_SPACING = (0.25, 0.3)  # metres between the places that are tried: on the mount and in height
_AIM = 0.95  # metres: the height of the hips


def rig_of(room: Room, candidates: Sequence[Candidate]) -> Rig:
    """Return the rig of the cameras that hang already and of candidates, which are named cam0, cam1, ..."""
    taken = {camera.name for camera in room.fixed}
    names = [name for k in range(len(candidates) + len(taken)) if (name := f"cam{k}") not in taken]
    return Rig([*room.fixed, *(each.camera(room, name=name) for each, name in zip(candidates, names, strict=False))])


def corner_rig(room: Room, count: int, *, height: float = 2.5, lens: int = 0) -> list[Candidate]:
    """Return cameras in the corners of a room; after those, in the middles of its longest free stretches of wall.

    Args:
        room: the room.
        count: number of cameras.
        height: preferred height, metres.
        lens: index of the lens.
    """
    points = [corner for corner in room.space.outline]
    while len(points) < count:
        sides = np.roll(points, -1, axis=0) - points
        longest = int(np.argmax(np.linalg.norm(sides, axis=1)))
        points.insert(longest + 1, points[longest] + sides[longest] / 2)
    chosen = _spread(np.array(points), count)
    return _nearest(room, np.column_stack([chosen, np.full(count, height)]), lens)


def ring_rig(room: Room, count: int, *, height: float = 2.2, lens: int = 0) -> list[Candidate]:
    """Return cameras at equal bearings around the middle of the volume, as far out as the places allow; as above."""
    middle, reach = room.volume.middle, float(room.space.size.max())
    bearings = np.pi / count + 2 * np.pi * np.arange(count) / count
    away = middle + reach * np.column_stack([np.cos(bearings), np.sin(bearings)])
    return _nearest(room, np.column_stack([away, np.full(count, height)]), lens, by_bearing=True)


def simulate_rigs(
    room: Room,
    rigs: Sequence[Rig],
    *,
    seeds: Sequence[int],
    seed: int = 0,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> tuple[list[SceneResult], list[Condition]]:
    """Simulate scenes of a room, seen by several rigs at once, and score each rig on the same people.

    Args:
        room: the room.
        rigs: the rigs.
        seeds: numbers of the scenes.
        seed: seed from which the seeds of the scenes are drawn.
        workers: number of processes.
        reporter: receiver of progress.

    Returns:
        Results by scene, and the condition of each rig in them.
    """
    union: list[Camera] = []
    conditions = []
    for n, rig in enumerate(rigs):
        first = len(union)
        union += [dataclasses.replace(camera, name=f"rig{n} {camera.name}") for camera in rig]
        conditions.append(Condition(tuple(range(first, len(union)))))
    setup = RehearsalSetup.in_room(room)
    settings = SceneSettings(Rig(union), setup, variant=VARIANT, whole=conditions[0].cameras)
    drawn = tuple(int(stream(seed, "plan", "scene", number).integers(2**31)) for number in seeds)
    with (reporter or Silence()).stage("simulate", len(drawn)) as advance:
        batch = SceneBatch(settings, tuple(conditions), drawn)
        (results,) = simulate_scenes([batch], workers=workers, progress=advance)
    return results, conditions


def _spread(points: Floats, count: int) -> Floats:
    """Return ``count`` of points (n, 2): the first, then always the one farthest from those taken."""
    taken = [0]
    while len(taken) < count:
        away = np.linalg.norm(points[:, None] - points[taken][None], axis=-1).min(axis=1)
        taken.append(int(np.argmax(away)))
    return points[taken]


def _nearest(room: Room, wanted: Floats, lens: int, *, by_bearing: bool = False) -> list[Candidate]:
    """Return cameras at the free places nearest to wanted points (n, 3), or in their directions from the middle."""
    places = places_in(room, spacing=_SPACING[0], levels=_SPACING[1])
    positions = np.array([place for _, place in places])
    middle = room.volume.middle
    free = np.ones(len(places), bool)
    found = []
    for point in wanted:
        if by_bearing:
            ways, way = positions[:, :2] - middle, point[:2] - middle
            turn = np.abs(np.angle(np.exp(1j * (np.arctan2(*ways.T[::-1]) - np.arctan2(way[1], way[0])))))
            away = 10.0 * turn + np.abs(positions[:, 2] - point[2])
        else:
            away = np.linalg.norm(positions - point, axis=1)
        away = np.where(free, away, np.inf)
        index = int(np.argmin(away))
        free &= np.linalg.norm(positions - positions[index], axis=1) >= max(room.keys.cameras.spacing, 1e-6)
        found.append(candidate(places[index][0], lens, positions[index], np.append(middle, _AIM)))
    return found
