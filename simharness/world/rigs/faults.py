"""Faults of a rig: wrong calibration, drifting cameras, clock errors, lost pictures.

The true cameras are those of the scenario, so a constant calibration error changes no picture: it is applied to the
believed rig. Faults that grow with time move the true cameras, and the calibration, made at time 0, does not follow.
Every parameter scales draws of a separate stream, keyed by camera: a parameter twice as large gives the same error
twice as large, a higher chance adds events to those that a lower one has, and one more camera changes none of the
others.

Exposure schedule of a sequence: time and true camera of every picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera, Rig
from mvpose.checks import as_array, set_arrays
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.types.random_streams import stream


@dataclass(frozen=True, kw_only=True)
class ExposureSchedule:
    """Times and cameras of the pictures of T frames in V views.

    A view is what arrives under the name of one camera. If two cameras are swapped, the pictures of one arrive under
    the name of the other, with the times, losses and lens of the camera that took them.

    Raises:
        ValueError: a wrong shape, a time or drift that is not finite, a source later than its frame, a known time
            without a picture or the reverse, a camera_of_view that does not name each camera once, or a negative
            readout.
    """

    believed_rig: Rig
    """Calibration that the method is given, V cameras."""
    true_cameras: Rig
    """The true cameras as they stand at time 0, V, in the order of the scenario."""
    time: Floats
    """Time at which the picture delivered by a view in a frame was taken (middle of the exposure), (T, V), seconds; if
    nothing arrives, the time at which it would have been taken."""
    source: Integers
    """Frame in which that picture was taken, (T, V): the frame itself, an earlier one if the camera repeats its last
    picture, -1 if nothing arrives."""
    known_time: Floats
    """Time of that picture as the method is given it, (T, V), seconds; NaN if nothing arrives."""
    camera_of_view: Integers
    """Index of the true camera that takes the pictures of each view, (V,)."""
    rotation_rate: Floats
    """Drift of the true cameras about their own x, y, z axes, (V, 3), rad/s."""
    velocity: Floats
    """Drift of the centres of the true cameras, (V, 3), m/s."""
    readout: float = 0.0
    """Seconds from the first to the last row of a picture."""

    def __post_init__(self) -> None:
        views = len(self.believed_rig)
        if len(self.true_cameras) != views:
            raise ValueError(f"expected as many true cameras as believed ones, {views}, got {len(self.true_cameras)}")
        set_arrays(
            self,
            time=("T", views),
            source=(("T", views), np.int64),
            known_time=("T", views),
            camera_of_view=((views,), np.int64),
            rotation_rate=(views, 3),
            velocity=(views, 3),
        )
        for name in ("time", "rotation_rate", "velocity"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} must be finite, but has values that are not")
        if (self.source < -1).any() or (self.source > np.arange(len(self.time))[:, None]).any():
            raise ValueError("source must be -1 or a frame that is not later than the frame of its row")
        if not np.array_equal(np.isfinite(self.known_time), self.source >= 0):
            raise ValueError("known_time must be finite where a picture arrives, and NaN elsewhere")
        if sorted(self.camera_of_view) != list(range(views)):
            got = self.camera_of_view.tolist()
            raise ValueError(f"camera_of_view must name each of {views} cameras once, got {got}")
        if not 0.0 <= self.readout < np.inf:
            raise ValueError(f"readout must be finite and not negative, got {self.readout}")

    @classmethod
    def ideal(cls, rig: Rig, time: ArrayLike) -> "ExposureSchedule":
        """Return the schedule of a rig without faults: every camera as believed, all pictures at ``time`` (T,), s."""
        return schedule_exposures(rig, FaultsSection(), time, seed=0)

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.time)

    @cached_property
    def delivered(self) -> NDArray[np.bool_]:
        """Whether a picture arrives, for each frame and view, (T, V)."""
        return self.source >= 0

    @cached_property
    def true_rig(self) -> Rig:
        """True cameras at time 0 in the order of the views: the camera that takes the pictures of each view, V."""
        return Rig([self.true_cameras[int(index)] for index in self.camera_of_view])

    def camera(self, frame: int, view: int) -> Camera:
        """Return the true camera, drift included, that took the picture delivered by ``view`` in ``frame``."""
        index = self.camera_of_view[view]
        time = float(self.time[frame, view])
        return moved(self.true_cameras[index], time * self.rotation_rate[index], time * self.velocity[index])


def moved(camera: Camera, rotation: ArrayLike, shift: ArrayLike) -> Camera:
    """Return the camera rotated and moved.

    Args:
        camera: the camera.
        rotation: rotation vector about the camera's own axes and centre, (3,), radians.
        shift: movement of the centre in the world, (3,), metres.
    """
    rotation, shift = np.asarray(rotation, float), np.asarray(shift, float)
    if not rotation.any() and not shift.any():
        return camera
    # Axes and observed points rotate in opposite directions.
    R = Rotation.from_rotvec(rotation).as_matrix().T @ camera.R
    return replace(camera, R=R, t=-R @ (camera.center + shift))


MAX_CLOCK_ERROR = 0.9  # seconds from a frame to its picture: motions are planned a second beyond the sequence
_MINUTE = 60.0


def camera_phases(cameras: CamerasSection, views: int, *, period: float, seed: int) -> Floats:
    """Return the time from each frame to the picture of each camera, (V,), seconds, without faults of its clock.

    A camera that is not triggered takes its pictures at any time. The picture of a frame is the nearest one, within
    half a frame before or after.

    Args:
        cameras: section [cameras].
        views: number of cameras, V.
        period: time between frames, seconds.
        seed: seed of the scenario.
    """
    if cameras.trigger == "common":
        return np.zeros(views)
    return period * np.array([stream(seed, "cameras", "phase", view).random() - 0.5 for view in range(views)])


def schedule_exposures(
    rig: Rig,
    faults: FaultsSection,
    time: ArrayLike,
    *,
    seed: int,
    phases: ArrayLike | None = None,
    every: Sequence[int] = (),
) -> ExposureSchedule:
    """Return the exposure schedule of a sequence with the faults of a scenario.

    Spreads are standard deviations of normal draws over cameras:

    - ``focal``: both believed focal lengths are the true ones times exp(draw); ``center`` is added to the principal
      point;
    - ``rotation``: the believed orientation is rotated about the camera's own axes; ``translation`` is added to its
      centre;
    - ``rotation_drift``, ``translation_drift``: each true camera turns and moves at a constant speed from time 0 on;
    - ``clock_offset`` (per camera) and ``clock_jitter`` (per picture) are added to the time of a picture; their sum is
      clipped to 0.9 s, with the phase. The method is given the times without these two, unless ``clocks_known``;
    - ``dropped`` and ``frozen`` are chances per picture. A frozen camera repeats its last picture that arrived; if none
      has arrived yet, it delivers a new one. The method is given the time of a new picture. A dropped picture does not
      arrive, frozen or not;
    - ``rolling_shutter`` is the readout of all cameras, in the believed rig as well;
    - ``dead`` cameras deliver nothing; two ``swapped`` cameras each deliver the pictures of the other.

    Args:
        rig: true cameras, V.
        faults: parameters of the faults.
        time: times of the frames, (T,), seconds.
        seed: seed of the scenario.
        phases: from :func:`camera_phases`, (V,), seconds; by default 0.
        every: numbers that the cameras take in turn; of number n, a camera delivers a picture in every n-th frame.

    Raises:
        ValueError: ``dead`` or ``swapped`` name a camera that is not in the rig, a camera is swapped twice or with
            itself, or two cameras with pictures of different sizes are swapped.
    """
    time = as_array(time, ("T",), "time")
    phases = np.zeros(len(rig)) if phases is None else as_array(phases, (len(rig),), "phases")
    camera_of_view = _cameras_of_views(faults, rig)
    _check_exists(f"faults.dead = {_as_toml(faults.dead)}", faults.dead, rig)
    turns = [every[view % len(every)] if every else 1 for view in range(len(rig))]
    source = np.stack([_sources(faults, len(time), seed, view, turns[view]) for view in range(len(rig))], axis=1)
    source[:, list(faults.dead)] = -1
    clock = np.stack([_clock(faults, time, seed, view, phases[view]) for view in range(len(rig))], axis=1)
    known = clock if faults.clocks_known else time[:, None] + np.clip(phases, -MAX_CLOCK_ERROR, MAX_CLOCK_ERROR)
    known = np.where(source < 0, np.nan, known)
    taken_in = np.where(source < 0, np.arange(len(time))[:, None], source)
    taken_at = np.take_along_axis(clock, taken_in, axis=0)
    return ExposureSchedule(
        believed_rig=_believed(rig, faults, seed),
        true_cameras=rig,
        time=taken_at[:, camera_of_view],
        source=source[:, camera_of_view],
        known_time=known[:, camera_of_view],
        camera_of_view=camera_of_view,
        rotation_rate=np.radians(faults.rotation_drift) / _MINUTE * _normals(seed, "rotation drift", len(rig)),
        velocity=faults.translation_drift / _MINUTE * _normals(seed, "translation drift", len(rig)),
        readout=faults.rolling_shutter,
    )


def _believed(rig: Rig, faults: FaultsSection, seed: int) -> Rig:
    """Return the rig with constant calibration errors, and with the readout of its cameras, which data sheets name."""
    if faults.rolling_shutter:
        rig = Rig([replace(camera, readout=faults.rolling_shutter) for camera in rig])
    rotations = np.radians(faults.rotation) * _normals(seed, "rotation", len(rig))
    shifts = faults.translation * _normals(seed, "translation", len(rig))
    lengths = np.exp(faults.focal * _normals(seed, "focal", len(rig), 1)[:, 0])
    centers = faults.center * _normals(seed, "center", len(rig), 2)
    if not any(errors.any() for errors in (rotations, shifts, centers, lengths - 1.0)):
        return rig
    return Rig(
        [
            moved(_with_intrinsics_error(camera, length, center), rotation, shift)
            for camera, length, center, rotation, shift in zip(rig, lengths, centers, rotations, shifts, strict=True)
        ]
    )


def _with_intrinsics_error(camera: Camera, length: float, center: Floats) -> Camera:
    """Return the camera with focal lengths and skew times ``length``, principal point moved by ``center`` pixels."""
    K = camera.K.copy()
    K[:2, :2] *= length
    K[:2, 2] += center
    return replace(camera, K=K)


def _normals(seed: int, fault: str, views: int, count: int = 3) -> Floats:
    """Draw standard normal numbers for every camera, (V, count)."""
    return np.stack([stream(seed, "faults", fault, view).standard_normal(count) for view in range(views)])


def _clock(faults: FaultsSection, time: Floats, seed: int, view: int, phase: float) -> Floats:
    """Return the times at which one camera takes the pictures of the frames, (T,) seconds."""
    offset = faults.clock_offset * stream(seed, "faults", "clock offset", view).standard_normal()
    jitter = faults.clock_jitter * stream(seed, "faults", "clock jitter", view).standard_normal(len(time))
    return time + np.clip(phase + offset + jitter, -MAX_CLOCK_ERROR, MAX_CLOCK_ERROR)


def _sources(faults: FaultsSection, frames: int, seed: int, view: int, every: int) -> Integers:
    """Return the frame of the picture that one camera delivers in every frame, (T,); -1 for none."""
    dropped = stream(seed, "faults", "dropped", view).random(frames) < faults.dropped
    dropped |= np.arange(frames) % every > 0
    frozen = stream(seed, "faults", "frozen", view).random(frames) < faults.frozen
    fresh = ~dropped & ~frozen
    # The first picture that arrives has none to repeat: it is new whether the camera froze or not.
    fresh[np.flatnonzero(~dropped)[:1]] = True
    latest = np.maximum.accumulate(np.where(fresh, np.arange(frames), -1))
    return np.where(dropped, -1, latest)


def _cameras_of_views(faults: FaultsSection, rig: Rig) -> Integers:
    """Return the index of the camera that takes the pictures of each view, (V,)."""
    camera_of_view = np.arange(len(rig))
    for a, b in faults.swapped:
        _check_exists(f"faults.swapped = {_as_toml(faults.swapped)}", (a, b), rig)
        if a == b:
            raise ValueError(f"faults.swapped names camera {a} with itself; expected pairs of two different cameras")
        if camera_of_view[a] != a or camera_of_view[b] != b:
            raise ValueError(
                f"faults.swapped = {_as_toml(faults.swapped)} swaps camera {a if camera_of_view[a] != a else b} twice; "
                "expected each camera in one pair at most"
            )
        if rig[a].size != rig[b].size:
            raise ValueError(
                "faults.swapped: the pictures of cameras {} and {} have different sizes, {} x {} and {} x {}, so the "
                "swap would be obvious; swap cameras of one size".format(a, b, *rig[a].size, *rig[b].size)
            )
        camera_of_view[a], camera_of_view[b] = b, a
    return camera_of_view


def _check_exists(key: str, cameras: tuple[int, ...], rig: Rig) -> None:
    beyond = [camera for camera in cameras if camera >= len(rig)]
    if beyond:
        raise ValueError(
            f"{key} names camera {beyond[0]}, but the rig has {len(rig)} cameras: expected 0 to {len(rig) - 1}"
        )


def _as_toml(value: tuple) -> str:
    return str(value).replace(",)", ")").replace("(", "[").replace(")", "]")
