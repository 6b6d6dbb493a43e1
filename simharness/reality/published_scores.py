"""Published scores on Campus and Shelf: tables 1 and 2 of Dong et al., CVPR 2019.

    Dong, Jiang, Huang, Bao, Zhou: Fast and Robust Multi-Person 3D Pose Estimation from Multiple Views, CVPR 2019.

All numbers are percentages of correct parts (PCP). Those of Dong et al. were made with their detections and the head
mapping "2019"; the rows of other methods are as that paper quotes them.
"""

from __future__ import annotations

from typing import NamedTuple


class PublishedPcp(NamedTuple):
    """Row of a table: PCP in percent, as printed, with one digit after the decimal point."""

    actor_1: float
    actor_2: float
    actor_3: float
    average: float


ABLATION: dict[str, dict[str, PublishedPcp]] = {
    "campus": {
        "full": PublishedPcp(97.6, 93.3, 98.0, 96.3),
        "appearance": PublishedPcp(97.6, 93.3, 96.5, 95.8),
        "geometry": PublishedPcp(97.4, 90.1, 89.4, 92.3),
        "no-3dps": PublishedPcp(90.6, 89.2, 97.7, 92.5),
        "no-matching": PublishedPcp(84.8, 89.0, 71.5, 81.8),
    },
    "shelf": {
        "full": PublishedPcp(98.8, 94.1, 97.8, 96.9),
        "appearance": PublishedPcp(98.6, 60.5, 94.3, 84.5),
        "geometry": PublishedPcp(97.2, 79.5, 96.5, 91.1),
        "no-3dps": PublishedPcp(97.9, 89.5, 97.8, 95.1),
        "no-matching": PublishedPcp(98.1, 91.1, 92.8, 94.0),
    },
}
"""Table 2, by data set and by the equivalent preset of :class:`mvpose.Pipeline`."""

COMPARISON: dict[str, dict[str, PublishedPcp]] = {
    "campus": {
        "Belagiannis et al., CVPR 2014": PublishedPcp(82.0, 72.4, 73.7, 75.8),
        "Belagiannis et al., ECCV Workshops 2014": PublishedPcp(83.0, 73.0, 78.0, 78.0),
        "Belagiannis et al., PAMI 2016": PublishedPcp(93.5, 75.7, 84.4, 84.5),
        "Ershadi-Nasab et al., Multimedia Tools and Applications 2018": PublishedPcp(94.2, 92.9, 84.6, 90.6),
        "Dong et al., CVPR 2019, without 3DPS": ABLATION["campus"]["no-3dps"],
        "Dong et al., CVPR 2019": ABLATION["campus"]["full"],
    },
    "shelf": {
        "Belagiannis et al., CVPR 2014": PublishedPcp(66.1, 65.0, 83.2, 71.4),
        "Belagiannis et al., ECCV Workshops 2014": PublishedPcp(75.0, 67.0, 86.0, 76.0),
        "Belagiannis et al., PAMI 2016": PublishedPcp(75.3, 69.7, 87.6, 77.5),
        "Ershadi-Nasab et al., Multimedia Tools and Applications 2018": PublishedPcp(93.3, 75.9, 94.8, 88.0),
        "Dong et al., CVPR 2019, without 3DPS": ABLATION["shelf"]["no-3dps"],
        "Dong et al., CVPR 2019": ABLATION["shelf"]["full"],
    },
}
"""Table 1, by data set and method.

The average of Belagiannis et al., CVPR 2014, on Campus is printed as 75.8; the mean of its row is 76.0.
"""
