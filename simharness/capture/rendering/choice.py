"""Which renderer: by name, or what this machine has."""

from __future__ import annotations

from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.rendering.renderer import Renderer, RendererName, Unavailable


def make_renderer(name: RendererName = "raster") -> Renderer:
    """Make a renderer by its name.

    Args:
        name: ``"raster"`` (numba, anywhere), ``"gl"`` (pyrender on EGL), or ``"auto"``: gl where it works.

    Raises:
        Unavailable: ``"gl"`` was asked for and no context can be made.
        ValueError: an unknown name.
    """
    if name == "raster":
        return RasterRenderer()
    if name not in ("gl", "auto"):
        raise ValueError(f"renderer must be 'raster', 'gl' or 'auto', got {name!r}")
    from simharness.capture.rendering.gl import GlRenderer  # and with it OpenGL, which not every machine has

    try:
        return GlRenderer()
    except Unavailable:
        if name == "gl":
            raise
        return RasterRenderer()
