"""Calibrated cameras and rigs of them: projection, viewing rays, epipolar geometry.

Conventions: metres; OpenCV camera axes (x right, y down, z forward); ``x_cam = R @ x_world + t``;
integer pixel coordinates are pixel centres.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from mvpose.checks import Sealed, as_array, as_points
from mvpose.lens import distort, undistort

_ORTHONORMAL_TOLERANCE = 1e-3  # published calibrations carry about six digits
_SINGLE_DIGITS = 1e-6  # what is left of zeros and ones that went through single precision
_SAME_POINT = 1e-6  # metres; no calibration tells centres so near from one
_FARTHEST = 1e6  # focal lengths from the principal point: across the line of sight, not on the image plane


@dataclass(frozen=True)
class Camera(Sealed):
    """A pinhole camera with Brown distortion.

    Attributes:
        K: intrinsics, (3, 3), pixels: ``[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]``.
        R: rotation world to camera, (3, 3).
        t: translation world to camera, (3,), metres.
        distortion: k1, k2, p1, p2, k3 as OpenCV orders them, (5,); zeros for a pinhole.
        size: width and height of the image in pixels.
        name: how reports and messages call this camera.

    Raises:
        ValueError: a wrong shape, a value that is not finite, a K that is not that of a camera, a rotation that is
            not one, an image size that is not two positive whole numbers.
    """

    K: Floats
    R: Floats
    t: Floats
    distortion: Floats = field(default_factory=lambda: np.zeros(5))
    size: tuple[int, int] = (0, 0)
    name: str = ""

    def __post_init__(self) -> None:
        camera = f"camera {self.name!r}"
        for key, shape in (("K", (3, 3)), ("R", (3, 3)), ("t", (3,)), ("distortion", (5,))):
            terms = " (k1 k2 p1 p2 k3, 0 where a model has none)" if key == "distortion" else ""
            array = as_array(getattr(self, key), shape, f"{camera}: {key}{terms}")
            if not np.isfinite(array).all():
                raise ValueError(f"{camera}: {key} has values that are not finite: {array.tolist()}")
            object.__setattr__(self, key, array)
        _check_intrinsics(self.K, camera)
        _check_rotation(self.R, camera)
        size = as_array(self.size, (2,), f"{camera}: size (width, height)", np.int64)
        if (size <= 0).any():
            raise ValueError(
                f"{camera}: size must be the image's width and height, two positive numbers of pixels, got {self.size}"
            )
        object.__setattr__(self, "size", (int(size[0]), int(size[1])))

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
        with np.errstate(all="ignore"):
            return as_points(points, 3, "points") @ self.R[2] + self.t[2]

    def project(self, points: ArrayLike) -> Floats:
        """Project world points (..., 3) to pixels (..., 2), distortion included; NaN where not in front."""
        points = as_points(points, 3, "points")
        with np.errstate(all="ignore"):  # what is not finite, or overflows, has no pixel
            local = points @ self.R.T + self.t
            z = local[..., 2:]
            xy = np.where((z > 0) & (z < np.inf), local[..., :2] / z, np.nan)
            return self._to_pixels(_through_lens(xy, self.distortion, inverse=False))

    def undistort(self, pixels: ArrayLike) -> Floats:
        """Pixels (..., 2) of the real lens to the pixels (..., 2) of a lens without distortion.

        NaN where the lens images no direction: beyond the radius where its polynomial folds over, or farther from
        the principal point than ten focal lengths (a million, where there is no distortion).
        """
        return self._to_pixels(self._normalized(pixels))

    def rays(self, pixels: ArrayLike) -> Floats:
        """Unit viewing directions in the world (..., 3) of pixels (..., 2); NaN where :meth:`undistort` has it."""
        xy = self._normalized(pixels)
        local = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
        world = local @ self.R
        return world / np.linalg.norm(world, axis=-1, keepdims=True)

    def inside(self, pixels: ArrayLike) -> NDArray[np.bool_]:
        """Which pixels (..., 2) fall on the image: within half a pixel of a pixel's centre."""
        pixels = as_points(pixels, 2, "pixels")
        with np.errstate(invalid="ignore"):
            low, high = pixels >= -0.5, pixels < np.array(self.size) - 0.5
        return np.all(low & high, axis=-1)

    def _to_pixels(self, xy: Floats) -> Floats:
        x, y = xy[..., 0], xy[..., 1]
        return np.stack([self.K[0, 0] * x + self.K[0, 1] * y + self.K[0, 2], self.K[1, 1] * y + self.K[1, 2]], axis=-1)

    def _normalized(self, pixels: ArrayLike) -> Floats:
        pixels = as_points(pixels, 2, "pixels")
        with np.errstate(all="ignore"):  # infinite pixels are none
            y = (pixels[..., 1] - self.K[1, 2]) / self.K[1, 1]
            x = (pixels[..., 0] - self.K[0, 2] - self.K[0, 1] * y) / self.K[0, 0]
            xy = _through_lens(np.stack([x, y], axis=-1), self.distortion, inverse=True)
            return np.where(np.abs(xy).sum(axis=-1, keepdims=True) < _FARTHEST, xy, np.nan)


def _check_intrinsics(K: Floats, camera: str) -> None:
    form = "expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]"
    got = f"got {K.tolist()}"
    if np.abs(K[2] - [0, 0, 1]).max() > _SINGLE_DIGITS:
        if np.abs(K[:, 2] - [0, 0, 1]).max() <= _SINGLE_DIGITS:
            raise ValueError(f"{camera}: K is transposed, {got}; {form}: pass K.T")
        if np.abs(K[2, :2]).max() == 0 and K[2, 2] != 0:
            raise ValueError(f"{camera}: K[2, 2] must be 1, {got}; {form}: divide K by {K[2, 2]:g}")
        raise ValueError(f"{camera}: the last row of K must be 0 0 1, {got}; {form}")
    if abs(K[1, 0]) > _SINGLE_DIGITS:
        raise ValueError(f"{camera}: K[1, 0] must be 0, {got}; {form}: a skew belongs in K[0, 1]")
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise ValueError(
            f"{camera}: focal lengths must be positive, got {K[0, 0]:g} and {K[1, 1]:g}; "
            "a flipped image axis belongs in R (x right, y down, z forward), not in K"
        )


def _check_rotation(R: Floats, camera: str) -> None:
    # Entries beyond 2 are none of a rotation, and their squares might overflow.
    off = np.abs(R @ R.T - np.eye(3)).max() if np.abs(R).max() < 2 else np.inf
    if off > _ORTHONORMAL_TOLERANCE:
        raise ValueError(
            f"{camera}: R is not a rotation (R Rᵀ is off the identity by {off:.2g}), got {R.tolist()}; expected three "
            "rows of unit length at right angles (a Rodrigues vector goes through cv2.Rodrigues first)"
        )
    if np.linalg.det(R) < 0:
        raise ValueError(
            f"{camera}: R is not a rotation but a reflection (its determinant is -1), got {R.tolist()}; the axes of "
            "the world or of the camera (x right, y down, z forward) are left-handed: flip one"
        )


def _through_lens(xy: Floats, distortion: Floats, *, inverse: bool) -> Floats:
    """Bend normalised coordinates (..., 2) as the lens does, or back; NaN where that cannot be."""
    if not distortion.any():
        return xy
    return _bend(np.ascontiguousarray(xy).reshape(-1, 2), distortion, inverse).reshape(xy.shape)


@njit(cache=True)
def _bend(points, terms, inverse):
    result = np.empty_like(points)
    for k in range(len(points)):
        if inverse:
            result[k, 0], result[k, 1] = undistort(points[k, 0], points[k, 1], terms)
        else:
            result[k, 0], result[k, 1] = distort(points[k, 0], points[k, 1], terms)
    return result


@dataclass(frozen=True)
class Rig(Sealed):
    """Two or more cameras in one world, in a fixed order: the view index of every array.

    Some cameras may stand in one point (a pair without a baseline says nothing of depth), but not all.

    Raises:
        ValueError: fewer than two cameras, something that is no camera, cameras that all stand in one point, or a rig
            so large (over 200 m) that its calibration can only be in millimetres or centimetres.
    """

    cameras: tuple[Camera, ...]

    _LARGEST = 200.0  # metres; a people-watching rig is smaller, one in centimetres or millimetres is not

    def __init__(self, cameras: Sequence[Camera]) -> None:
        if not isinstance(cameras, Iterable):
            raise ValueError(f"a rig is made of a sequence of cameras, got {type(cameras).__name__}")
        object.__setattr__(self, "cameras", tuple(cameras))
        for index, camera in enumerate(self.cameras):
            if not isinstance(camera, Camera):
                raise ValueError(
                    f"a rig is made of cameras, but entry {index} is {type(camera).__name__}; pass mvpose.Camera"
                )
        if len(self.cameras) < 2:
            raise ValueError(f"a rig needs at least 2 cameras to triangulate, got {len(self.cameras)}")
        with np.errstate(over="ignore", invalid="ignore"):
            extent = np.ptp(self.centers, axis=0).max()
        if not extent <= self._LARGEST:
            raise ValueError(
                f"the cameras stand up to {extent:.0f} apart, which cannot be metres: the calibration is probably "
                "in millimetres or centimetres; divide its translations by 1000 or 100"
            )
        if extent < _SAME_POINT:
            raise ValueError(
                f"all {len(self)} cameras of the rig stand in one point, {self.centers[0].tolist()}: nothing can be "
                "triangulated; expected centres (-Rᵀ t, metres) that differ: check that each camera has its own t"
            )

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
    def packed(self) -> Floats:
        """The cameras for the kernels, (V, 22): fx, skew, cx, fy, cy, R by rows (9), centre (3), distortion (5)."""
        return np.array(
            [
                [c.K[0, 0], c.K[0, 1], c.K[0, 2], c.K[1, 1], c.K[1, 2], *c.R.ravel(), *c.center, *c.distortion]
                for c in self.cameras
            ]
        )

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
                if i == j or np.linalg.norm(self.centers[i] - self.centers[j]) < _SAME_POINT:
                    continue
                cross = np.cross(epipole, np.eye(3)).T  # [e]x, so that cross @ v = e x v
                to_j = self[j].K @ self[j].R @ self[i].R.T @ np.linalg.inv(self[i].K)
                matrix = cross @ to_j
                result[i, j] = matrix / np.linalg.norm(matrix)
        return result

    def project(self, points: ArrayLike) -> Floats:
        """Project world points (..., 3) into every view: (V, ..., 2), NaN where not in front."""
        return np.stack([camera.project(points) for camera in self.cameras])
