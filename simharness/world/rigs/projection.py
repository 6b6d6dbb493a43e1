"""Projection by the simulated cameras and its inverse, written apart from the code of the method.

The method undistorts detections by :mod:`mvpose.lens`. If the same code projected the truth, it would undo its own
faults, and no score would show them. Therefore all that is simulated is projected here, from the fields of the cameras
alone. Tests compare both with OpenCV, whose model of a lens both use: terms k1, k2, p1, p2, k3 (OpenCV, "Camera
Calibration and 3D Reconstruction"; Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32, 1966).

Also the lenses of these cameras: intrinsics from a field of view, and validity of a distortion polynomial.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from mvpose.camera import Camera
from mvpose.kernels import njit

_BISECTIONS = 24  # leave 1e-7 of the radius, from where Newton's method needs two steps
_STEPS = 30  # of Newton's method
_CLOSE = 1e-26  # squared residual, in squared focal lengths
_FOUND = 1e-18  # the same, of a solution: 1e-6 pixels at a focal length of 1000 pixels
_WIDEST = 1e3  # focal lengths from the axis: beyond it a pixel has no direction in front of the camera


def projection_matrix(camera: Camera) -> Floats:
    """Return ``K [R | t]``, (3, 4): the projection without distortion."""
    return camera.K @ np.column_stack([camera.R, camera.t])


def project_to_image(camera: Camera, points: ArrayLike, *, near: float = 0.0) -> Floats:
    """Project world points (..., 3) to pixels (..., 2); NaN where ``camera`` does not image the point.

    A point is not imaged where it is less than ``near`` metres in front of the camera centre, or beyond the angle at
    which the polynomial of the lens folds over: it would get a second, wrong position inside the picture.
    """
    # Row by row rather than by a matrix product: BLAS may round differently from one process to the next.
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    bent = camera.distortion.any()
    matrix = np.column_stack([camera.R, camera.t]) if bent else projection_matrix(camera)
    u, v, depth = (row[0] * x + row[1] * y + row[2] * z + row[3] for row in matrix)
    depth = np.where(depth > near, depth, np.nan)
    plane = np.stack([u / depth, v / depth], axis=-1)
    return _pixels(camera, _through(plane, camera.distortion, inverse=False)) if bent else plane


def undistorted(camera: Camera, pixels: ArrayLike) -> Floats:
    """Map pixels (..., 2) to those of a camera without distortion; NaN where the lens images nothing."""
    return _pixels(camera, _plane(camera, pixels))


def viewing_rays(camera: Camera, pixels: ArrayLike) -> Floats:
    """Return unit directions in the world (..., 3) of pixels (..., 2); NaN where the lens images nothing."""
    x, y = np.moveaxis(_plane(camera, pixels), -1, 0)
    right, down, forward = camera.R
    world = x[..., None] * right + y[..., None] * down + forward
    return np.asarray(world / np.linalg.norm(world, axis=-1, keepdims=True))


def fold_radius2(distortion: Floats) -> float:
    """Return the squared distance from the axis, at unit depth, at which the radial polynomial folds over; or inf."""
    k1, k2, _, _, k3 = distortion
    # The derivative 1 + 3 k1 r^2 + 5 k2 r^4 + 7 k3 r^6 as a polynomial in 1/r^2: it has roots for the smallest terms.
    roots = np.roots([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3])
    inverse = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > _WIDEST**-2)].max(initial=0.0)
    return float(1.0 / inverse) if inverse else np.inf


def _plane(camera: Camera, pixels: ArrayLike) -> Floats:
    """Return the positions x, y (..., 2) of the directions (x, y, 1) of pixels, in camera coordinates."""
    u, v = np.moveaxis(np.asarray(pixels, float), -1, 0)
    (fx, skew, cx), (_, fy, cy), _ = camera.K
    y = (v - cy) / fy
    plane = np.stack([(u - cx - skew * y) / fx, y], axis=-1)
    return _through(plane, camera.distortion, inverse=True) if camera.distortion.any() else plane


def _pixels(camera: Camera, plane: Floats) -> Floats:
    x, y = np.moveaxis(plane, -1, 0)
    (fx, skew, cx), (_, fy, cy), _ = camera.K
    return np.stack([fx * x + skew * y + cx, fy * y + cy], axis=-1)


def _through(plane: Floats, distortion: Floats, *, inverse: bool) -> Floats:
    """Apply a lens, or its inverse, to positions (..., 2)."""
    flat = np.ascontiguousarray(plane).reshape(-1, 2)
    return np.asarray(_bend(flat, np.array(distortion), fold_radius2(distortion), inverse).reshape(plane.shape))


@njit(cache=True)
def _bend(points, lens, fold, inverse):
    result = np.empty_like(points)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        if inverse:
            x, y = straighten(x, y, lens, fold)
        elif is_imaged(x, y, lens, fold):
            x, y = bend(x, y, lens)
        else:
            x, y = np.nan, np.nan
        result[i, 0], result[i, 1] = x, y
    return result


@njit(cache=True)
def bend(x, y, lens):
    """Return where the lens k1, k2, p1, p2, k3 images the direction (x, y, 1), in focal lengths from the axis."""
    k1, k2, p1, p2, k3 = lens[0], lens[1], lens[2], lens[3], lens[4]
    r2 = x**2 + y**2
    stretch = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return (
        stretch * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x**2),
        stretch * y + p1 * (r2 + 2.0 * y**2) + 2.0 * p2 * x * y,
    )


@njit(cache=True)
def _slopes(x, y, lens):
    """Return the derivatives of :func:`bend`: du/dx, du/dy = dv/dx, dv/dy."""
    k1, k2, p1, p2, k3 = lens[0], lens[1], lens[2], lens[3], lens[4]
    r2 = x**2 + y**2
    stretch = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    growth = 2.0 * k1 + 4.0 * k2 * r2 + 6.0 * k3 * r2**2
    return (
        stretch + growth * x**2 + 2.0 * p1 * y + 6.0 * p2 * x,
        growth * x * y + 2.0 * p1 * x + 2.0 * p2 * y,
        stretch + growth * y**2 + 6.0 * p1 * y + 2.0 * p2 * x,
    )


@njit(cache=True)
def is_imaged(x, y, lens, fold):
    """Whether the lens images the direction (x, y, 1): nearer than its fold, where it turns no picture over.

    Args:
        x: first coordinate of the direction.
        y: second coordinate of the direction.
        lens: k1, k2, p1, p2, k3.
        fold: squared radius from :func:`fold_radius2`, which leaves out p1 and p2.
    """
    if not x**2 + y**2 < fold:
        return False
    xx, xy, yy = _slopes(x, y, lens)
    return xx + yy > 0.0 and xx * yy > xy**2


@njit(cache=True)
def straighten(u, v, lens, fold):
    """Return the direction that :func:`bend` images at (u, v); NaN if there is none before the fold.

    Newton's method starts at the pinhole's direction. Where that leads astray it starts anew, where the radial terms
    alone image (u, v): they grow up to the fold, so that bisection inverts them.
    """
    radius = np.sqrt(u**2 + v**2)
    if not radius < _WIDEST:
        return np.nan, np.nan
    x, y = _descend(u, v, u, v, lens, fold)
    if np.isfinite(x):
        return x, y
    low, high = 0.0, min(np.sqrt(fold), _WIDEST)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        r2 = middle**2
        if middle * (1.0 + lens[0] * r2 + lens[1] * r2**2 + lens[4] * r2**3) < radius:
            low = middle
        else:
            high = middle
    share = low / radius if radius > 0.0 else 0.0
    return _descend(u, v, share * u, share * v, lens, fold)


@njit(cache=True)
def _descend(u, v, x, y, lens, fold):
    """Run Newton's method from (x, y), with steps halved until the residual falls; NaN if it ends elsewhere."""
    a, b = bend(x, y, lens)
    residual = (u - a) ** 2 + (v - b) ** 2
    for _ in range(_STEPS):
        if residual < _CLOSE:
            break
        xx, xy, yy = _slopes(x, y, lens)
        determinant = xx * yy - xy**2
        dx, dy = (yy * (u - a) - xy * (v - b)) / determinant, (xx * (v - b) - xy * (u - a)) / determinant
        share = 1.0
        while share > 1e-3:
            a, b = bend(x + share * dx, y + share * dy, lens)
            if (u - a) ** 2 + (v - b) ** 2 < residual:
                break
            share /= 2.0
        else:
            break
        x, y, residual = x + share * dx, y + share * dy, (u - a) ** 2 + (v - b) ** 2
    if residual < _FOUND and is_imaged(x, y, lens, fold):
        return x, y
    return np.nan, np.nan


_SAMPLES = 33  # samples of a picture in each direction, edges included


def intrinsics(fov: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the intrinsics (3, 3) of a lens with square pixels and its axis in the middle of the image.

    Args:
        fov: horizontal field of view before distortion, degrees, from the outer edge of the first pixel to the outer
            edge of the last.
        size: width and height in pixels.
    """
    width, height = size
    focal = width / (2 * math.tan(math.radians(fov) / 2))
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])


def check_lens(camera: Camera) -> None:
    """Check that every point of the picture images exactly one direction.

    Brown's polynomial folds over beyond some angle, and a barrel lens images nothing beyond it.

    Raises:
        ValueError: the picture extends beyond the fold.
    """
    if not camera.distortion.any():
        return
    width, height = camera.size
    u, v = np.meshgrid(np.linspace(-0.5, width - 0.5, _SAMPLES), np.linspace(-0.5, height - 0.5, _SAMPLES))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    folded = ~np.isfinite(undistorted(camera, pixels)).all(axis=1)
    if folded.any():
        radius = np.linalg.norm(pixels - camera.K[:2, 2], axis=1)
        terms = ", ".join(f"{term:g}" for term in camera.distortion)
        raise ValueError(
            f"camera {camera.name!r}: its lens, k1 k2 p1 p2 k3 = {terms}, folds over {radius[folded].min():.0f} pixels "
            f"from its axis, inside the picture, which extends to {radius.max():.0f} pixels; expected one direction "
            "for every pixel: use smaller terms or a narrower field of view, or calibrate with points in the corners"
        )
