"""When, and by which camera, every picture is taken: what a rig really does beside what is believed of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera, Rig
from mvpose.checks import as_array


@dataclass(frozen=True, kw_only=True)
class Shots:
    """The pictures of T frames in V views.

    A view is what arrives under the name of one camera. Where two cameras are swapped, the pictures of one arrive as
    those of the other, with its times, its losses and its lens.

    Attributes:
        believed: the calibration that the method is told, V cameras.
        true: the cameras as they hang at time 0, V.
        time: when the picture that a view delivers in a frame was taken (the middle of its exposure), (T, V),
            seconds; where nothing arrives, when it would have been.
        source: the frame in which that picture was taken, (T, V): the frame itself, an earlier one where the camera
            repeats its last picture, -1 where nothing arrives.
        taker: which of the true cameras' pictures each view delivers, (V,).
        turn: how the true cameras turn, about their own x, y, z axes, (V, 3), rad/s.
        travel: how they move, (V, 3), m/s.
        readout: seconds from the first to the last row of a picture.

    Raises:
        ValueError: a wrong shape, a time or a speed that is not finite, a source that is no frame up to its own, takers
            that are not each camera once, a negative readout.
    """

    believed: Rig
    true: Rig
    time: Floats
    source: Integers
    taker: Integers
    turn: Floats
    travel: Floats
    readout: float = 0.0

    def __post_init__(self) -> None:
        views = len(self.believed)
        if len(self.true) != views:
            raise ValueError(f"expected as many true cameras as believed ones, {views}, got {len(self.true)}")
        time = as_array(self.time, ("T", views), "time")
        source = as_array(self.source, (len(time), views), "source", np.int64)
        taker = as_array(self.taker, (views,), "taker", np.int64)
        turn, travel = as_array(self.turn, (views, 3), "turn"), as_array(self.travel, (views, 3), "travel")
        for name, values in (("time", time), ("turn", turn), ("travel", travel)):
            if not np.isfinite(values).all():
                raise ValueError(f"{name} has values that are not finite")
        if (source < -1).any() or (source > np.arange(len(time))[:, None]).any():
            raise ValueError("source must be -1 or a frame no later than its own")
        if sorted(taker) != list(range(views)):
            raise ValueError(f"taker must name each of {views} cameras once, got {taker.tolist()}")
        if not 0.0 <= self.readout < np.inf:
            raise ValueError(f"readout must be finite and not negative, got {self.readout}")
        for name, array in (("time", time), ("source", source), ("taker", taker), ("turn", turn), ("travel", travel)):
            object.__setattr__(self, name, array)

    @classmethod
    def ideal(cls, rig: Rig, time: ArrayLike) -> Shots:
        """The pictures of a rig without faults: every camera as believed, all at ``time`` (T,), seconds."""
        time = as_array(time, ("T",), "time")
        shape = (len(time), len(rig))
        return cls(
            believed=rig,
            true=rig,
            time=np.broadcast_to(time[:, None], shape),
            source=np.broadcast_to(np.arange(len(time))[:, None], shape),
            taker=np.arange(len(rig)),
            turn=np.zeros((len(rig), 3)),
            travel=np.zeros((len(rig), 3)),
        )

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.time)

    @cached_property
    def delivered(self) -> NDArray[np.bool_]:
        """In which frames a picture arrives from which view, (T, V)."""
        return self.source >= 0

    @cached_property
    def taking(self) -> Rig:
        """Whose pictures the views deliver: the true cameras as they hang at time 0, V in the order of the views."""
        return Rig([self.true[int(taker)] for taker in self.taker])

    def camera(self, frame: int, view: int) -> Camera:
        """The true camera, as it hung when it took the picture that ``view`` delivers in ``frame``."""
        taker = self.taker[view]
        return moved(
            self.true[taker],
            float(self.time[frame, view]) * self.turn[taker],
            float(self.time[frame, view]) * self.travel[taker],
        )


def moved(camera: Camera, turn: ArrayLike, shift: ArrayLike) -> Camera:
    """The same camera elsewhere.

    Args:
        camera: the camera.
        turn: rotation vector about its own axes and centre, (3,), radians.
        shift: of its centre, (3,), metres in the world.
    """
    turn, shift = np.asarray(turn, float), np.asarray(shift, float)
    if not turn.any() and not shift.any():
        return camera
    R = Rotation.from_rotvec(turn).as_matrix().T @ camera.R  # the axes turn one way, what they see the other
    return replace(camera, R=R, t=-R @ (camera.center + shift))
