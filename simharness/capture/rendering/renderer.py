"""What a renderer is: a camera and meshes in, colour, depth and mesh index of every pixel out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh

RendererName = Literal["auto", "raster", "gl"]

NEAR = 0.05  # metres in front of the camera's centre; nothing nearer is drawn, by any renderer
DAYLIGHT = Lighting()


class Unavailable(RuntimeError):
    """A renderer cannot work on this machine; the message says why and what to install."""


@dataclass(frozen=True)
class Image:
    """What one camera sees. Rows are y, columns x; an array index is the pixel's centre.

    Attributes:
        rgb: (h, w, 3) uint8; zeros where no colour was asked for.
        depth: distance along the optical axis, metres, (h, w) float32; +inf where nothing is seen.
        ids: index of the mesh seen, (h, w) int16; -1 where nothing is seen.
        parts: label of the face seen, of :attr:`Mesh.parts`, (h, w) int8; -1 where it has none or nothing is seen. None
            where it was not asked for.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int16]
    parts: NDArray[np.int8] | None = None

    def __post_init__(self) -> None:
        shape = self.depth.shape
        if self.depth.ndim != 2 or self.rgb.shape != (*shape, 3) or self.ids.shape != shape:
            raise ValueError(
                "rgb, depth and ids must be (h, w, 3), (h, w) and (h, w), "
                f"got {self.rgb.shape}, {shape} and {self.ids.shape}"
            )
        if self.parts is not None and self.parts.shape != shape:
            raise ValueError(f"parts must be {shape} as depth is, got {self.parts.shape}")


class Renderer(Protocol):
    """Anything that makes pictures of meshes. Faces are opaque from both sides; the nearest is seen."""

    def render(
        self,
        camera: Camera,
        meshes: Sequence[Mesh],
        *,
        color: bool = True,
        lighting: Lighting = DAYLIGHT,
        parts: bool = False,
    ) -> Image:
        """Picture ``meshes`` as ``camera`` sees them; ``Image.ids`` are indices into ``meshes``.

        A lens with distortion bends the picture as it would (:mod:`simharness.capture.rendering.lens`).

        Args:
            camera: any camera.
            meshes: what is there. Pass the same objects for all views: renderers prepare them once. From frame to frame
                move meshes with :meth:`Mesh.moved`: what does not change with it is prepared once for all.
            color: shade the picture; without it ``Image.rgb`` is zeros and the rest comes sooner.
            lighting: the light in it.
            parts: label the parts as well.

        Raises:
            ValueError: a lens so wide that no picture can be made of it, or there are more meshes than ids.
        """
        ...


def check_count(meshes: Sequence[Mesh], *, most: int) -> None:
    """Refuse more than ``most`` meshes."""
    if len(meshes) > most:
        raise ValueError(f"this renderer tells at most {most} meshes apart, got {len(meshes)}: merge some")


def make_renderer(name: RendererName = "raster") -> Renderer:
    """Return the renderer of this name.

    Args:
        name: ``"raster"`` (numba, runs everywhere), ``"gl"`` (pyrender on EGL), or ``"auto"``: gl where it works, else
            raster.

    Raises:
        Unavailable: ``"gl"`` was requested and no context can be created.
        ValueError: an unknown name.
    """
    if name not in ("raster", "gl", "auto"):
        raise ValueError(f"renderer must be 'raster', 'gl' or 'auto', got {name!r}")
    from simharness.capture.rendering.raster import RasterRenderer

    if name == "raster":
        return RasterRenderer()
    from simharness.capture.rendering.gl import GlRenderer  # needs OpenGL, which not every machine has

    try:
        return GlRenderer()
    except Unavailable:
        if name == "gl":
            raise
        return RasterRenderer()
