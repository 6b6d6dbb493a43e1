"""Colours of people in pictures and plots: one qualitative palette, safe for colour-blind readers.

The colours are from the schemes of Paul Tol ("Colour schemes", SRON technical note 3.2, 2021) and of Okabe and Ito. The
first six and the grey of unmatched detections are at least 17 CIELAB units apart for normal, protanopic and
deuteranopic vision.
"""

Color = tuple[int, int, int]

TRUTH: Color = (255, 255, 255)
OUTLINE: Color = (22, 24, 28)
UNMATCHED: Color = (150, 150, 150)  # a detection assigned to no person, or a ghost
INK: Color = (34, 38, 44)
PAPER: Color = (250, 250, 248)

_MAX_LUMA = 165.0  # of a line on white, 0 to 255

_PEOPLE: tuple[Color, ...] = (
    (0, 119, 187),  # blue
    (238, 119, 51),  # orange
    (238, 51, 119),  # magenta
    (240, 228, 66),  # yellow
    (17, 119, 51),  # green
    (51, 34, 136),  # indigo
    (102, 204, 238),  # cyan
    (153, 153, 51),  # olive
)


def person_color(index: int) -> Color:
    """Return the sRGB colour, 0 to 255, of person ``index``; colours repeat after eight, -1 (no person) is grey."""
    return UNMATCHED if index < 0 else _PEOPLE[index % len(_PEOPLE)]


def css(color: Color) -> str:
    """Return a colour in the notation of style sheets: ``"#0077bb"``."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def line_color(person: int) -> str:
    """Return the colour of a person, darkened where a line of it would be invisible on white."""
    return css(_dark_enough(person_color(person)))


def identity_color(index: int) -> str:
    """Return the colour of identity ``index``: those of :func:`line_color`, then light and dark shades of them.

    Colours repeat after 24: then the number of the identity says which it is.
    """
    color = _dark_enough(person_color(index))
    towards, share = ((0, 0.0), (255, 0.45), (0, 0.4))[index // len(_PEOPLE) % 3]
    red, green, blue = (round(part + share * (towards - part)) for part in color)
    return css((red, green, blue))


def _dark_enough(color: Color) -> Color:
    luma = 0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2]  # Rec. 601
    red, green, blue = (round(part * min(1.0, _MAX_LUMA / luma)) for part in color)
    return red, green, blue
