"""Affinity between detections of different views (paper, section 3.2, "Affinity matrix").

The affinity of two detections is the likelihood that they show the same person. Every affinity is a frozen object that
is called with the rig, the detections and their rays (:class:`Affinity`). Scales are absolute, so one person or two
views are enough. Detections of the same view are never compared.
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
