"""Renderers by name: the rasteriser, and OpenGL where a machine has it."""

from __future__ import annotations

from typing import Literal

from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.rendering.renderer import Renderer, Unavailable

RendererName = Literal["auto", "raster", "gl"]


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
    if name == "raster":
        return RasterRenderer()
    from simharness.capture.rendering.gl import GlRenderer  # needs OpenGL, which not every machine has

    try:
        return GlRenderer()
    except Unavailable:
        if name == "gl":
            raise
        return RasterRenderer()
