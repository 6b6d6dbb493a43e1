"""Places on a dressed head at rest that hats, glasses, masks and hair are fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.types.landmarks import LANDMARKS
from simharness.world.humans.body import Body, FacePart


@dataclass(frozen=True)
class FacePoints:
    """Places on a head at rest, metres in the world; the face looks to +x.

    Attributes:
        eye, ear, nose: left eye, left ear and nose, (3,); the right side is mirrored at y = 0.
        crown: height of the top of the bare head.
        scale: height of the crown over the eyes relative to an adult's, about 0.8 to 1.1.
        face: vertices of skin, lips and brows of the head, (n, 3).
        scalp: vertices of the hair, with those of long hair, (s, 3).
    """

    eye: Floats
    ear: Floats
    nose: Floats
    crown: float
    scale: float
    face: Floats
    scalp: Floats

    @classmethod
    def of(cls, body: Body) -> FacePoints:
        """Find the places on a dressed or bare body."""
        at = {name: body.keypoints[LANDMARKS.index(name), :, :3].sum(axis=0) for name in _NAMES}
        crown = float(at["head_top"][2])
        vertices = body.vertices.astype(float)
        face, scalp = (vertices[np.unique(body.faces[np.isin(body.part, parts)])] for parts in (_FACE, _SCALP))
        return cls(
            eye=_left(at["left_eye"], at["right_eye"]),
            ear=_left(at["left_ear"], at["right_ear"]),
            nose=at["nose"],
            crown=crown,
            scale=(crown - float(at["left_eye"][2])) / _EYES_TO_CROWN,
            face=face[face[:, 2] > at["nose"][2] - 1.2 * (crown - at["nose"][2])],
            scalp=scalp,
        )


_NAMES = ("left_eye", "right_eye", "left_ear", "right_ear", "nose", "head_top")
_FACE = [FacePart.SKIN, FacePart.LIPS, FacePart.BROW]
_SCALP = [FacePart.SCALP]
_EYES_TO_CROWN = 0.107  # of an adult, metres


def _left(left: Floats, right: Floats) -> Floats:
    """Return the mean of a left point and the mirrored right point."""
    return 0.5 * (left + right * [1, -1, 1])
