"""Reconstruction of people in 3D from matched detections (paper, section 3.3): triangulation, pictorial structures."""

from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.pictorial import PictorialStructure
from mvpose.reconstruction.poses import Poses
from mvpose.reconstruction.triangulation import Triangulation
from mvpose.reconstruction.unmatched import UnmatchedPictorialStructure

__all__ = ["Noise", "PictorialStructure", "Poses", "Triangulation", "UnmatchedPictorialStructure"]
