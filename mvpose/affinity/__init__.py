"""How likely two detections of different views are one person (paper, section 3.2, "Affinity matrix").

Every affinity is a frozen object that is called with rig, detections and their rays (:class:`Affinity`). Scales are
absolute, so that one person or two views are enough; detections of one view are never compared.
"""

from mvpose.affinity.appearance import AppearanceAffinity
from mvpose.affinity.base import Affinity, sigmoid
from mvpose.affinity.epipolar import EpipolarAffinity, epipolar_distance
from mvpose.affinity.fusion import FusedAffinity
from mvpose.affinity.geometry import GeometricAffinity, ray_distance

__all__ = [
    "Affinity",
    "AppearanceAffinity",
    "EpipolarAffinity",
    "FusedAffinity",
    "GeometricAffinity",
    "epipolar_distance",
    "ray_distance",
    "sigmoid",
]
