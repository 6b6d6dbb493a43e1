"""Validation of arrays and numbers at public interfaces."""

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
        value: any value that NumPy converts to numbers; ``None`` among floats is NaN.
        shape: expected sizes; a string stands for any size and names it in the message ("m").
        name: name of the array in messages.
        dtype: expected scalar type. Integers must be whole numbers: 1.5 is refused, not truncated, and so is a mask.

    Raises:
        ValueError: "keypoints must be (m, 17, 2), got (4, 17)".
    """
    if _sealed(value, shape, dtype):
        return value  # type: ignore[return-value]
    try:
        given = np.asarray(value)
        if given.dtype.kind == "O":
            given = given.astype(np.float64)
        # Always a copy, so that later writes by the caller do not change a frozen object.
        array = given.astype(dtype, order="C") if given.dtype == dtype else _converted(given, np.dtype(dtype))
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must be numbers of shape {_shape_text(shape)}: {_short(error)}") from None
    fits = array.ndim == len(shape) and all(
        isinstance(wanted, str) or got == wanted for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} must be {_shape_text(shape)}, got {_shape_text(array.shape)}")
    array.flags.writeable = False
    return array


def set_arrays(
    owner: object, prefix: str = "", **shapes: tuple[int | str, ...] | tuple[tuple[int | str, ...], type[np.generic]]
) -> None:
    """Replace fields of a frozen dataclass by what :func:`as_array` makes of them.

    Args:
        owner: the dataclass.
        prefix: text before the names of the fields in messages.
        shapes: shape of each field, and its type if that is not float. The size that a string stands for is that of
            the first field which has it.

    Raises:
        ValueError: as of :func:`as_array`.
    """
    sizes: dict[int | str, int | str] = {}
    for name, given in shapes.items():
        shape, dtype = given if isinstance(given[0], tuple) else (given, np.float64)
        array = as_array(getattr(owner, name), tuple(sizes.get(each, each) for each in shape), prefix + name, dtype)
        sizes |= {each: size for each, size in zip(shape, array.shape, strict=True) if isinstance(each, str)}
        object.__setattr__(owner, name, array)


def _short(error: Exception, most: int = 100) -> str:
    """Return the message of an error of NumPy, which may repeat a text of any length."""
    text = str(error)
    return text if len(text) <= most else f"{text[: most - 1]}…"


def seal(*arrays: NDArray) -> None:
    """Make new arrays read-only, so that :func:`as_array` does not have to copy them."""
    for array in arrays:
        array.setflags(write=False)


class Sealed:
    """Base of frozen dataclasses that pickle and copy rebuild by their constructor.

    NumPy arrays are writeable after pickle or copy. Values cached from them could then become wrong, and numba would
    compile every kernel again.
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
    """Check the numeric fields of a configuration object.

    Args:
        owner: object that has the fields.
        what: name of the object in messages.
        positive: names of fields that must be above 0 and finite.
        not_negative: names of fields that must be 0 or more and finite.
        limits: names of fields that must be above 0; infinity means no limit.

    Raises:
        ValueError: "slope of the geometric affinity must be above 0 and finite, got nan".
    """
    for names, allowed, requirement in (
        (positive, lambda value: 0.0 < value < np.inf, "above 0 and finite"),
        (not_negative, lambda value: 0.0 <= value < np.inf, "0 or more and finite"),
        (limits, lambda value: value > 0.0, "above 0"),
    ):
        for name in names:
            if not allowed(getattr(owner, name)):
                raise ValueError(f"{name} of {what} must be {requirement}, got {getattr(owner, name)}")


def _sealed(value: ArrayLike, shape: tuple[int | str, ...], dtype: type[np.generic]) -> bool:
    """Return whether the value already is a valid result of :func:`as_array` and shares memory with no other array."""
    if type(value) is not np.ndarray or value.dtype != dtype or isinstance(value.base, np.ndarray):
        return False
    flags = value.flags
    if flags.writeable or not flags.c_contiguous or value.ndim != len(shape):
        return False
    if value.shape == shape:  # most often; the loop takes three times as long
        return True
    for wanted, got in zip(shape, value.shape, strict=True):
        if wanted != got and not isinstance(wanted, str):
            return False
    return True


def as_points(value: ArrayLike, size: int, name: str) -> NDArray[np.float64]:
    """Return ``value`` as floats of shape (..., size), without a copy where possible.

    Raises:
        ValueError: "points must be (..., 3), got (4, 2)".
    """
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name} must be numbers of shape (..., {size}): {_short(error)}") from None
    if not array.ndim or array.shape[-1] != size:
        raise ValueError(f"{name} must be (..., {size}), got {_shape_text(array.shape)}")
    return array


def _converted(given: NDArray, dtype: np.dtype) -> NDArray:
    kind, whole = given.dtype.kind, dtype.kind in "iu"
    if kind not in "biuf":
        raise ValueError(f"got values of type {given.dtype}")
    if kind == "b" and whole:
        raise ValueError("expected whole numbers, got booleans (convert a mask by np.flatnonzero)")
    with np.errstate(invalid="ignore", over="ignore"):
        array = given.astype(dtype, order="C")
    if whole and (array != given).any():
        raise ValueError(f"got {given[array != given].flat[0]}, expected whole numbers that fit {dtype}")
    return array


def _shape_text(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "") + ")"
