"""Values as JSON holds them: plain numbers, lists and objects, with null where a number is unknown."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def json_value(value: Any, *, decimals: int | None = None, significant: int | None = None) -> Any:
    """Return a value for ``json.dumps``, or what a container, an array or a method ``to_json`` of an object has.

    NaN and infinity become null.

    Args:
        value: the value.
        decimals: decimals of numbers; None: all.
        significant: significant digits of numbers; None: all.
    """
    if isinstance(value, Mapping):
        return {key: json_value(each, decimals=decimals, significant=significant) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(each, decimals=decimals, significant=significant) for each in value]
    if isinstance(value, np.ndarray | np.generic) or hasattr(value, "to_json"):
        plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value.to_json()
        return json_value(plain, decimals=decimals, significant=significant)
    if not isinstance(value, float):
        return value
    if not math.isfinite(value):
        return None
    number = value if decimals is None else round(value, decimals)
    return number if significant is None else float(f"{number:.{significant}g}")
