"""Rotation matrices and rotation vectors of any leading shape, by SciPy."""

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats

_NO_LENGTH = 1e-9  # metres


def to_matrices(vectors: Floats) -> Floats:
    """Return the rotations of rotation vectors (..., 3), radians, as matrices (..., 3, 3)."""
    flat = np.array(vectors.reshape(-1, 3))  # SciPy refuses arrays that are read-only
    return Rotation.from_rotvec(flat).as_matrix().reshape(*vectors.shape, 3)


def to_vectors(matrices: Floats) -> Floats:
    """Return the rotation vectors (..., 3), radians, of rotation matrices (..., 3, 3)."""
    return Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec().reshape(matrices.shape[:-1])


def shortest(start: Floats, end: Floats) -> Floats:
    """Return the rotations with the least angle that turn unit vectors into others, (..., 3, 3).

    Opposite vectors, between which there is no shortest turn, give a half turn about an axis at right angles.
    """
    start, end = np.broadcast_arrays(start, end)
    axis, cosine = np.cross(start, end), np.sum(start * end, axis=-1)
    opposite = cosine < -1.0 + 1e-12
    K = skew(axis)
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.eye(3) + K + K @ K / (1.0 + cosine)[..., None, None]
    if opposite.any():
        least = np.eye(3)[np.abs(start[opposite]).argmin(axis=-1)]
        normal = np.cross(start[opposite], least)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        turns[opposite] = 2.0 * normal[:, :, None] * normal[:, None, :] - np.eye(3)
    return turns


def skew(vectors: Floats) -> Floats:
    """Return the matrices (..., 3, 3) that multiply as the cross product with vectors (..., 3)."""
    return np.cross(np.eye(3), vectors[..., None, :])


def unit(vectors: Floats, usual: Floats) -> Floats:
    """Return vectors (..., 3) with length 1; the usual ones where they have no length."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(lengths > _NO_LENGTH, vectors / np.maximum(lengths, _NO_LENGTH), usual)


def _across(vectors: Floats, along: Floats) -> Floats:
    """Return the parts of vectors (..., 3) at right angles to unit vectors."""
    return vectors - np.sum(vectors * along, axis=-1, keepdims=True) * along


def frame(primary: Floats, secondary: Floats, axes: tuple[int, int]) -> Floats:
    """Return right-handed frames, (..., 3, 3) with axes as columns, from two directions.

    Args:
        primary: direction of the axis ``axes[0]``, (..., 3); that of the world where its length is 0.
        secondary: direction of the axis ``axes[1]`` as far as it is at right angles to the first, (..., 3).
        axes: which axes they are, 0 to 2, different.
    """
    first = unit(primary, np.eye(3)[axes[0]])
    other = np.eye(3)[np.abs(first).argmin(axis=-1)]  # where the second direction is along the first
    second = unit(_across(secondary, first), unit(_across(other, first), other))
    third = np.cross(first, second)
    result = np.empty((*first.shape, 3))
    result[..., axes[0]], result[..., axes[1]] = first, second
    cyclic = (axes[1] - axes[0]) % 3 == 1
    result[..., 3 - sum(axes)] = third if cyclic else -third
    return result
