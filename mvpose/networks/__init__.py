"""Networks in ONNX files, run by onnxruntime: re-ID descriptors and top-down pose heads.

``ReId(file).describe(detections, images)`` adds descriptors to detections; ``PoseHead(file).detect(images, view,
boxes)`` computes detections for boxes. Onnxruntime is imported when a file is opened.
"""

from mvpose.networks.card import Card
from mvpose.networks.pose import PoseHead
from mvpose.networks.reid import ReId
from mvpose.networks.session import Session

__all__ = ["Card", "PoseHead", "ReId", "Session"]
