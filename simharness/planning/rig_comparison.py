"""Rigs that a plan is compared with, those that people hang without a plan, on the same simulated people.

The value of the cameras of a room has its odds and its correction measured in that room before the search.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mvpose import Camera, Rig
from mvpose.arrays import Floats, Integers
from mvpose.commands.progress import Reporter, Silence
from simharness.planning.candidates import Candidate, candidate, places_in
from simharness.planning.fast_layer import FastLayer
from simharness.planning.planned_room import Room
from simharness.planning.rehearsal_scene import RehearsalSetup, SceneSettings
from simharness.planning.rig_value import Correction, RigValue, SightingOdds
from simharness.planning.simulated_scenes import Condition, SceneBatch, SceneResult, simulate_scenes
from simharness.types.random_streams import stream

VARIANT = "full"
"""Variant of the method that rigs are planned for."""

_CAMERAS = 30  # cameras in which the odds are counted
_SIZES = (3, 4, 4, 5, 5, 6)  # cameras of the rigs on which the correction is fitted
_PLACES = 32  # of the map of the search, about
_LEAST_LOSS = 0.2  # percent: smaller ones say nothing about the correction
_POWERS = (0.7, 3.0)
_ERRORS = (0.7, 1.6)


def layer_of(room: Room, *, places: int = _PLACES, repeats: int = 6, seed: int = 0) -> FastLayer:
    """Return the fast layer of a room.

    Args:
        room: the room.
        places: number of places of the map, about.
        repeats: number of people who stand at each place.
        seed: seed of the draws.
    """
    spacing = float(np.clip(np.sqrt(room.volume.area / places), 0.25, 3.0))
    return FastLayer.in_volume(
        room.volume,
        detector=room.detector,
        people=room.keys.people.count,
        spacing=spacing,
        orientations=repeats,
        draws=1,
        obstacles=room.blocking,
        seed=seed,
    )


def fit_value(room: Room, candidates: Sequence[Candidate], *, seed: int = 0) -> RigValue:
    """Return the value of sets of cameras: its figures are those of the method on random rigs of the room, on average.

    Args:
        room: the room.
        candidates: cameras that may hang in it.
        seed: seed of the scenes and of the rigs.

    Raises:
        ValueError: nobody can stand in the volume.
    """
    layer = layer_of(room, seed=seed)
    rng = stream(seed, "plan", "value")
    shown = [candidates[k] for k in rng.permutation(len(candidates))[:_CAMERAS]]
    odds = SightingOdds.measure(layer, [each.camera(room, name=f"odds{k}") for k, each in enumerate(shown)])
    plain = RigValue(room, layer, odds)
    if not odds.sightings:
        return plain
    figures = [_compared(room, layer, plain, candidates, rng.permutation(len(candidates))[:size]) for size in _SIZES]
    return RigValue(room, layer, odds, correction=_correction(np.array(figures)))


def _compared(
    room: Room, layer: FastLayer, value: RigValue, candidates: Sequence[Candidate], chosen: Integers
) -> tuple[float, float, float, float]:
    """Return the percentage of wrong parts and the error by the value, and by the method, of one rig."""
    cameras = [candidates[int(k)] for k in chosen]
    maps = value.maps([value.terms(each) for each in cameras])
    terms = [layer.terms(each.camera(room, name=f"cam{k}")) for k, each in enumerate(cameras)]
    if len(terms) < 2:
        return np.nan, np.nan, np.nan, np.nan
    figures = layer.predict(terms, variant=VARIANT).summary()
    error = maps.error_mm[np.isfinite(maps.error_mm)]
    return (
        100.0 - float(maps.pcp.mean()),
        float(error.mean()) if len(error) else np.nan,
        100.0 - figures["pcp"].mean,
        figures["mpjpe_mm"].mean,
    )


def _correction(figures: Floats) -> Correction:
    """Return the correction that fits figures (n, 4) best: a line between the logarithms of the losses."""
    figures = figures[np.isfinite(figures).all(axis=1)]
    figures = figures[(figures[:, [0, 2]] > _LEAST_LOSS).all(axis=1)]
    if len(figures) < 3:
        return Correction()
    power, offset = np.polyfit(np.log(figures[:, 0]), np.log(figures[:, 2]), 1)
    if not _POWERS[0] <= power <= _POWERS[1]:
        power = 1.0
        offset = float(np.mean(np.log(figures[:, 2]) - np.log(figures[:, 0])))
    error = float(np.clip(np.median(figures[:, 3] / figures[:, 1]), *_ERRORS))
    return Correction(float(np.exp(offset)), float(power), error)


_SPACING = (0.25, 0.3)  # metres between the places that are tried: on the mount and in height
_AIM = 0.95  # metres: the height of the hips


def rig_of(room: Room, candidates: Sequence[Candidate]) -> Rig:
    """Return the rig of the cameras that hang already and of candidates, which are named cam0, cam1, ..."""
    taken = {camera.name for camera in room.fixed}
    names = [name for k in range(len(candidates) + len(taken)) if (name := f"cam{k}") not in taken]
    return Rig([*room.fixed, *(each.camera(room, name=name) for each, name in zip(candidates, names, strict=False))])


def corner_rig(room: Room, count: int, *, lens: int = 0) -> list[Candidate]:
    """Return cameras in the corners of a room; after those, in the middles of its longest free stretches of wall.

    Args:
        room: the room.
        count: number of cameras.
        lens: index of the lens.
    """
    points = [corner for corner in room.space.outline]
    while len(points) < count:
        sides = np.roll(points, -1, axis=0) - points
        longest = int(np.argmax(np.linalg.norm(sides, axis=1)))
        points.insert(longest + 1, points[longest] + sides[longest] / 2)
    chosen = _spread(np.array(points), count)
    return _nearest(room, np.column_stack([chosen, np.full(count, 2.5)]), lens)


def ring_rig(room: Room, count: int) -> list[Candidate]:
    """Return cameras at equal bearings around the middle of the volume, as far out as the places allow; as above."""
    middle, reach = room.volume.middle, float(room.space.size.max())
    bearings = np.pi / count + 2 * np.pi * np.arange(count) / count
    away = middle + reach * np.column_stack([np.cos(bearings), np.sin(bearings)])
    return _nearest(room, np.column_stack([away, np.full(count, 2.2)]), 0, by_bearing=True)


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
