"""Accessories on a dressed body: their meshes come after all others, so they can be taken off again.

Kinematics, capsules and collisions are those of :func:`plain` looks: how people move does not depend on what they wear
on head and shoulders, nor on how their hair is cut or tied.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from simharness.world.humans.added_mesh import add_mesh
from simharness.world.humans.bags import backpack, shoulder_bag
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.clothing_colors import Color
from simharness.world.humans.head_wear import glasses, hat, mask
from simharness.world.humans.wardrobe import Look, mix

_LENS: Color = (0.05, 0.05, 0.06)
_GROWN = {"bob": "short", "curly": "short", "ponytail": "long"}  # hair styles are drawn for people with these


def plain(look: Look) -> Look:
    """Return the look without accessories, its hair short, long or in a bun."""
    hair_style = _GROWN.get(look.hair_style, look.hair_style)
    return replace(look, hair_style=hair_style, glasses="none", hat="none", mask="none", bag="none")


def wear(body: Body, look: Look) -> Body:
    """Return a dressed body with the meshes of the accessories of its look; joints do not move."""
    meshes = []
    if look.mask != "none":
        meshes += mask(body)
    if look.glasses != "none":
        below = add_mesh(body, meshes[0]) if meshes else body
        meshes += glasses(below, kind=look.glasses)
    if look.hat != "none":
        meshes += hat(body, kind=look.hat)
    if look.bag != "none":
        meshes += (backpack if look.bag == "backpack" else shoulder_bag)(body)
    for mesh in meshes:
        body = add_mesh(body, mesh)
    return body


def take_off(body: Body) -> Body:
    """Return the body without accessories: the inverse of :func:`wear`."""
    worn = body.part >= FacePart.GLASSES
    if not worn.any():
        return body
    k = int(np.argmax(worn))
    n = int(body.faces[worn].min())
    return replace(
        body,
        vertices=body.vertices[:n],
        faces=body.faces[:k],
        part=body.part[:k],
        level=body.level[:k],
        weight_bones=body.weight_bones[:n],
        weights=body.weights[:n],
    )


def accessory_colors(look: Look) -> Mapping[FacePart, Color]:
    """Return the colour of the faces of every kind of accessory."""
    return {
        FacePart.GLASSES: look.frame_color,
        FacePart.LENS: _LENS,
        FacePart.HAT: look.hat_color,
        FacePart.HAT_BAND: mix(look.hat_color, (0.05, 0.05, 0.05), 0.6),
        FacePart.MASK: look.mask_color,
        FacePart.BAG: look.bag_color,
        FacePart.STRAP: mix(look.bag_color, (0.05, 0.05, 0.05), 0.35),
    }
