"""One way to check an array at the border."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def as_array(
    value: ArrayLike, shape: tuple[int | str, ...], name: str, dtype: type[np.generic] = np.float64
) -> NDArray:
    """Return ``value`` as a read-only array of ``dtype`` and ``shape``.

    Args:
        value: anything NumPy reads.
        shape: sizes; a string stands for any size and names it in the message ("m").
        name: what the message calls the array.
        dtype: the wanted scalar type.

    Raises:
        ValueError: "keypoints must be (m, 17, 2), got (4, 17)".
    """
    try:
        array = np.array(value, dtype=dtype)  # a copy: the caller's later writes must not reach a frozen object
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be numbers of shape {_written(shape)}: {error}") from None
    fits = array.ndim == len(shape) and all(
        isinstance(wanted, str) or got == wanted for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} must be {_written(shape)}, got {_written(array.shape)}")
    array.flags.writeable = False
    return array


def _written(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "") + ")"
