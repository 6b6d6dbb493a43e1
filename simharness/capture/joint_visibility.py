"""What hides a joint: the place that it projects to, and what is seen there, in a picture or by a ray.

A joint centre lies inside its body, so the surface seen at its pixel is in front of it even where nothing hides
it. What separates "the skin around the joint" from "something in front of it" is how far in front:

- Up to the joint's radius plus ``_MARGIN`` it is the skin around the joint. The radius that comes with a body is
  twice the distance to the nearest skin: on the way out of a limb of radius r, at an angle to its axis, the skin is
  r / sin(angle) away, and 2 covers angles down to 30 degrees. Steeper than that the joint lies behind
  the length of its own limb; the far hip or shoulder seen from the side is further behind still.
- ``_MARGIN`` = 4 cm is for joints on or near the skin: the face, where the radius is near 0, and flat wrists,
  which are thicker one way than the other. Seen from all sides, the near eyes and ears lie at most 2 cm under the
  skin that is seen, the far ones at least 5 cm.
- Anyone or anything else hides a joint as soon as it is in front of it at all: it cannot be inside the body.
- A surface behind the joint means that the joint projects just off its body's outline: nothing hides it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.lens import project_to_image
from simharness.capture.rendering.renderer import Image
from simharness.types.views import Visibility

_MARGIN = 0.04  # metres


def label(image: Image, camera: Camera, *, joints: ArrayLike, radii: ArrayLike) -> NDArray[np.int8]:
    """Label every joint of every person in one view.

    Args:
        image: what the camera sees; meshes 0 to P - 1 are the people, the others things and the room.
        camera: the camera.
        joints: joint centres in the world, (P, J, 3), metres.
        radii: how far in front of each joint its own skin may be, (P, J), metres (``Body.joint_radii``).

    Returns:
        :class:`Visibility` of each joint, (P, J) int8. OUTSIDE is a joint off the image or behind the camera.

    Raises:
        ValueError: shapes that do not fit, or an image that is not of the camera's size.
    """
    joints, radii = np.asarray(joints, float), np.asarray(radii, float)
    if joints.ndim != 3 or joints.shape[2] != 3 or radii.shape != joints.shape[:2]:
        raise ValueError(f"joints must be (P, J, 3) and radii (P, J), got {joints.shape} and {radii.shape}")
    if image.depth.shape != camera.size[::-1]:
        raise ValueError(
            f"the image must be of camera {camera.name!r}, {camera.size[0]} x {camera.size[1]} pixels, "
            f"got {image.depth.shape[1]} x {image.depth.shape[0]}"
        )
    pixels = project_to_image(camera, joints)
    inside = camera.inside(pixels)
    column, row = np.moveaxis(np.floor(np.where(inside[..., None], pixels, 0) + 0.5).astype(int), -1, 0)
    seen = image.ids[row, column]
    depth = camera.depth(joints)
    # Metres along the ray, not the axis: the radii are isotropic.
    stretch = np.where(inside, np.linalg.norm(joints - camera.center, axis=-1), 1.0) / np.where(inside, depth, 1.0)
    in_front = (depth - image.depth[row, column]) * stretch  # -inf where nothing is seen

    return decide(seen, in_front, inside, radii=radii)


def decide(owner: ArrayLike, in_front: ArrayLike, inside: ArrayLike, *, radii: ArrayLike) -> NDArray[np.int8]:
    """The rule, whoever looked: what to call a joint by what is seen at its place.

    Args:
        owner: whose surface is seen, (..., P, J) int: 0 to P - 1 the people, P or more a thing, -1 nothing.
        in_front: how far in front of the joint it is, metres along the ray, (..., P, J); negative behind the joint.
        inside: whether the joint is in the picture, (..., P, J).
        radii: how far in front of each joint its own skin may be, (P, J), metres.

    Returns:
        :class:`Visibility`, (..., P, J) int8.
    """
    owner, in_front, radii = np.asarray(owner), np.asarray(in_front), np.asarray(radii, float)
    people = len(radii)
    own = owner == np.arange(people)[:, None]
    person = (owner >= 0) & (owner < people)
    hidden = np.where(person, int(Visibility.OCCLUDED_BY_PERSON), int(Visibility.OCCLUDED_BY_CLUTTER))
    hidden = np.where(own, int(Visibility.SELF_OCCLUDED), hidden)
    hidden = np.where(in_front <= np.where(own, radii + _MARGIN, 0.0), int(Visibility.VISIBLE), hidden)
    return np.where(inside, hidden, int(Visibility.OUTSIDE)).astype(np.int8)
