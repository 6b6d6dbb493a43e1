"""Filming a simulated sequence: what every camera sees of every person in every frame.

Frames are independent of each other, so processes can share them and :meth:`Views.concatenate` the parts.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera, Rig
from mvpose.checks import as_array
from simharness.rendering.mesh import Mesh
from simharness.rendering.renderer import NEAR, Image, Renderer
from simharness.rendering.visibility import label

if TYPE_CHECKING:
    from simharness.scene.build import Scene
    from simharness.scene.sequence import Sequence


PREVIEW = 320  # pixels: width of the reduced pictures


@dataclass(frozen=True)
class Views:
    """The truth in the pictures of V cameras over T frames.

    Attributes:
        pixels: where each joint projects, (T, V, P, J, 2); NaN behind the camera.
        visibility: :class:`simharness.rendering.visibility.Visibility`, (T, V, P, J) int8.
        boxes: x, y, width, height in pixels of the part of each person's silhouette that falls on the image,
            whatever stands in front, (T, V, P, 4); zeros where none does.
        area_visible: pixels in which each person is seen, (T, V, P).
        previews: reduced colour pictures of some frames, by frame, each (V, h, w, 3) uint8.
    """

    pixels: NDArray[np.float64]
    visibility: NDArray[np.int8]
    boxes: NDArray[np.float64]
    area_visible: NDArray[np.int64]
    previews: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        pixels = as_array(self.pixels, ("T", "V", "P", "J", 2), "pixels")
        shape = pixels.shape[:4]
        for key, value in (
            ("pixels", pixels),
            ("visibility", as_array(self.visibility, shape, "visibility", np.int8)),
            ("boxes", as_array(self.boxes, (*shape[:3], 4), "boxes")),
            ("area_visible", as_array(self.area_visible, shape[:3], "area_visible", np.int64)),
        ):
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(self.pixels)

    @classmethod
    def concatenate(cls, parts: Many[Self]) -> Self:
        """Join films of consecutive frames.

        Raises:
            ValueError: no parts, or parts of different views, people or joints.
        """
        shapes = {part.pixels.shape[1:] for part in parts}
        if len(shapes) != 1:
            raise ValueError(f"films to join must share views, people and joints, got {sorted(shapes) or 'none'}")
        return cls(
            pixels=np.concatenate([part.pixels for part in parts]),
            visibility=np.concatenate([part.visibility for part in parts]),
            boxes=np.concatenate([part.boxes for part in parts]),
            area_visible=np.concatenate([part.area_visible for part in parts]),
            previews={frame: pictures for part in parts for frame, pictures in part.previews.items()},
        )


def meshes_at(scene: Scene, sequence: Sequence, frame: int) -> list[Mesh]:
    """Everything to be seen in one frame: people first, so that a mesh index below P is a person; then things."""
    people = [
        Mesh(vertices=body.skin(bones), faces=body.faces, colors=colors, smooth=True)
        for body, bones, colors in zip(scene.bodies, sequence.bones[frame], scene.skins, strict=True)
    ]
    return [*people, *(solid.mesh for solid in scene.solids)]


def image(scene: Scene, sequence: Sequence, camera: Camera, frame: int, renderer: Renderer, *, finer: int = 1) -> Image:
    """Picture one frame from one camera; with ``finer`` the colours are :func:`antialiased`."""
    meshes = meshes_at(scene, sequence, frame)
    if finer == 1:
        return renderer.render(camera, meshes)
    rgb = antialiased(renderer, camera, meshes, finer=finer)
    return replace(renderer.render(camera, meshes, color=False), rgb=rgb)


def antialiased(renderer: Renderer, camera: Camera, meshes: Many[Mesh], *, finer: int = 2) -> NDArray[np.uint8]:
    """Picture for people to look at, (h, w, 3): ``finer`` x ``finer`` samples a pixel, so that outlines are smooth."""
    K = camera.K.copy()
    K[:2] *= finer
    K[:2, 2] += (finer - 1) / 2  # pixel centres are integers at either size
    width, height = camera.size
    large = renderer.render(replace(camera, K=K, size=(finer * width, finer * height)), meshes).rgb
    return cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def film(
    scene: Scene,
    sequence: Sequence,
    rig: Rig,
    renderer: Renderer,
    *,
    frames: Many[int] | None = None,
    color: bool = False,
    previews: Collection[int] = (),
) -> Views:
    """Film ``frames`` (all by default) of a sequence with every camera of a rig.

    Args:
        scene: people, their colours and the things around them.
        sequence: where everyone is in every frame.
        rig: the V cameras.
        renderer: makes colour, depth and ids.
        frames: indices into the sequence.
        color: shade the pictures; labels and boxes need depth and ids only.
        previews: frames of which to keep the colour pictures, reduced to a width of ``PREVIEW`` pixels.
    """
    frames = range(len(sequence.joints)) if frames is None else frames
    people, joints = sequence.joints.shape[1:3]
    radii = np.reshape([body.joint_radii for body in scene.bodies], (people, joints))
    shape = (len(frames), len(rig), people)
    pixels, visibility = np.full((*shape, joints, 2), np.nan), np.zeros((*shape, joints), np.int8)
    boxes, area = np.zeros((*shape, 4)), np.zeros(shape, np.int64)
    kept: dict[int, NDArray[np.uint8]] = {}
    for f, frame in enumerate(frames):
        meshes = meshes_at(scene, sequence, frame)
        where = sequence.joints[frame]
        reduced = []
        for v, camera in enumerate(rig):
            picture = renderer.render(camera, meshes, color=color)
            if frame in previews:
                reduced.append(_reduced(picture.rgb))
            pixels[f, v] = camera.project(where)
            visibility[f, v] = label(picture, camera, joints=where, radii=radii)
            area[f, v] = np.bincount(picture.ids.ravel() + 1, minlength=people + 1)[1 : people + 1]
            for p in range(people):
                boxes[f, v, p] = silhouette_box(camera, meshes[p].vertices)
        if reduced:
            kept[frame] = np.stack(reduced)
    return Views(pixels=pixels, visibility=visibility, boxes=boxes, area_visible=area, previews=kept)


def _reduced(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = rgb.shape[:2]
    size = (PREVIEW, max(1, round(PREVIEW * height / width)))
    return cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def silhouette_box(camera: Camera, vertices: NDArray) -> NDArray[np.float64]:
    """Box x, y, width, height of the part of a body that projects onto the image; zeros where none does.

    Taken over the projected vertices that fall on the image, which lie a pixel or two apart; points nearer than
    the near plane are not seen. The camera is a pinhole.

    Args:
        camera: the camera.
        vertices: of the body's skin, (n, 3), metres.
    """
    # Row by row rather than by a matrix product: BLAS may round differently from one process to the next.
    x, y, z = np.ascontiguousarray(vertices.T, float)
    u, v, depth = (row[0] * x + row[1] * y + row[2] * z + row[3] for row in camera.P)
    front = depth >= NEAR
    u, v = u[front] / depth[front], v[front] / depth[front]
    width, height = camera.size
    seen = (u >= -0.5) & (u < width - 0.5) & (v >= -0.5) & (v < height - 0.5)
    if not seen.any():
        return np.zeros(4)
    u, v = u[seen], v[seen]
    return np.array([u.min(), v.min(), np.ptp(u), np.ptp(v)])
