"""Scenes of the fast layer whose people stand as in a recording, in the poses of its pool that are nearest."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.checks import as_array
from simharness.planning.standing_people import PosePool, StandingScenes, bearings_of
from simharness.types.random_streams import stream

_LIMBS = slice(5, 17)  # of COCO-17: shoulders to ankles


def recorded_scenes(
    tracks: Floats, pool: PosePool, places: Floats, *, repeats: int, seed: int = 0
) -> tuple[StandingScenes, Integers]:
    """Return scenes whose people stand as in recorded frames, evenly spread over the recording.

    Args:
        tracks: joints of people who walk in the volume, COCO-17, (T, P, 17, 3), metres, NaN where a person is absent.
        pool: poses.
        places: places of the map, (P, 2), metres.
        repeats: number of people for each place.
        seed: seed of the draws.

    Returns:
        The S scenes, and the frame of each, (S,).
    """
    tracks = as_array(tracks, ("T", "P", 17, 3), "joints of recorded people")
    here = np.asarray(np.isfinite(tracks[..., [5, 6, 11, 12], :]).all(axis=(-1, -2)))
    frames = np.flatnonzero(here.any(axis=1))
    wanted = max(1, round(repeats * len(places) / max(here[frames].sum(axis=1).mean(), 1.0)))
    offset = stream(seed, "planning", "frames").random()
    chosen = frames[((np.arange(wanted) + offset) / wanted * len(frames)).astype(int)]
    joints, present = tracks[chosen], here[chosen]
    position = np.where(present[..., None], joints[:, :, 11:13, :2].mean(axis=2), np.nan)
    angle = np.where(present, bearings_of(joints), np.nan)
    local = joints - np.concatenate([position, np.zeros((*present.shape, 1))], axis=-1)[:, :, None]
    turn = Rotation.from_euler("z", np.nan_to_num(angle).reshape(-1, 1)).as_matrix().reshape(*present.shape, 3, 3)
    pose = nearest(pool, np.einsum("sqji,sqlj->sqli", turn, local).reshape(-1, 17, 3)).reshape(present.shape)
    away = ((np.nan_to_num(position)[:, :, None] - places) ** 2).sum(axis=-1)
    return StandingScenes.posed(pool, places, away.argmin(axis=-1), pose, position, angle), chosen


def nearest(pool: PosePool, joints: Floats) -> Integers:
    """Return the pose whose limbs are nearest to those of n poses (n, 17, 3) over the origin, facing +x, (n,)."""
    own = pool.landmarks[:, _LIMBS].reshape(len(pool), -1)
    given = np.nan_to_num(joints[:, _LIMBS].reshape(len(joints), -1))
    return ((given**2).sum(axis=1)[:, None] - 2 * given @ own.T + (own**2).sum(axis=1)).argmin(axis=1)
