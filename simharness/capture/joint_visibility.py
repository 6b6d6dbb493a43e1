"""Visibility of joints, decided by the surface that a picture or a ray shows at the projection of each joint.

A joint centre lies inside its body, so the surface at its pixel is in front of it even if nothing occludes it. The
distance between surface and joint separates "skin around the joint" from "something in front of the joint":

- Up to the radius of the joint plus ``_MARGIN``, the same body's surface is the skin around the joint. The radius that
  a body gives is twice the distance to the nearest skin: on the way out of a limb of radius r, at an angle to its axis,
  the skin is r / sin(angle) away, and 2 covers angles down to 30 degrees. At smaller angles the limb itself, seen
  along its length, occludes the joint; the far hip or shoulder seen from the side is further behind still.
- ``_MARGIN`` = 4 cm is for joints on or near the skin: the face, where the radius is near 0, and flat wrists, which are
  thicker in one direction. From all viewpoints, the near eyes and ears lie at most 2 cm under the visible skin, the far
  ones at least 5 cm.
- Another person or an object occludes a joint as soon as it is in front of it: it cannot be inside the body.
- A surface behind the joint means that the joint projects just outside the outline of its body: it is visible.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.renderer import Image
from simharness.types.views import Visibility
from simharness.world.rigs.projection import project_to_image

_MARGIN = 0.04  # metres


def label_joints(image: Image, camera: Camera, *, joints: ArrayLike, radii: ArrayLike) -> NDArray[np.int8]:
    """Return the visibility of every joint of every person in one picture.

    Args:
        image: depth and ids; meshes 0 to P - 1 are the people, the others objects and the room.
        camera: camera that took the picture.
        joints: joint centres in the world, (P, J, 3), metres.
        radii: largest distance of the skin in front of each joint, (P, J), metres (``Body.joint_radii``).

    Returns:
        :class:`Visibility` of each joint, (P, J) int8; OUTSIDE for a joint outside the image or behind the camera.

    Raises:
        ValueError: shapes that do not match, or an image that does not have the size of the camera.
    """
    joints, radii = np.asarray(joints, float), np.asarray(radii, float)
    if joints.ndim != 3 or joints.shape[2] != 3 or radii.shape != joints.shape[:2]:
        raise ValueError(f"joints must be (P, J, 3) and radii (P, J), got {joints.shape} and {radii.shape}")
    if image.depth.shape != camera.size[::-1]:
        raise ValueError(
            f"the image must have the size of camera {camera.name!r}, {camera.size[0]} x {camera.size[1]} pixels, "
            f"got {image.depth.shape[1]} x {image.depth.shape[0]}"
        )
    pixels = project_to_image(camera, joints)
    inside = camera.inside(pixels)
    column, row = np.moveaxis(np.floor(np.where(inside[..., None], pixels, 0) + 0.5).astype(int), -1, 0)
    owner = image.ids[row, column]
    depth = camera.depth(joints)
    # Metres along the ray, not along the axis: the radii are isotropic.
    stretch = np.where(inside, np.linalg.norm(joints - camera.center, axis=-1), 1.0) / np.where(inside, depth, 1.0)
    in_front = (depth - image.depth[row, column]) * stretch  # -inf where no surface is
    return classify(owner, in_front, inside, radii=radii)


def classify(owner: ArrayLike, in_front: ArrayLike, inside: ArrayLike, *, radii: ArrayLike) -> NDArray[np.int8]:
    """Return the visibility of joints from the surface at the projection of each; same rule for pictures and rays.

    Args:
        owner: owner of the surface, (..., P, J) int: 0 to P - 1 a person, P or more an object, -1 no surface.
        in_front: distance of the surface in front of the joint along the ray, metres, (..., P, J); negative behind it.
        inside: whether the joint is inside the picture, (..., P, J).
        radii: largest distance of the skin in front of each joint, (..., P, J), metres.

    Returns:
        :class:`Visibility`, (..., P, J) int8.
    """
    owner, in_front, radii = np.asarray(owner), np.asarray(in_front), np.asarray(radii, float)
    people = radii.shape[-2]
    same_person = owner == np.arange(people)[:, None]
    person = (owner >= 0) & (owner < people)
    hidden = np.where(person, int(Visibility.OCCLUDED_BY_PERSON), int(Visibility.OCCLUDED_BY_CLUTTER))
    hidden = np.where(same_person, int(Visibility.SELF_OCCLUDED), hidden)
    hidden = np.where(in_front <= np.where(same_person, radii + _MARGIN, 0.0), int(Visibility.VISIBLE), hidden)
    return np.where(inside, hidden, int(Visibility.OUTSIDE)).astype(np.int8)
