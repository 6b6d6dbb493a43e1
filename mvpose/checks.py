"""One way to check an array or a number at the border."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def as_array(
    value: ArrayLike, shape: tuple[int | str, ...], name: str, dtype: type[np.generic] = np.float64
) -> NDArray:
    """Return ``value`` as a read-only array of ``dtype`` and ``shape``, C-contiguous.

    Args:
        value: anything NumPy reads as numbers; ``None`` among floats is NaN.
        shape: sizes; a string stands for any size and names it in the message ("m").
        name: what the message calls the array.
        dtype: the wanted scalar type. Integers must be given as whole numbers: 1.5 is refused, not cut off, and so
            is a mask.

    Raises:
        ValueError: "keypoints must be (m, 17, 2), got (4, 17)".
    """
    if _sealed(value, shape, dtype):
        return value  # type: ignore[return-value]
    try:
        given = np.asarray(value)
        if given.dtype.kind == "O":
            given = given.astype(np.float64)
        # Always a copy: the caller's later writes must not reach a frozen object.
        array = given.astype(dtype, order="C") if given.dtype == dtype else _converted(given, np.dtype(dtype))
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must be numbers of shape {_written(shape)}: {error}") from None
    fits = array.ndim == len(shape) and all(
        isinstance(wanted, str) or got == wanted for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} must be {_written(shape)}, got {_written(array.shape)}")
    array.flags.writeable = False
    return array


def seal(*arrays: NDArray) -> None:
    """Make fresh arrays read-only, so that :func:`as_array` need not copy what nobody can write to."""
    for array in arrays:
        array.setflags(write=False)


class Sealed:
    """A frozen dataclass that pickle and copy make anew by its constructor.

    NumPy's arrays come back from either with leave to write: what is cached of them would no longer be true, and numba
    would compile every kernel once more.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))  # type: ignore[arg-type]


def check_numbers(
    owner: object,
    what: str,
    *,
    positive: Iterable[str] = (),
    not_negative: Iterable[str] = (),
    limits: Iterable[str] = (),
) -> None:
    """Refuse settings that make no sense, by the names of the owner's fields.

    Args:
        owner: whose fields they are.
        what: what the message calls the owner.
        positive: above 0 and finite.
        not_negative: 0 or more and finite.
        limits: above 0; infinite where there is none.

    Raises:
        ValueError: "slope of the geometric affinity must be above 0 and finite, got nan".
    """
    for names, allowed, said in (
        (positive, lambda value: 0.0 < value < np.inf, "above 0 and finite"),
        (not_negative, lambda value: 0.0 <= value < np.inf, "0 or more and finite"),
        (limits, lambda value: value > 0.0, "above 0"),
    ):
        for name in names:
            if not allowed(getattr(owner, name)):
                raise ValueError(f"{name} of {what} must be {said}, got {getattr(owner, name)}")


def _sealed(value: ArrayLike, shape: tuple[int | str, ...], dtype: type[np.generic]) -> bool:
    """Whether the value is already what :func:`as_array` makes of it, and shares memory with no other array."""
    if type(value) is not np.ndarray or value.dtype != dtype or isinstance(value.base, np.ndarray):
        return False
    flags = value.flags
    if flags.writeable or not flags.c_contiguous or value.ndim != len(shape):
        return False
    for wanted, got in zip(shape, value.shape, strict=True):
        if wanted != got and not isinstance(wanted, str):
            return False
    return True


def as_points(value: ArrayLike, size: int, name: str) -> NDArray[np.float64]:
    """Return ``value`` as floats of shape (..., size), not copied where it is that already.

    Raises:
        ValueError: "points must be (..., 3), got (4, 2)".
    """
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must be numbers of shape (..., {size}): {error}") from None
    if not array.ndim or array.shape[-1] != size:
        raise ValueError(f"{name} must be (..., {size}), got {_written(array.shape)}")
    return array


def _converted(given: NDArray, dtype: np.dtype) -> NDArray:
    kind, whole = given.dtype.kind, dtype.kind in "iu"
    if kind not in "biuf":
        raise ValueError(f"got values of type {given.dtype}")
    if kind == "b" and whole:
        raise ValueError("got booleans where whole numbers are expected (of a mask, take np.flatnonzero)")
    with np.errstate(invalid="ignore", over="ignore"):
        array = given.astype(dtype, order="C")
    if whole and (array != given).any():
        raise ValueError(f"got {given[array != given].flat[0]}, expected whole numbers that fit {dtype}")
    return array


def _written(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "") + ")"
