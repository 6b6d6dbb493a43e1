"""Motion of one person in a BVH file of Biovision: a hierarchy of bones, and its rotations in every frame.

Centimetres, y up, degrees; the zero pose is the T-pose, facing z of the file. The lengths and rotations are those of a
fitted body (:mod:`mvpose.skeleton_fit`). Channels of a joint are rotations about its local axes in the listed order:
v' = Rz Rx Ry v. Source: M. Meredith and S. Maddock, "Motion Capture File Formats Explained", University of Sheffield,
2001.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.formats.people.animation import Hierarchy, hierarchy
from mvpose.formats.people.people_files import Export

_UNIT = 100.0  # centimetres in a metre
_ORDER = "ZXY"
_CHANNELS = " ".join(f"{axis}rotation" for axis in _ORDER)


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each person to whom a body can be fitted, from its first to its last frame.

    Poses in a gap between them are those of the fitted body, which moves smoothly across.
    """
    for fit in export.bodies:
        nodes = hierarchy(fit, export.uniform).turned(export.axes("y"))
        order = _depth_first(nodes, 0)
        table = np.concatenate([_UNIT * nodes.root, _angles(nodes.rotations[:, order])], axis=1)[nodes.seen]
        lines = ["HIERARCHY", *_described(nodes, 0, ""), "MOTION", f"Frames: {len(table)}"]
        lines.append(f"Frame Time: {1.0 / export.uniform.rate:.8f}")
        lines += [" ".join(f"{value:.5f}" for value in row) for row in table]
        yield f"person_{nodes.identity}.bvh", ("\n".join(lines) + "\n").encode()


def _depth_first(nodes: Hierarchy, node: int) -> list[int]:
    return [node, *(each for child in nodes.children(node) for each in _depth_first(nodes, child))]


def _described(nodes: Hierarchy, node: int, indent: str) -> Iterator[str]:
    """Yield the lines that describe a node and those below it."""
    root, children, inner = nodes.parents[node] < 0, nodes.children(node), indent + "\t"
    yield f"{indent}{'ROOT' if root else 'JOINT'} {nodes.names[node]}"
    yield f"{indent}{{"
    yield f"{inner}OFFSET {_numbers(nodes.offsets[node])}"
    yield f"{inner}CHANNELS {'6 Xposition Yposition Zposition ' if root else '3 '}{_CHANNELS}"
    for child in children:
        yield from _described(nodes, child, inner)
    if not children:
        yield from (f"{inner}End Site", f"{inner}{{", f"{inner}\tOFFSET {_numbers(nodes.tips[node])}", f"{inner}}}")
    yield f"{indent}}}"


def _numbers(metres: Floats) -> str:
    return " ".join(f"{_UNIT * value + 0.0:.5f}" for value in metres)


def _angles(rotations: Floats) -> Floats:
    """Return the angles of all nodes, (T, 3 N), degrees, without jumps of whole turns between frames."""
    count = len(rotations)
    angles = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_euler(_ORDER, degrees=True).reshape(count, -1)
    unwrapped: Floats = np.unwrap(angles, period=360.0, axis=0)
    return unwrapped
