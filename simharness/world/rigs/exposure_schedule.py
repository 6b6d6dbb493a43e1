"""Exposure schedule of a sequence: time and true camera of every picture."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera, Rig
from mvpose.checks import as_array, set_arrays


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
        time = as_array(time, ("T",), "time")
        shape = (len(time), len(rig))
        return cls(
            believed_rig=rig,
            true_cameras=rig,
            time=np.broadcast_to(time[:, None], shape),
            source=np.broadcast_to(np.arange(len(time))[:, None], shape),
            known_time=np.broadcast_to(time[:, None], shape),
            camera_of_view=np.arange(len(rig)),
            rotation_rate=np.zeros((len(rig), 3)),
            velocity=np.zeros((len(rig), 3)),
        )

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
        return moved(
            self.true_cameras[index],
            float(self.time[frame, view]) * self.rotation_rate[index],
            float(self.time[frame, view]) * self.velocity[index],
        )


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
    R = (
        Rotation.from_rotvec(rotation).as_matrix().T @ camera.R
    )  # axes and observed points rotate in opposite directions
    return replace(camera, R=R, t=-R @ (camera.center + shift))
