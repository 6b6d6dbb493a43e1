"""The colours of people in pictures and plots: one qualitative palette, safe for colour-blind readers.

Picked from Paul Tol's schemes ("Colour schemes", SRON technical note 3.2, 2021) and Okabe and Ito's, so that the
first six and the grey of nobody stay at least 17 CIELAB units apart to usual, protanopic and deuteranopic eyes.
"""

from __future__ import annotations

Color = tuple[int, int, int]

TRUTH: Color = (255, 255, 255)
OUTLINE: Color = (22, 24, 28)
UNMATCHED: Color = (150, 150, 150)  # a detection that no person took, or an estimate that is nobody
INK: Color = (34, 38, 44)
PAPER: Color = (250, 250, 248)

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
    """SRGB colour, 0 to 255, of person ``index``; colours repeat after eight, grey for -1, nobody."""
    return UNMATCHED if index < 0 else _PEOPLE[index % len(_PEOPLE)]


def css(color: Color) -> str:
    """The colour as style sheets and plots write it: ``"#0077bb"``."""
    return "#{:02x}{:02x}{:02x}".format(*color)
