"""Multi-person 3D pose estimation from a few calibrated cameras (Dong et al., CVPR 2019); needs no GPU."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mvpose.camera import Camera, Rig
    from mvpose.detections import Detections
    from mvpose.estimate import Estimate, Matching
    from mvpose.pipeline import Pipeline
    from mvpose.presets import preset
    from mvpose.skeleton import COCO17, PANOPTIC19, SHELF14, Skeleton

_NAMES = {
    "camera": ("Camera", "Rig"),
    "detections": ("Detections",),
    "estimate": ("Estimate", "Matching"),
    "pipeline": ("Pipeline",),
    "presets": ("preset",),
    "skeleton": ("COCO17", "PANOPTIC19", "SHELF14", "Skeleton"),
}
_MODULES = {name: f"mvpose.{module}" for module, names in _NAMES.items() for name in names}

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
    "preset",
]


def __getattr__(name: str) -> Any:
    """Import public names at their first use, so that `mvpose --help` does not load numba."""
    if name not in _MODULES:
        raise AttributeError(f"module 'mvpose' has no attribute {name!r}; it has {', '.join(__all__)}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value  # found without this function from now on
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
