"""Renderer interface: colour, depth and mesh index of every pixel from a camera and meshes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh

NEAR = 0.05  # metres in front of the camera centre: near plane of all renderers
DAYLIGHT = Lighting()


class Unavailable(RuntimeError):
    """Error of a renderer that cannot work on this machine; the message gives the reason and what to install."""


@dataclass(frozen=True)
class Image:
    """Rendered image. Rows are y, columns x; integer indices are pixel centres."""

    rgb: NDArray[np.uint8]
    """Colours, (h, w, 3) uint8; zeros if no colour was requested."""
    depth: NDArray[np.float32]
    """Distance along the optical axis, metres, (h, w) float32; +inf without a surface."""
    ids: NDArray[np.int16]
    """Index of the visible mesh, (h, w) int16; -1 without a surface."""
    parts: NDArray[np.int8] | None = None
    """Label of the visible face from ``Mesh.parts``, (h, w) int8; -1 without a label or surface. None if not
    requested."""

    def __post_init__(self) -> None:
        shape = self.depth.shape
        if self.depth.ndim != 2 or self.rgb.shape != (*shape, 3) or self.ids.shape != shape:
            raise ValueError(
                "rgb, depth and ids must be (h, w, 3), (h, w) and (h, w), "
                f"got {self.rgb.shape}, {shape} and {self.ids.shape}"
            )
        if self.parts is not None and self.parts.shape != shape:
            raise ValueError(f"parts must have the shape of depth, {shape}, got {self.parts.shape}")


class Renderer(Protocol):
    """Interface of renderers. Faces are opaque from both sides; the nearest is visible."""

    def render(
        self,
        camera: Camera,
        meshes: Sequence[Mesh],
        *,
        color: bool = True,
        lighting: Lighting = DAYLIGHT,
        parts: bool = False,
    ) -> Image:
        """Render ``meshes`` from ``camera``; ``Image.ids`` are indices into ``meshes``.

        Lens distortion is simulated (:mod:`simharness.capture.rendering.lens`).

        Args:
            camera: any camera.
            meshes: meshes of the scene. Pass the same objects for all views: renderers prepare them once. Between
                frames move meshes with :meth:`~simharness.types.mesh.Mesh.moved`: the arrays that it shares are
                prepared only once.
            color: whether to shade the picture; without it ``Image.rgb`` is zeros and rendering is faster.
            lighting: lighting of the scene.
            parts: whether to label the parts.

        Raises:
            ValueError: a lens that distorts too much to be rendered, or more meshes than ids.
        """
        ...


def check_count(meshes: Sequence[Mesh], *, most: int) -> None:
    """Raise ``ValueError`` for more than ``most`` meshes."""
    if len(meshes) > most:
        raise ValueError(f"this renderer distinguishes at most {most} meshes, got {len(meshes)}: merge some")
