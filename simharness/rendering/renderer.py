"""What a renderer is: a camera and meshes in, colour, depth and mesh index of every pixel out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.rendering.mesh import Mesh

RendererName = Literal["auto", "raster", "gl"]

NEAR = 0.05  # metres in front of the camera's centre; nothing nearer is drawn, by any renderer
TO_LIGHT = np.array([0.38, 0.24, 0.89]) / np.linalg.norm([0.38, 0.24, 0.89])  # high: short shadows at the feet
BACKGROUND = (0.82, 0.85, 0.88)  # sRGB


class Unavailable(RuntimeError):
    """A renderer cannot work on this machine; the message says why and what to install."""


@dataclass(frozen=True)
class Image:
    """What one camera sees. Rows are y, columns x; an array index is the pixel's centre.

    Attributes:
        rgb: (h, w, 3) uint8; zeros where no colour was asked for.
        depth: distance along the optical axis, metres, (h, w) float32; +inf where nothing is seen.
        ids: index of the mesh seen, (h, w) int16; -1 where nothing is seen.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int16]

    def __post_init__(self) -> None:
        shape = self.depth.shape
        if self.depth.ndim != 2 or self.rgb.shape != (*shape, 3) or self.ids.shape != shape:
            raise ValueError(
                "rgb, depth and ids must be (h, w, 3), (h, w) and (h, w), "
                f"got {self.rgb.shape}, {shape} and {self.ids.shape}"
            )


class Renderer(Protocol):
    """Anything that makes pictures of meshes. Faces are opaque from both sides; the nearest is seen."""

    def render(self, camera: Camera, meshes: Sequence[Mesh], *, color: bool = True) -> Image:
        """Picture ``meshes`` as ``camera`` sees them; ``Image.ids`` are indices into ``meshes``.

        Args:
            camera: a pinhole camera.
            meshes: what is there. Pass the same objects for all views: renderers prepare them once.
            color: shade the picture; without it ``Image.rgb`` is zeros and the rest comes sooner.

        Raises:
            ValueError: the camera has lens distortion, or there are more meshes than ids.
        """
        ...


def check_scene(camera: Camera, meshes: Sequence[Mesh], *, most: int) -> None:
    """Refuse what the renderers cannot draw rightly: a lens with distortion, more than ``most`` meshes."""
    if camera.distortion.any():
        raise ValueError(
            f"camera {camera.name!r} has lens distortion {camera.distortion.tolist()}; renderers draw pinhole "
            "cameras only: set the distortion to zeros, or render the pinhole camera and warp its picture"
        )
    if len(meshes) > most:
        raise ValueError(f"this renderer tells at most {most} meshes apart, got {len(meshes)}: merge some")
