"""Numbers as text for tables, pages and terminals, without negative zeros."""

import math
from typing import Any

NOTHING = "–"
"""Text of a number that does not exist."""


def fixed(value: float, digits: int) -> str:
    """Return a number with a fixed number of decimals; what rounds to zero is "0.0", never "-0.0"."""
    return f"{value:z.{digits}f}"


def span(low: float, high: float, digits: int) -> str:
    """Return the ends of an interval as text, "94.0 to 98.1"; empty where one is not finite."""
    return f"{fixed(low, digits)} to {fixed(high, digits)}" if math.isfinite(low) and math.isfinite(high) else ""


def short(value: Any, digits: int = 6) -> str:
    """Return the text of a value of a key, of numbers with a fraction so many significant digits."""
    return NOTHING if value is None else f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def signed(value: float, digits: int) -> str:
    """Return a difference with its sign and a fixed number of decimals; what rounds to zero has no sign."""
    text = f"{value:+z.{digits}f}"
    return text if float(text) else text[1:]
