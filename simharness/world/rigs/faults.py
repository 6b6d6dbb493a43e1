"""What goes wrong with a rig: wrong calibration, cameras that move, clocks that differ, pictures that go missing.

The true cameras are those of the scenario, so a constant error of calibration changes no picture: it goes into what
the method believes. What changes with time moves the true cameras, and the calibration, made at time 0, does not
follow. Every dial scales draws of its own, keyed by camera: twice the dial is the same error twice as large, a
chance turned up adds events to those there were, and one camera more changes none of the others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera, Rig
from mvpose.checks import as_array
from simharness.scenario.sections.scenario import Faults
from simharness.types.random_streams import stream
from simharness.world.rigs.shots import Shots, moved

FARTHEST = 0.9  # seconds that a picture is off its frame at most: motions are planned a second beyond the sequence
_MINUTE = 60.0


def shoot(rig: Rig, faults: Faults, time: ArrayLike, *, seed: int) -> Shots:
    """Take the pictures of a sequence with the faults of a scenario.

    Spreads are standard deviations of normal draws over cameras:

    - ``focal``: both believed focal lengths are the true ones times exp(draw); ``center`` adds to the principal point;
    - ``rotation``: the believed orientation is turned about the camera's own axes; ``translation`` adds to its centre;
    - ``rotation_drift``, ``translation_drift``: each true camera turns and moves at a constant speed from time 0 on;
    - ``clock_offset`` (per camera) and ``clock_jitter`` (per picture) add to the time of a picture, within 0.9 s;
    - ``dropped`` and ``frozen`` are chances per picture. A camera repeats the last picture that arrived from it; where
      none has arrived yet, it delivers a new one. What is dropped does not arrive, frozen or not;
    - ``dead`` cameras deliver nothing; of ``swapped`` ones, each delivers all that is the other's.

    Args:
        rig: the true cameras, V.
        faults: the dials.
        time: of the frames, (T,), seconds.
        seed: of the scenario.

    Raises:
        ValueError: ``dead`` or ``swapped`` name a camera that the rig has not, a camera is swapped twice or with
            itself, or two cameras with pictures of different sizes are swapped.
    """
    time = as_array(time, ("T",), "time")
    taker = _takers(faults, rig)
    dead = _dead(faults, rig)
    if not len(time):
        return replace(Shots.ideal(rig, time), believed=_believed(rig, faults, seed), taker=taker)
    source = np.stack([_sources(faults, len(time), seed, view) for view in range(len(rig))], axis=1)
    source[:, dead] = -1
    clock = np.stack([_clock(faults, time, seed, view) for view in range(len(rig))], axis=1)
    own = np.where(source < 0, np.arange(len(time))[:, None], source)
    taken = np.take_along_axis(clock, own, axis=0)
    return Shots(
        believed=_believed(rig, faults, seed),
        true=rig,
        time=taken[:, taker],
        source=source[:, taker],
        taker=taker,
        turn=np.radians(faults.rotation_drift) / _MINUTE * _normals(seed, "rotation drift", len(rig)),
        travel=faults.translation_drift / _MINUTE * _normals(seed, "translation drift", len(rig)),
        readout=faults.rolling_shutter,
    )


def _believed(rig: Rig, faults: Faults, seed: int) -> Rig:
    """The rig with its constant errors of calibration."""
    turns = np.radians(faults.rotation) * _normals(seed, "rotation", len(rig))
    shifts = faults.translation * _normals(seed, "translation", len(rig))
    lengths = np.exp(faults.focal * _normals(seed, "focal", len(rig), 1)[:, 0])
    centers = faults.center * _normals(seed, "center", len(rig), 2)
    if not any(errors.any() for errors in (turns, shifts, centers, lengths - 1.0)):
        return rig
    return Rig(
        [
            moved(_relensed(camera, length, center), turn, shift)
            for camera, length, center, turn, shift in zip(rig, lengths, centers, turns, shifts, strict=True)
        ]
    )


def _relensed(camera: Camera, length: float, center: Floats) -> Camera:
    """The camera with focal lengths (and skew) times ``length`` and the principal point moved by ``center`` pixels."""
    K = camera.K.copy()
    K[:2, :2] *= length
    K[:2, 2] += center
    return replace(camera, K=K)


def _normals(seed: int, fault: str, views: int, count: int = 3) -> Floats:
    """Standard normal draws of every camera, (V, count)."""
    return np.stack([stream(seed, "faults", fault, view).standard_normal(count) for view in range(views)])


def _clock(faults: Faults, time: Floats, seed: int, view: int) -> Floats:
    """When one camera takes the picture of every frame, (T,)."""
    offset = faults.clock_offset * stream(seed, "faults", "clock offset", view).standard_normal()
    jitter = faults.clock_jitter * stream(seed, "faults", "clock jitter", view).standard_normal(len(time))
    return time + np.clip(offset + jitter, -FARTHEST, FARTHEST)


def _sources(faults: Faults, frames: int, seed: int, view: int) -> Integers:
    """The frame of the picture that one camera delivers in every frame, (T,); -1: none."""
    dropped = stream(seed, "faults", "dropped", view).random(frames) < faults.dropped
    frozen = stream(seed, "faults", "frozen", view).random(frames) < faults.frozen
    fresh = ~dropped & ~frozen
    # The first picture that arrives repeats none, so it is a new one whether the camera froze or not.
    fresh[np.argmin(dropped)] |= not dropped.all()
    latest = np.maximum.accumulate(np.where(fresh, np.arange(frames), -1))
    return np.where(dropped, -1, latest)


def _takers(faults: Faults, rig: Rig) -> Integers:
    """Which camera's pictures each view delivers, (V,)."""
    taker = np.arange(len(rig))
    for a, b in faults.swapped:
        _check_exists(f"faults.swapped = {_written(faults.swapped)}", (a, b), rig)
        if a == b:
            raise ValueError(f"faults.swapped names camera {a} with itself; expected pairs of two different cameras")
        if taker[a] != a or taker[b] != b:
            raise ValueError(
                f"faults.swapped = {_written(faults.swapped)} swaps camera {a if taker[a] != a else b} twice; expected "
                "each camera in one pair at most"
            )
        if rig[a].size != rig[b].size:
            raise ValueError(
                f"faults.swapped: the pictures of cameras {a} and {b} have different sizes, {_by(rig[a].size)} and "
                f"{_by(rig[b].size)}: anybody would notice; swap cameras of one size"
            )
        taker[a], taker[b] = b, a
    return taker


def _dead(faults: Faults, rig: Rig) -> Integers:
    _check_exists(f"faults.dead = {_written(faults.dead)}", faults.dead, rig)
    return np.array(faults.dead, np.int64)


def _check_exists(key: str, cameras: tuple[int, ...], rig: Rig) -> None:
    beyond = [camera for camera in cameras if camera >= len(rig)]
    if beyond:
        raise ValueError(
            f"{key} names camera {beyond[0]}, but the rig has {len(rig)} cameras: expected 0 to {len(rig) - 1}"
        )


def _written(value: tuple) -> str:
    return str(value).replace(",)", ")").replace("(", "[").replace(")", "]")


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
