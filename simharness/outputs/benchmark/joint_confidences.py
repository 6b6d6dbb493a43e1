"""Confidences of true joints in the format of CMU Panoptic, by the number of pictures that show them.

Simulated joints are always defined, even where they are hidden; the dataset's mark of an undefined joint (0 0 0 -1) is
never written.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17
from mvpose.arrays import Floats
from mvpose.skeleton import PANOPTIC19
from simharness.types.views import Visibility

CONFIDENCES = {"two or more": 1.0, "one": 0.5, "none": 0.2, "none, nor any joint of the person": 0.0}
"""Confidence of a joint by the number of pictures that show it.

Loaders drop joints with a confidence below 0.1, and people whose middle of the hips has such a confidence. So a hidden
joint gets 0.2 where another joint of the person is visible (a table hides the hips, and the person is kept), and 0
where no picture shows the person at all (the person is dropped).
"""

_MADE_FROM = {"neck": ("left_shoulder", "right_shoulder"), "mid_hip": ("left_hip", "right_hip")}
_SEEN_WITH = [[COCO17.index(each) for each in _MADE_FROM.get(joint, (joint,))] for joint in PANOPTIC19.joints]


def confidences(visibility: ArrayLike) -> Floats:
    """Return the confidence of every joint, (P, 19), one of the values of :data:`CONFIDENCES`.

    Args:
        visibility: :class:`simharness.types.views.Visibility` of COCO-17 in the pictures of a frame,
            (V, P, 17). The neck counts as visible where a shoulder is, the middle of the hips where a hip is.
    """
    visible = np.asarray(visibility) == Visibility.VISIBLE
    seen = np.stack([visible[..., joints].any(axis=-1) for joints in _SEEN_WITH], axis=-1).sum(axis=0)
    person_seen = (seen > 0).any(axis=-1, keepdims=True)
    two, one, hidden, unseen = CONFIDENCES.values()
    return np.select([seen >= 2, seen == 1], [two, one], np.where(person_seen, hidden, unseen))
