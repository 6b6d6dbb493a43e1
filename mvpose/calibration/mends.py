"""Mends of a calibration by name: what the doctor prints and ``mvpose repair --mend`` applies.

A mend is ``NAME``, with ``:VALUES`` and ``@CAMERAS`` where there are any: ``inverted``, ``unit:0.001@cam2``.
It changes the calibration in the way in which the doctor read it when the cameras agreed (:mod:`.file_mistakes`), so
that what is written is what was examined. Pictures that are other than those of the calibration (another resolution,
cropped, turned) change the intrinsics of the cameras, as the pictures stay.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.calibration.file_mistakes import CHANGES
from mvpose.calibration.findings import camera_names
from mvpose.calibration.reading_changes import (
    Change,
    extrinsics,
    mapped_pixels,
    other_lens,
    rescaled,
    scaled_picture,
    turned_camera,
)
from mvpose.camera import Camera, Rig

AXES = ("x", "y", "z", "-x", "-y", "-z")
_OF_ALL = ("mirrored", "up")  # changes of the whole world
_PATTERN = re.compile(r"(?P<name>[a-z0-9-]+)(:(?P<values>[^@]+))?(@(?P<cameras>.+))?")


@dataclass(frozen=True)
class Mend:
    """A named change of a calibration."""

    name: str
    """One of :data:`MENDS`."""
    values: str = ""
    """Its values as text: numbers with commas, a size, an axis; empty for none."""
    cameras: tuple[str, ...] = ()
    """Names of the cameras that it changes; empty for all."""

    @classmethod
    def parsed(cls, text: str) -> Self:
        """Return the mend of a text.

        Raises:
            ValueError: no known name, or values that it does not take.
        """
        parts = _PATTERN.fullmatch(text.strip())
        if parts is None or parts["name"] not in MENDS:
            raise ValueError(
                f"--mend {text}: expected NAME[:VALUES][@CAMERA,...], as `mvpose doctor` prints it; names are "
                + ", ".join(f"{name}:{each.takes}" if each.takes else name for name, each in MENDS.items())
            )
        cameras = tuple(name.strip() for name in (parts["cameras"] or "").split(",") if name.strip())
        mend = cls(parts["name"], parts["values"] or "", cameras)
        kind = MENDS[mend.name]
        try:
            kind.change(mend.values)
        except (ValueError, IndexError):
            raise ValueError(
                f"--mend {text}: expected {mend.name}{':' + kind.takes if kind.takes else ''}, got values "
                f"{mend.values or 'none'!r}"
            ) from None
        if bool(kind.takes) != bool(mend.values):
            raise ValueError(f"--mend {text}: {mend.name} takes {kind.takes or 'no values'}")
        if mend.name in _OF_ALL and mend.cameras:
            raise ValueError(
                f"--mend {text}: {mend.name} changes all cameras together; leave {', '.join(mend.cameras)} out"
            )
        if mend.name == "exchanged" and len(mend.cameras) != 2:
            raise ValueError(f"--mend {text}: expected the two cameras whose calibrations are exchanged: exchanged@A,B")
        return mend

    def __str__(self) -> str:
        """Return the text that :meth:`parsed` reads."""
        return (
            self.name + (f":{self.values}" if self.values else "") + ("@" + ",".join(self.cameras)) * bool(self.cameras)
        )

    def applied(self, cameras: Sequence[Camera]) -> list[Camera]:
        """Return the changed cameras, in their order and with their names.

        Raises:
            ValueError: a camera that is not there, or that cannot be changed so.
        """
        names = list(camera_names(cameras))
        for name in self.cameras:
            if name not in names:
                raise ValueError(f"--mend {self}: there is no camera {name!r}; expected some of {', '.join(names)}")
        if self.name == "exchanged":
            one, other = (cameras[names.index(name)] for name in self.cameras)
            pair = dict(zip(self.cameras, (replace(other, name=one.name), replace(one, name=other.name)), strict=True))
            return [pair.get(name, camera) for name, camera in zip(names, cameras, strict=True)]
        change = MENDS[self.name].change(self.values)
        try:
            return [
                change(camera) if not self.cameras or name in self.cameras else camera
                for name, camera in zip(names, cameras, strict=True)
            ]
        except ValueError as error:
            raise ValueError(f"--mend {self}: {error}") from None


@dataclass(frozen=True)
class MendKind:
    """A kind of mend."""

    takes: str
    """Its values, as a message names them; empty for none."""
    change: Callable[[str], Callable[[Camera], Camera]]
    """From these values to the change of a camera."""


def _numbers(text: str, count: int) -> Floats:
    values = np.array([float(each) for each in text.split(",")])
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(text)
    return values


def _above(text: str) -> float:
    value = float(_numbers(text, 1)[0])
    if value <= 0.0:
        raise ValueError(text)
    return value


def _by(change: Change) -> Callable[[Camera], Camera]:
    """Return a change of packed cameras and pixels as one of cameras."""

    def changed(camera: Camera) -> Camera:
        row, pixels, _ = change(Rig.unchecked([camera]).packed[0], camera.size)
        R = row[5:14].reshape(3, 3)
        posed = replace(camera, R=R, t=-R @ row[14:17], distortion=row[17:22])
        return posed if pixels is None else of_pictures(posed, pixels)

    return changed


def of_pictures(camera: Camera, pixels: Floats) -> Camera:
    """Return the camera of pictures whose pixels map to those of its calibration by an affine map, (2, 3).

    A map that turns the picture turns the camera, one that mirrors it mirrors the world, in x.
    """
    linear = np.linalg.inv(pixels[:, :2]) @ camera.K[:2, :2]
    center = np.linalg.solve(pixels[:, :2], camera.K[:2, 2] - pixels[:, 2])
    mirrored = np.linalg.det(linear) < 0
    across = np.array([linear[1, 1], -linear[1, 0]]) / np.hypot(*linear[1])  # linear = upper triangle @ turn
    turn = np.array([across, linear[1] / np.hypot(*linear[1])])
    flip = np.diag([-1.0, 1.0]) if mirrored else np.eye(2)
    upper = linear @ turn.T @ flip
    spun, world = np.eye(3), np.diag([-1.0, 1.0, 1.0]) if mirrored else np.eye(3)
    spun[:2, :2] = flip @ turn
    K = np.array([[upper[0, 0], upper[0, 1], center[0]], [0.0, upper[1, 1], center[1]], [0.0, 0.0, 1.0]])
    distortion = camera.distortion.copy()
    distortion[[3, 2]] = spun[:2, :2] @ camera.distortion[[3, 2]]
    R = spun @ camera.R @ world
    scale = float(np.sqrt(abs(np.linalg.det(linear) / np.linalg.det(camera.K[:2, :2]))))
    sides = np.rint(np.abs(turn)) @ np.array(camera.size, float)
    # Of a file with the right size and wrong intrinsics, and of one where both are wrong.
    sizes = [sides, scale * sides]
    best = min(sizes, key=lambda each: float(np.abs(np.log((2 * np.maximum(center, 1.0) + 1.0) / each)).max()))
    width, height = np.maximum(np.rint(best), 1).astype(int).tolist()
    return replace(camera, K=K, R=R, t=-R @ world @ camera.center, distortion=distortion, size=(width, height))


def _scaled_focal(values: str) -> Callable[[Camera], Camera]:
    factor = _above(values)
    return lambda camera: replace(
        camera, K=camera.K * np.array([[factor] * 2 + [1.0], [factor] * 2 + [1.0], [1.0] * 3])
    )


def _shifted_center(values: str) -> Callable[[Camera], Camera]:
    shift = np.zeros((3, 3))
    shift[:2, 2] = _numbers(values, 2)
    return lambda camera: replace(camera, K=camera.K + shift)


def _of_size(values: str) -> Callable[[Camera], Camera]:
    width, height = (int(side) for side in values.lower().split("x"))
    return lambda camera: replace(camera, size=(width, height))


def upright(up: ArrayLike) -> Floats:
    """Return the turn (3, 3) from a world in which a direction (3,) points up to one in which z does.

    An axis of the world is turned onto z exactly: the axes are exchanged in a cycle, or turned by half about x.
    """
    direction = np.asarray(up, float)
    direction = direction / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < 1.0 - 1e-9:
        return Rotation.align_vectors([[0.0, 0.0, 1.0]], [direction])[0].as_matrix()
    turn = np.roll(np.eye(3), axis - 2, axis=0).T
    turn = turn.T if not np.allclose(turn @ np.eye(3)[axis], [0, 0, 1]) else turn
    return turn if direction[axis] > 0 else np.diag([1.0, -1.0, -1.0]) @ turn


def axis_vector(name: str) -> Floats:
    """Return the direction of an axis of the world, (3,): of "z", "-y" and so on."""
    if name not in AXES:
        raise ValueError(name)
    return (-1.0 if name.startswith("-") else 1.0) * np.eye(3)["xyz".index(name[-1])]


def _turned_world(values: str) -> Callable[[Camera], Camera]:
    turn = upright(axis_vector(values) if values in AXES else _numbers(values, 3))
    return lambda camera: replace(camera, R=camera.R @ turn.T)


def _turned_in_place(values: str) -> Change:
    turn = Rotation.from_rotvec(np.radians(_numbers(values, 3))).as_matrix()
    return extrinsics(turned_camera(turn))


def _cropped(values: str) -> Change:
    x, y = _numbers(values, 2).tolist()
    return mapped_pixels(lambda w, h: [[1, 0, x], [0, 1, y]])


def _named(change: Change) -> MendKind:
    return MendKind("", lambda values: _by(change))


MENDS: dict[str, MendKind] = {
    **{each.mend: _named(change) for each, change in CHANGES if each.mend and ":" not in each.mend},
    "exchanged": MendKind("", lambda values: lambda camera: camera),
    "unit": MendKind("FACTOR", lambda values: _by(extrinsics(rescaled(_above(values))))),
    "resolution": MendKind("TIMES", lambda values: _by(scaled_picture(1.0 / _above(values)))),
    "size": MendKind("WIDTHxHEIGHT", _of_size),
    "crop": MendKind("X,Y", lambda values: _by(_cropped(values))),
    "focal": MendKind("FACTOR", _scaled_focal),
    "center": MendKind("X,Y", _shifted_center),
    "k1": MendKind("CHANGE", lambda values: _by(other_lens(lambda terms: terms + _numbers(values, 1) * np.eye(5)[0]))),
    "turn": MendKind("X,Y,Z", lambda values: _by(_turned_in_place(values))),
    "up": MendKind("AXIS", _turned_world),
}
"""Kinds of mends by name: those of :data:`.file_mistakes.CHANGES`, and those with values."""
