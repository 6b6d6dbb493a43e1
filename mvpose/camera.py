"""Calibrated cameras and rigs of them: projection, viewing rays, epipolar geometry.

Conventions: metres; OpenCV camera axes (x right, y down, z forward); ``x_cam = R @ x_world + t``;
integer pixel coordinates are pixel centres.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.checks import Sealed, as_array, as_points
from mvpose.kernels import njit
from mvpose.lens import distort, undistort

_ORTHONORMAL_TOLERANCE = 1e-3  # published calibrations carry about six digits
_SINGLE_DIGITS = 1e-6  # rounding error of zeros and ones stored in single precision
_SAME_POINT = 1e-6  # metres; below the accuracy of any calibration
_GREATEST = 1e9  # pixels, metres; larger than any calibration, and products of such values are far from overflow
_LEAST_FOCAL = 1e-6  # pixels; calibrations in units of the focal length have 1
_FARTHEST = 1e6  # focal lengths from the principal point; beyond it the ray is parallel to the image plane


@dataclass(frozen=True)
class Camera(Sealed):
    """Pinhole camera with Brown distortion.

    Raises:
        ValueError: a wrong shape, a value that is not finite or exceeds 1e9, an invalid intrinsic matrix K, an R that
            is not a rotation, or an image size that is not two positive whole numbers.
    """

    K: Floats
    """Intrinsics, (3, 3), pixels: ``[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]``."""
    R: Floats
    """Rotation from world to camera, (3, 3)."""
    t: Floats
    """Translation from world to camera, (3,), metres."""
    distortion: Floats = field(default_factory=lambda: np.zeros(5))
    """K1, k2, p1, p2, k3 in the order of OpenCV, (5,); zeros for a pinhole."""
    size: tuple[int, int] = (0, 0)
    """Width and height of the image in pixels."""
    name: str = ""
    """Name of the camera in reports and messages."""
    readout: float = 0.0
    """Seconds from the exposure of the first row to that of the last, 0 for a global shutter; the time of a picture is
    that of its middle row."""

    def __post_init__(self) -> None:
        camera = f"camera {self.name!r}"
        for key, shape in (("K", (3, 3)), ("R", (3, 3)), ("t", (3,)), ("distortion", (5,))):
            terms = " (k1 k2 p1 p2 k3, 0 for a term that the model lacks)" if key == "distortion" else ""
            array = as_array(getattr(self, key), shape, f"{camera}: {key}{terms}")
            if not np.isfinite(array).all():
                raise ValueError(f"{camera}: {key} has values that are not finite: {array.tolist()}")
            if key != "R" and np.abs(array).max() > _GREATEST:
                raise ValueError(
                    f"{camera}: {key} must have values of at most {_GREATEST:g}, got {np.abs(array).max():g}"
                )
            object.__setattr__(self, key, array)
        _check_intrinsics(self.K, camera)
        _check_rotation(self.R, camera)
        size = as_array(self.size, (2,), f"{camera}: size (width, height)", np.int64)
        if (size <= 0).any():
            raise ValueError(
                f"{camera}: size must be the image's width and height, two positive numbers of pixels, got {self.size}"
            )
        object.__setattr__(self, "size", (int(size[0]), int(size[1])))
        if not 0.0 <= self.readout < np.inf:
            raise ValueError(f"{camera}: readout must be 0 s or more and finite, got {self.readout}")

    @cached_property
    def P(self) -> Floats:
        """Projection matrix ``K [R | t]``, (3, 4), without distortion."""
        return self.K @ np.column_stack([self.R, self.t])

    @cached_property
    def center(self) -> Floats:
        """Optical centre in the world, (3,), metres."""
        return -self.R.T @ self.t

    def depth(self, points: ArrayLike) -> Floats:
        """Return the distance of world points (..., 3) along the optical axis, metres; negative behind the camera."""
        with np.errstate(all="ignore"):
            return as_points(points, 3, "points") @ self.R[2] + self.t[2]

    def project(self, points: ArrayLike) -> Floats:
        """Project world points (..., 3) to pixels (..., 2) with distortion; NaN for points behind the camera."""
        points = as_points(points, 3, "points")
        with np.errstate(all="ignore"):  # points that are not finite, or overflow, become NaN
            local = points @ self.R.T + self.t
            z = local[..., 2:]
            xy = np.where((z > 0) & (z < np.inf), local[..., :2] / z, np.nan)
            return self._to_pixels(_through_lens(xy, self.distortion, inverse=False))

    def undistort(self, pixels: ArrayLike) -> Floats:
        """Map pixels (..., 2) of the real lens to the pixels (..., 2) of a lens without distortion.

        The result is NaN where the lens images no direction: beyond the radius where its polynomial folds over, or
        more than ten focal lengths from the principal point (a million without distortion).
        """
        return self._to_pixels(self._normalized(pixels))

    def rays(self, pixels: ArrayLike) -> Floats:
        """Return unit viewing directions in the world (..., 3) of pixels (..., 2); NaN as in :meth:`undistort`."""
        xy = self._normalized(pixels)
        local = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
        world = local @ self.R
        return world / np.linalg.norm(world, axis=-1, keepdims=True)

    def inside(self, pixels: ArrayLike) -> Bools:
        """Return whether pixels (..., 2) lie in the image, that is, within half a pixel of the centre of a pixel."""
        pixels = as_points(pixels, 2, "pixels")
        with np.errstate(invalid="ignore"):
            low, high = pixels >= -0.5, pixels < np.array(self.size) - 0.5
        return np.all(low & high, axis=-1)

    def _to_pixels(self, xy: Floats) -> Floats:
        x, y = xy[..., 0], xy[..., 1]
        return np.stack([self.K[0, 0] * x + self.K[0, 1] * y + self.K[0, 2], self.K[1, 1] * y + self.K[1, 2]], axis=-1)

    def _normalized(self, pixels: ArrayLike) -> Floats:
        pixels = as_points(pixels, 2, "pixels")
        with np.errstate(all="ignore"):  # infinite pixels become NaN
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
            "put a flipped image axis into R (x right, y down, z forward), not into K"
        )
    if min(K[0, 0], K[1, 1]) < _LEAST_FOCAL:
        raise ValueError(f"{camera}: focal lengths must be at least {_LEAST_FOCAL:g} pixels, {got}; {form}")


def _check_rotation(R: Floats, camera: str) -> None:
    # No rotation has entries beyond 2, and their squares might overflow.
    off = np.abs(R @ R.T - np.eye(3)).max() if np.abs(R).max() < 2 else np.inf
    if off > _ORTHONORMAL_TOLERANCE:
        raise ValueError(
            f"{camera}: R is not a rotation (R Rᵀ differs from the identity by {off:.2g}), got {R.tolist()}; expected "
            "three orthogonal rows of unit length (convert a Rodrigues vector by cv2.Rodrigues first)"
        )
    if np.linalg.det(R) < 0:
        raise ValueError(
            f"{camera}: R is not a rotation but a reflection (its determinant is -1), got {R.tolist()}; the axes of "
            "the world or of the camera (x right, y down, z forward) are left-handed: flip one"
        )


def _through_lens(xy: Floats, distortion: Floats, *, inverse: bool) -> Floats:
    """Apply lens distortion, or its inverse, to normalised coordinates (..., 2); NaN where there is no solution."""
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


class UnlikelyRigError(ValueError):
    """Cameras that are each valid, and stand where the cameras of no rig do.

    Attributes:
        cameras: the cameras.
    """

    def __init__(self, message: str, cameras: Sequence[Camera]) -> None:
        super().__init__(message)
        self.cameras = tuple(cameras)


@dataclass(frozen=True)
class Rig(Sealed):
    """Two or more calibrated cameras in one world, in a fixed order that is the view index of every array.

    Some cameras may stand in one point (a pair without a baseline has no depth information), but not all.

    Raises:
        ValueError: fewer than two cameras, an entry that is not a camera, cameras that all stand in one point, or a
            rig so large (over 200 m) that its calibration must be in millimetres or centimetres.
    """

    cameras: tuple[Camera, ...]

    _LARGEST = 200.0  # metres; real rigs are smaller, unless their calibration is in centimetres or millimetres
    _SMALLEST = 0.02  # metres; two cameras of one housing are farther apart

    def __init__(self, cameras: Sequence[Camera]) -> None:
        if not isinstance(cameras, Iterable):
            raise ValueError(f"a rig must be a sequence of cameras, got {type(cameras).__name__}: pass Rig([...])")
        object.__setattr__(self, "cameras", tuple(cameras))
        for index, camera in enumerate(self.cameras):
            if not isinstance(camera, Camera):
                raise ValueError(
                    f"a rig must be a sequence of cameras, but entry {index} is {type(camera).__name__}; "
                    "pass mvpose.Camera"
                )
        if len(self.cameras) < 2:
            raise ValueError(f"a rig needs at least 2 cameras to triangulate, got {len(self.cameras)}")
        self._check_places()

    @classmethod
    def unchecked(cls, cameras: Sequence[Camera]) -> "Rig":
        """Return a rig of cameras that may stand anywhere, for the search of what is wrong with their calibration."""
        rig = cls.__new__(cls)
        object.__setattr__(rig, "cameras", tuple(cameras))
        return rig

    def _check_places(self) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            extent = np.ptp(self.centers, axis=0).max()
            away = np.linalg.norm(self.centers - np.median(self.centers, axis=0), axis=1)
        if not extent <= self._LARGEST:
            far = [
                camera.name or f"camera {view}" for view, camera in enumerate(self) if not away[view] <= self._LARGEST
            ]
            few = 0 < len(far) <= len(self) // 2
            raise UnlikelyRigError(
                f"the cameras stand up to {extent:.0f} apart, which cannot be metres (expected at most "
                f"{self._LARGEST:g}): "
                + (
                    f"the translation of {', '.join(far)} alone is probably in millimetres or centimetres; those of "
                    "the other cameras are right; "
                    if few
                    else "the calibration is probably in millimetres (--unit mm) or centimetres (--unit cm); "
                )
                + "`mvpose doctor` says what it is, and what mends it",
                self.cameras,
            )
        if extent < _SAME_POINT:
            raise UnlikelyRigError(
                f"all {len(self)} cameras of the rig stand in one point, {self.centers[0].tolist()}: nothing can be "
                "triangulated; expected centres (-Rᵀ t, metres) that differ: check the t of each camera",
                self.cameras,
            )
        if extent < self._SMALLEST:
            raise UnlikelyRigError(
                f"all {len(self)} cameras of the rig stand within {1000 * extent:.3g} mm, which cannot be metres "
                f"(expected at least {1000 * self._SMALLEST:g} mm): the calibration is probably in kilometres, or was "
                "divided twice to get metres; `mvpose doctor` says what it is, and what mends it",
                self.cameras,
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
        """Cameras as rows for the kernels, (V, 22): fx, skew, cx, fy, cy, R by rows (9), centre (3), distortion (5)."""
        return np.array(
            [
                [c.K[0, 0], c.K[0, 1], c.K[0, 2], c.K[1, 1], c.K[1, 2], *c.R.ravel(), *c.center, *c.distortion]
                for c in self.cameras
            ]
        )

    @cached_property
    def F(self) -> Floats:
        """Fundamental matrices, (V, V, 3, 3): ``x_jᵀ F[i, j] x_i = 0``, so ``F[i, j] x_i`` is a line in view j.

        They hold for undistorted pixels, have unit Frobenius norm, and are zero where i = j or the centres coincide.
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
        """Project world points (..., 3) into every view, (V, ..., 2); NaN for points not in front of the camera."""
        return np.stack([camera.project(points) for camera in self.cameras])
