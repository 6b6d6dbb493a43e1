"""Calibrated cameras and rigs of them: projection, viewing rays, epipolar geometry.

Conventions: metres; OpenCV camera axes (x right, y down, z forward); ``x_cam = R @ x_world + t``;
integer pixel coordinates are pixel centres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array

Floats = NDArray[np.float64]

_ORTHONORMAL_TOLERANCE = 1e-3  # published calibrations carry about six digits
_UNDISTORT_ITERATIONS = 50
_UNDISTORT_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with Brown distortion.

    Attributes:
        K: intrinsics, (3, 3), pixels.
        R: rotation world to camera, (3, 3).
        t: translation world to camera, (3,), metres.
        distortion: k1, k2, p1, p2, k3 as OpenCV orders them, (5,); zeros for a pinhole.
        size: width and height of the image in pixels.
        name: how reports and messages call this camera.

    Raises:
        ValueError: a wrong shape, a value that is not finite, a rotation that is not one, a focal length
            or image size that is not positive.
    """

    K: Floats
    R: Floats
    t: Floats
    distortion: Floats = field(default_factory=lambda: np.zeros(5))
    size: tuple[int, int] = (0, 0)
    name: str = ""

    def __post_init__(self) -> None:
        for key, shape in (("K", (3, 3)), ("R", (3, 3)), ("t", (3,)), ("distortion", (5,))):
            array = as_array(getattr(self, key), shape, f"camera {self.name!r}: {key}")
            if not np.isfinite(array).all():
                raise ValueError(f"camera {self.name!r}: {key} has values that are not finite: {array.tolist()}")
            object.__setattr__(self, key, array)
        off = np.abs(self.R @ self.R.T - np.eye(3)).max()
        if off > _ORTHONORMAL_TOLERANCE or np.linalg.det(self.R) < 0:
            raise ValueError(
                f"camera {self.name!r}: R is not a rotation (R Rᵀ is off the identity by {off:.2g}, "
                f"determinant {np.linalg.det(self.R):.3f}); expected rows of unit length at right angles"
            )
        if self.K[0, 0] <= 0 or self.K[1, 1] <= 0:
            raise ValueError(
                f"camera {self.name!r}: focal lengths must be positive, got {self.K[0, 0]}, {self.K[1, 1]}"
            )
        width, height = self.size
        if width <= 0 or height <= 0:
            raise ValueError(f"camera {self.name!r}: size must be (width, height) in pixels, got {self.size}")
        object.__setattr__(self, "size", (int(width), int(height)))

    @cached_property
    def P(self) -> Floats:
        """Projection matrix ``K [R | t]``, (3, 4), without distortion."""
        return self.K @ np.column_stack([self.R, self.t])

    @cached_property
    def center(self) -> Floats:
        """The optical centre in the world, (3,), metres."""
        return -self.R.T @ self.t

    def depth(self, points: ArrayLike) -> Floats:
        """Distance along the optical axis of world points (..., 3), metres; negative behind the camera."""
        return np.asarray(points, float) @ self.R[2] + self.t[2]

    def project(self, points: ArrayLike) -> Floats:
        """Project world points (..., 3) to pixels (..., 2), distortion included; NaN where not in front."""
        local = np.asarray(points, float) @ self.R.T + self.t
        z = np.where(local[..., 2] > 0, local[..., 2], np.nan)
        return self._to_pixels(_distort(local[..., :2] / z[..., None], self.distortion))

    def undistort(self, pixels: ArrayLike) -> Floats:
        """Pixels (..., 2) of the real lens to the pixels (..., 2) of a lens without distortion."""
        return self._to_pixels(self._normalized(pixels))

    def rays(self, pixels: ArrayLike) -> Floats:
        """Unit viewing directions in the world (..., 3) of pixels (..., 2); NaN stays NaN."""
        xy = self._normalized(pixels)
        local = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
        world = local @ self.R
        return world / np.linalg.norm(world, axis=-1, keepdims=True)

    def inside(self, pixels: ArrayLike) -> NDArray[np.bool_]:
        """Which pixels (..., 2) fall on the image: within half a pixel of a pixel's centre."""
        pixels = np.asarray(pixels, float)
        with np.errstate(invalid="ignore"):
            low, high = pixels >= -0.5, pixels < np.array(self.size) - 0.5
        return np.all(low & high, axis=-1)

    def _to_pixels(self, xy: Floats) -> Floats:
        x, y = xy[..., 0], xy[..., 1]
        return np.stack([self.K[0, 0] * x + self.K[0, 1] * y + self.K[0, 2], self.K[1, 1] * y + self.K[1, 2]], axis=-1)

    def _normalized(self, pixels: ArrayLike) -> Floats:
        pixels = np.asarray(pixels, float)
        y = (pixels[..., 1] - self.K[1, 2]) / self.K[1, 1]
        x = (pixels[..., 0] - self.K[0, 2] - self.K[0, 1] * y) / self.K[0, 0]
        return _undistort(np.stack([x, y], axis=-1), self.distortion)


def _distort(xy: Floats, distortion: Floats) -> Floats:
    """Brown's model on normalised coordinates, as OpenCV writes it."""
    if not distortion.any():
        return xy
    k1, k2, p1, p2, k3 = distortion
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def _undistort(distorted: Floats, distortion: Floats) -> Floats:
    """Invert :func:`_distort` by fixed-point iteration on the residual."""
    if not distortion.any():
        return distorted
    xy = distorted.copy()
    for _ in range(_UNDISTORT_ITERATIONS):
        step = distorted - _distort(xy, distortion)
        xy = xy + step
        if np.nanmax(np.abs(step), initial=0.0) < _UNDISTORT_TOLERANCE:
            break
    return xy


@dataclass(frozen=True)
class Rig:
    """Two or more cameras in one world, in a fixed order: the view index of every array.

    Raises:
        ValueError: fewer than two cameras, cameras that stand in one point, or a rig so large (over 200 m)
            that its calibration can only be in millimetres or centimetres.
    """

    cameras: tuple[Camera, ...]

    _LARGEST = 200.0  # metres; a people-watching rig is smaller, one in centimetres or millimetres is not

    def __init__(self, cameras: Sequence[Camera]) -> None:
        object.__setattr__(self, "cameras", tuple(cameras))
        if len(self.cameras) < 2:
            raise ValueError(f"a rig needs at least 2 cameras to triangulate, got {len(self.cameras)}")
        extent = np.ptp(self.centers, axis=0).max()
        if extent > self._LARGEST:
            raise ValueError(
                f"the cameras stand up to {extent:.0f} apart, which cannot be metres: the calibration is probably "
                "in millimetres or centimetres; divide its translations by 1000 or 100"
            )
        if extent < 1e-6:
            raise ValueError("all cameras of the rig stand in one point: nothing can be triangulated")

    def __len__(self) -> int:
        return len(self.cameras)

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras)

    def __getitem__(self, view: int) -> Camera:
        return self.cameras[view]

    @cached_property
    def P(self) -> Floats:
        """Projection matrices, (V, 3, 4)."""
        return np.stack([camera.P for camera in self.cameras])

    @cached_property
    def centers(self) -> Floats:
        """Optical centres in the world, (V, 3), metres."""
        return np.stack([camera.center for camera in self.cameras])

    @cached_property
    def F(self) -> Floats:
        """Fundamental matrices, (V, V, 3, 3): ``x_jᵀ F[i, j] x_i = 0``, so ``F[i, j] x_i`` is a line in view j.

        Of undistorted pixels; scaled to unit Frobenius norm; zero where i = j or the centres coincide.
        """
        count = len(self)
        result = np.zeros((count, count, 3, 3))
        for i in range(count):
            for j in range(count):
                epipole = self.P[j] @ np.append(self.centers[i], 1.0)
                if i == j or np.linalg.norm(self.centers[i] - self.centers[j]) < 1e-9:
                    continue
                cross = np.cross(epipole, np.eye(3)).T  # [e]x, so that cross @ v = e x v
                to_j = self[j].K @ self[j].R @ self[i].R.T @ np.linalg.inv(self[i].K)
                matrix = cross @ to_j
                result[i, j] = matrix / np.linalg.norm(matrix)
        return result

    def project(self, points: ArrayLike) -> Floats:
        """Project world points (..., 3) into every view: (V, ..., 2), NaN where not in front."""
        return np.stack([camera.project(points) for camera in self.cameras])
