"""Multi-person 3D pose estimation from a few calibrated cameras (Dong et al., CVPR 2019); needs no GPU."""

from mvpose.camera import Camera, Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.pipeline import Pipeline
from mvpose.skeleton import COCO17, PANOPTIC19, SHELF14, Skeleton

__all__ = [
    "COCO17",
    "PANOPTIC19",
    "SHELF14",
    "Camera",
    "Detections",
    "Estimate",
    "Matching",
    "Pipeline",
    "Rig",
    "Skeleton",
]
