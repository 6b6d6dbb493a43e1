"""Rigs of candidates, and their comparison on the same simulated people."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from mvpose import Camera, Rig
from simharness.planning.candidates import Candidate
from simharness.planning.rehearsal_scene import SceneSettings
from simharness.planning.room import Room
from simharness.planning.scene_results import Condition, SceneResult
from simharness.planning.simulation import SceneBatch, simulate_scenes
from simharness.planning.value_fit import VARIANT, obstacles_of
from simharness.planning.volume import Volume
from simharness.runtime.progress import Reporter, Silence
from simharness.types.random_streams import stream


def rig_of(room: Room, candidates: Sequence[Candidate]) -> Rig:
    """Return the rig of the cameras that hang already and of candidates, which are named cam0, cam1, ..."""
    taken = {camera.name for camera in room.fixed}
    names = [name for k in range(len(candidates) + len(taken)) if (name := f"cam{k}") not in taken]
    return Rig([*room.fixed, *(each.camera(room, name=name) for each, name in zip(candidates, names, strict=False))])


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
    settings = SceneSettings(
        Rig(union),
        Volume(room.volume, room.volume_height),
        room.keys.people.count,
        room.detector,
        obstacles=obstacles_of(room),
        variant=VARIANT,
        whole=conditions[0].cameras,
    )
    drawn = tuple(int(stream(seed, "plan", "scene", number).integers(2**31)) for number in seeds)
    with (reporter or Silence()).stage("simulate", len(drawn)) as advance:
        batch = SceneBatch(settings, tuple(conditions), drawn)
        (results,) = simulate_scenes([batch], workers=workers, progress=advance)
    return results, conditions
