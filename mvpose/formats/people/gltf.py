"""Motion of all people in one glTF 2.0 file (``people.glb``): nodes with rotations over time, and bones to look at.

Metres, y up (the specification demands it); people face z of the file in the zero pose. Every person is a tree of
nodes below ``person_ID``, with a mesh of its bones in its own colour, and is scaled to nothing while it is not there.
All move in one animation, because programs that show glTF files play one animation at a time.
The lengths and rotations are those of a fitted body (:mod:`mvpose.skeleton_fit`).
Source: Khronos Group, glTF 2.0 Specification, 2021.
"""

import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.formats.people.animation import Hierarchy, hierarchy
from mvpose.formats.people.people_files import AXES, Export

_FLOAT, _SHORT = 5126, 5123  # component types
_VERTICES, _TRIANGLES = 34962, 34963  # targets of buffer views
_THICKNESS = 0.12  # of a bone, as a share of its length
_COLORS = ((0.12, 0.47, 0.71), (1.0, 0.5, 0.05), (0.17, 0.63, 0.17), (0.84, 0.15, 0.16), (0.58, 0.4, 0.74))


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield one file with all people to whom a body can be fitted, in all frames of the recording."""
    people = export.uniform
    file = _File()
    for fit in export.bodies:
        file.add_person(hierarchy(fit, people).turned(AXES["y"]), people.times - people.times[0])
    yield "people.glb", file.content()


class _File:
    """A glTF file in the making: its JSON tree, and its binary buffer."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._tree: dict[str, list[Any]] = {
            key: [] for key in ("nodes", "meshes", "materials", "accessors", "bufferViews")
        }
        self._animation: dict[str, list[Any]] = {"samplers": [], "channels": []}
        self._roots: list[int] = []

    def add_person(self, person: Hierarchy, times: Floats) -> None:
        """Add the nodes, the meshes and the motion of a person."""
        tree, name = self._tree, f"person_{person.identity}"
        color = _COLORS[len(self._roots) % len(_COLORS)]
        tree["materials"].append({"pbrMetallicRoughness": {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0}})
        top = len(tree["nodes"])
        self._roots.append(top)
        tree["nodes"].append({"name": name, "children": [top + 1]})
        for node, label in enumerate(person.names):
            entry: dict[str, Any] = {"name": label, "translation": person.offsets[node].tolist()}
            if children := person.children(node):
                entry["children"] = [top + 1 + child for child in children]
            ends = [person.offsets[child] for child in children] or [person.tips[node]]
            if (mesh := self._bones(np.array(ends))) is not None:
                entry["mesh"] = mesh
            tree["nodes"].append(entry)
        self._animate(person, times, top)

    def _animate(self, person: Hierarchy, times: Floats, top: int) -> None:
        quaternions = Rotation.from_matrix(person.rotations.reshape(-1, 3, 3)).as_quat()  # x y z w, as in glTF
        quaternions = quaternions.reshape(*person.rotations.shape[:2], 4)
        flips = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0  # q and -q are one rotation: take the nearer
        quaternions[1:] *= np.where(np.cumsum(flips, axis=0) % 2, -1.0, 1.0)[..., None]
        there = np.zeros(len(times))
        there[person.seen] = 1.0
        moving = [node for node in range(len(person.names)) if np.ptp(person.rotations[:, node], axis=0).max() > 0.0]
        fixed = set(range(len(person.names))) - set(moving)
        for node in fixed:
            self._tree["nodes"][top + 1 + node]["rotation"] = quaternions[0, node].tolist()
        clock = self._accessor(times[:, None], "SCALAR", limits=True)
        samplers, channels = self._animation["samplers"], self._animation["channels"]

        def add(node: int, path: str, values: Floats, kind: str, interpolation: str = "LINEAR") -> None:
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
            samplers.append({"input": clock, "output": self._accessor(values, kind), "interpolation": interpolation})

        add(top, "scale", np.repeat(there[:, None], 3, axis=1), "VEC3", "STEP")
        add(top + 1, "translation", person.root, "VEC3")
        for node in moving:
            add(top + 1 + node, "rotation", quaternions[:, node], "VEC4")

    def _bones(self, ends: Floats) -> int | None:
        """Add a mesh of an octahedron from the origin to each end (k, 3), and return its index; None for no length."""
        places: list[Floats] = []
        faces: list[Integers] = []
        for end in ends:
            length = float(np.linalg.norm(end))
            if length > 0.0:
                faces.append(_FACES + 6 * len(places))
                places.append(_octahedron(end, length))
        if not places:
            return None
        positions = self._accessor(np.concatenate(places), "VEC3", _VERTICES, limits=True)
        indices = self._accessor(np.concatenate(faces).reshape(-1, 1), "SCALAR", _TRIANGLES)
        primitive = {
            "attributes": {"POSITION": positions}, "indices": indices, "material": len(self._tree["materials"]) - 1,
        }  # fmt: skip
        self._tree["meshes"].append({"primitives": [primitive]})
        return len(self._tree["meshes"]) - 1

    def _accessor(self, values: NDArray[Any], kind: str, target: int | None = None, *, limits: bool = False) -> int:
        """Add an array (n, components) to the buffer, and return the index of its accessor."""
        whole = values.dtype.kind in "iu"
        stored = np.ascontiguousarray(values, "<u2" if whole else "<f4")
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._buffer), "byteLength": stored.nbytes}
        if target is not None:
            view["target"] = target
        self._tree["bufferViews"].append(view)
        self._buffer += stored.tobytes() + b"\0" * (-stored.nbytes % 4)
        entry: dict[str, Any] = {
            "bufferView": len(self._tree["bufferViews"]) - 1, "componentType": _SHORT if whole else _FLOAT,
            "count": len(stored), "type": kind,
        }  # fmt: skip
        if limits:
            entry |= {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        self._tree["accessors"].append(entry)
        return len(self._tree["accessors"]) - 1

    def content(self) -> bytes:
        """Return the file: a header, the JSON tree, the buffer."""
        tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": "mvpose"}, "scene": 0}
        tree["scenes"] = [{"nodes": self._roots} if self._roots else {}]
        tree |= {key: values for key, values in self._tree.items() if values}  # empty lists are not allowed
        if self._animation["channels"]:
            tree["animations"] = [{"name": "recording", **self._animation}]
        chunks = b""
        if self._buffer:
            tree["buffers"] = [{"byteLength": len(self._buffer)}]
            chunks = struct.pack("<II", len(self._buffer), 0x004E4942) + bytes(self._buffer)
        text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + chunks
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


_FACES = np.array([(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (5, 1, 2), (5, 2, 3), (5, 3, 4), (5, 4, 1)])


def _octahedron(end: Floats, length: float) -> Floats:
    """Return the six corners of a bone from the origin to its end, (6, 3): thickest near the origin."""
    along = end / length
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across /= np.linalg.norm(across)
    around = [across, np.cross(along, across), -across, -np.cross(along, across)]
    ring = [0.2 * end + _THICKNESS * length * each for each in around]
    return np.array([np.zeros(3), *ring, end])
