"""Numbers as text for tables, pages and terminals, without negative zeros."""


def fixed(value: float, digits: int) -> str:
    """Return a number with a fixed number of decimals; what rounds to zero is "0.0", never "-0.0"."""
    return f"{value:z.{digits}f}"


def signed(value: float, digits: int) -> str:
    """Return a difference with its sign and a fixed number of decimals; what rounds to zero has no sign."""
    text = f"{value:+z.{digits}f}"
    return text if float(text) else text[1:]
