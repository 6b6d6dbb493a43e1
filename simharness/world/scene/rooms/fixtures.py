"""What a picture shows of the lamps and windows of a room: glowing rectangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simharness.types.light_sources import AreaLight
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import quad_mesh
from simharness.world.scene.objects.solids import Solid

_AHEAD = 0.004  # metres in front of the rectangle of the light


def fixture(light: AreaLight, name: str) -> Solid:
    """Return the glowing front of an area light, for pictures alone: no ray and no person touches it."""
    corners = light.corners + _AHEAD * light.normal
    mesh = quad_mesh(corners, np.array([[0, 1, 2, 3]]), np.ones((1, 3)))
    return Solid("room", name, replace(mesh, emission=light.radiance), (), Box.around(corners))
