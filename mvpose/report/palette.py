"""Colours of people in pictures and plots: one qualitative palette, safe for colour-blind readers.

The colours are from the schemes of Paul Tol ("Colour schemes", SRON technical note 3.2, 2021) and of Okabe and Ito. The
first six and the grey of unmatched detections are at least 17 CIELAB units apart for normal, protanopic and
deuteranopic vision.

Limbs of skeletons as they are drawn, which differ from the tree of the pictorial structure.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17, Skeleton

Edges = Sequence[tuple[int, int]]

# Both sides of the trunk, and no line through it.
COCO17_FACE: Edges = ((0, 1), (0, 2), (1, 3), (2, 4))
COCO17_BODY: Edges = (
    *((5, 6), (5, 11), (6, 12), (11, 12)),  # trunk
    *((5, 7), (7, 9), (6, 8), (8, 10)),  # arms
    *((11, 13), (13, 15), (12, 14), (14, 16)),  # legs
)
COCO17_LIMBS: Edges = (*COCO17_FACE, *COCO17_BODY)

_FACE = COCO17.joints[:5]
SMALL_FACE = 30.0
"""Extent in pixels of a picture 600 pixels high under which the dots of a face run into one patch."""


def face_of(skeleton: Skeleton) -> list[int]:
    """Return the joints of the face: nose, eyes, ears, and numbered points (``face_0``, ...)."""
    return [k for k, joint in enumerate(skeleton.joints) if joint in _FACE or joint.startswith("face_")]


def plain_face(joints: ArrayLike, *, least: float, face: Sequence[int] = tuple(range(len(_FACE)))) -> Floats:
    """Return a person's joints, (J, 2) pixels, with a plain face where it is small.

    The dots of a face that spans less than ``least`` pixels run into one patch. Of such a face only the joint
    nearest to the middle stays.

    Args:
        joints: pixels; NaN for a joint that is not known.
        least: extent of a face that is drawn whole, pixels.
        face: joints of the face (:func:`face_of`); by default those of COCO17.
    """
    joints = np.array(joints, float)
    points = joints[list(face)]
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(known) < 2 or float(np.ptp(points[known], axis=0).max()) >= least:
        return joints
    middle = known[np.linalg.norm(points[known] - points[known].mean(axis=0), axis=1).argmin()]
    joints[[face[k] for k in known.tolist() if k != middle]] = np.nan
    return joints


def limbs_of(skeleton: Skeleton) -> Edges:
    """Return the limbs of a skeleton: those of COCO17 by the names of joints, and bones of the tree to other joints.

    A bone from one side of the body to a joint on its midline is left out: it stands in the tree of SHELF14 and COCO17
    only because a tree needs it.
    """
    names = [(COCO17.joints[a], COCO17.joints[b]) for a, b in COCO17_LIMBS]
    named = [(skeleton.index(a), skeleton.index(b)) for a, b in names if {a, b} <= set(skeleton.joints)]
    reached = {joint for limb in named for joint in limb}
    others = [
        (parent, child)
        for parent, child in skeleton.edges
        if child not in reached and not (skeleton.mirror[parent] != parent and skeleton.mirror[child] == child)
    ]
    return (*named, *others)


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
