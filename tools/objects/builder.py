"""Builder of an object from parts, and its MJCF file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.materials import Material
from simharness.world.scene.objects.shapes import lathe, loft

_CORNERS = np.linspace(0, np.pi / 2, 3), np.linspace(0, np.pi / 2, 4)  # directions of a small and a large round corner
_PAINTED = 0.74  # albedo from which wood counts as painted
_SMALL = 0.04  # metres: radius of a small round corner
_MOST_COLORS = 8  # colours of one part that are kept exactly
_COLOR_STEP = 1 / 16  # of parts with more colours
_LEAST_FACES = 6  # of one colour in a part with many
_FLAT = 1e-4  # metres: thinner meshes have no convex hull


@dataclass(frozen=True)
class Part:
    """Part of an object: a geom of MuJoCo with its pose.

    Attributes:
        kind: "box", "cylinder" or "mesh".
        size: half sides of a box; radius and half length of a cylinder; empty for a mesh.
        position: position, (3,), metres.
        turn: orientation.
        color: albedo, sRGB.
        material: material, or print of a mesh with ``uv``; "plain" for none.
        mesh: vertices (n, 3) and faces (k, 3) in the frame of the part.
        uv: texture coordinates of the vertices, (n, 2), of a print.
    """

    kind: str
    size: tuple[float, ...]
    position: Floats
    turn: Rotation
    color: Floats
    material: str = "plain"
    mesh: tuple[Floats, np.ndarray] | None = None
    uv: Floats | None = None

    def moved(self, place: Sequence[float], yaw: float) -> Part:
        """Return the part turned by ``yaw`` about the z axis, then moved."""
        turn = Rotation.from_euler("z", yaw)
        return replace(self, position=turn.apply(self.position) + place, turn=turn * self.turn)


class ObjectBuilder:
    """Builder of an object, which stands on z = 0 with its front towards +x and its back at -x.

    Attributes:
        parts: its parts.
        figure: COCO-17 joints of a decoy, (17, 3), metres.
        origin: point that is placed, if not the middle of the floor below it: of what hangs, where the wall ends.
        size: nominal depth, width and height, metres, if they are not the extents: those of the seat of a chair.
        picture: picture of the print "picture", (h, w, 3) uint8.
    """

    def __init__(self) -> None:
        self.parts: list[Part] = []
        self.figure: Floats | None = None
        self.origin: tuple[float, float, float] | None = None
        self.size: tuple[float, float, float] | None = None
        self.picture: np.ndarray | None = None

    def box(
        self,
        center: Sequence[float],
        size: Sequence[float],
        color: ArrayLike,
        material: Material | Literal["mirror"] = "plain",
        *,
        yaw: float = 0.0,
        tilt: float = 0.0,
    ) -> Self:
        """Add a box of ``size`` x, y, z in metres; ``yaw`` turns it about its own vertical axis.

        ``tilt`` leans it backwards about its y axis, radians.
        """
        half, turn = tuple(float(v) / 2 for v in size), Rotation.from_euler("ZY", [yaw, tilt])
        return self._add("box", half, np.asarray(center, float), turn, color, material)

    def block(
        self, low: Sequence[float], high: Sequence[float], color: ArrayLike, material: Material = "plain"
    ) -> Self:
        """Add a box from its lowest to its highest corner, metres."""
        a, b = np.asarray(low, float), np.asarray(high, float)
        return self.box(((a + b) / 2).tolist(), (b - a).tolist(), color, material)

    def bar(
        self,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        color: ArrayLike,
        material: Material = "plain",
        *,
        sides: int = 8,
    ) -> Self:
        """Add a round bar from one point to another, metres. The reader of the file decides on the number of sides."""
        del sides
        a, b = np.asarray(start, float), np.asarray(end, float)
        length = float(np.linalg.norm(b - a))
        turn, _ = Rotation.align_vectors([(b - a) / length], [[0.0, 0.0, 1.0]])
        return self._add("cylinder", (float(radius), length / 2), (a + b) / 2, turn, color, material)

    def turned(
        self,
        profile: ArrayLike,
        color: ArrayLike,
        material: Material = "plain",
        *,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        sides: int = 14,
    ) -> Self:
        """Add a body of revolution: see :func:`simharness.world.scene.objects.shapes.lathe`."""
        return self.part(lathe(profile, color, sides=sides), material, center=at)

    def cushion(
        self,
        center: Sequence[float],
        size: Sequence[float],
        color: ArrayLike,
        material: Material = "fabric",
        *,
        radius: float = 0.05,
        yaw: float = 0.0,
        tilt: float = 0.0,
    ) -> Self:
        """Add a box with round edges, such as a cushion; ``tilt`` leans it backwards about its y axis, radians."""
        mesh = _rounded(np.asarray(size, float), min(radius, 0.49 * min(size)), color)
        return self.part(mesh, material, center=center, turn=Rotation.from_euler("ZY", [yaw, tilt]))

    def print(self, name: str, corners: ArrayLike) -> Self:
        """Add a print on a flat sheet with corners (4, 3): lower left, lower right, upper right, upper left."""
        points = np.asarray(corners, float)
        center = points.mean(axis=0)
        uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        mesh = (points - center, faces)
        self.parts.append(Part("mesh", (), center, Rotation.identity(), np.ones(3), name, mesh, uv))
        return self

    def front_print(self, name: str, x: float, y: float, z: float, size: tuple[float, float]) -> Self:
        """Add a print of width and height ``size`` around (x, y, z) that faces +x."""
        w, h = size[0] / 2, size[1] / 2
        return self.print(name, [(x, y - w, z - h), (x, y + w, z - h), (x, y + w, z + h), (x, y - w, z + h)])

    def part(
        self,
        mesh: Mesh,
        material: Material = "plain",
        *,
        center: Sequence[float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        turn: Rotation | None = None,
    ) -> Self:
        """Add a mesh of one material, a part for each of its colours, turned and moved to ``center``."""
        turn = Rotation.from_euler("z", yaw) if turn is None else turn
        for color, faces in _by_color(mesh):
            self._add("mesh", (), np.asarray(center, float), turn, color, material, _compact(mesh.vertices, faces))
        return self

    def group(self, other: ObjectBuilder, place: Sequence[float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> Self:
        """Add all parts of another builder, turned by ``yaw`` and moved to ``place``."""
        self.parts += [part.moved(place, yaw) for part in other.parts]
        return self

    def _add(
        self,
        kind: str,
        size: tuple[float, ...],
        position: Floats,
        turn: Rotation,
        color: ArrayLike,
        material: str,
        mesh: tuple[Floats, np.ndarray] | None = None,
    ) -> Self:
        """Add a part. Wood that is painted white shows no grain."""
        albedo: Floats = np.clip(np.asarray(color, float), 0, 1)
        material = "plain" if material == "wood" and albedo.min() > _PAINTED else material
        self.parts.append(Part(kind, size, position, turn, albedo, material, mesh))
        return self

    def mjcf(self, name: str, stem: str) -> str:
        """Return the MJCF file ``stem``.xml of the object; what would sink into the floor lies flat on it."""
        root = ElementTree.Element("mujoco", model=name)
        default = ElementTree.SubElement(root, "default")
        ElementTree.SubElement(default, "mesh", inertia="shell")
        sheet = ElementTree.SubElement(default, "default", {"class": "sheet"})
        ElementTree.SubElement(sheet, "geom", type="mesh", contype="0", conaffinity="0")
        asset, world = ElementTree.SubElement(root, "asset"), ElementTree.SubElement(root, "worldbody")
        for material in sorted({part.material for part in self.parts} - {"plain"}):
            if material == "mirror":
                ElementTree.SubElement(asset, "material", name=material, reflectance="1")
                continue
            is_print = any(part.uv is not None for part in self.parts if part.material == material)
            kind = {
                "type": "2d" if is_print else "cube",
                "file": f"textures/{stem if material == 'picture' else material}.png",
            }
            ElementTree.SubElement(asset, "texture", {"name": material, **kind})
            ElementTree.SubElement(asset, "material", name=material, texture=material)
        meshes: dict[str, str] = {}
        for part in self.parts:
            _write_geom(_above_floor(part), asset, world, meshes)
        if not len(asset):
            root.remove(asset)
        if self.size is not None:
            custom = ElementTree.SubElement(root, "custom")
            ElementTree.SubElement(custom, "numeric", name="size", data=_text(self.size))
        sites = [] if self.figure is None else list(zip(COCO17.joints, self.figure, strict=True))
        for site, place in [*sites, *([] if self.origin is None else [("origin", np.array(self.origin))])]:
            ElementTree.SubElement(world, "site", name=site, pos=_text(place))
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode") + "\n"


def _write_geom(part: Part, asset: Any, world: Any, meshes: dict[str, str]) -> None:
    attributes: dict[str, str] = {}
    if part.mesh is None:
        attributes |= {"type": part.kind, "size": _text(part.size)}
    else:
        vertices, faces = part.mesh
        data = {"vertex": _text(vertices), "face": " ".join(map(str, np.ravel(faces).tolist()))}
        if part.uv is not None:
            data["texcoord"] = _text(part.uv)
        key = str(data)
        if key not in meshes:
            meshes[key] = f"mesh{len(meshes)}"
            ElementTree.SubElement(asset, "mesh", {"name": meshes[key], **data})
        is_flat = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)[-1] < _FLAT
        attributes |= {"class": "sheet"} if is_flat else {"type": "mesh"}
        attributes["mesh"] = meshes[key]
    attributes["pos"] = _text(part.position)
    w = part.turn.as_quat(canonical=True)[[3, 0, 1, 2]]
    if abs(w[0] - 1) > 1e-9:
        attributes["quat"] = _text(w, 5)
    if part.material != "plain":
        attributes["material"] = part.material
    attributes["rgba"] = _text([*part.color, 1.0], 3)
    ElementTree.SubElement(world, "geom", attributes)


def _above_floor(part: Part) -> Part:
    """Return a part whose mesh has no vertex below z = 0."""
    if part.mesh is None:
        return part
    points = part.turn.apply(part.mesh[0]) + part.position
    if points[:, 2].min() >= -1e-4:
        return part
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    center = points.mean(axis=0)
    return replace(part, position=center, turn=Rotation.identity(), mesh=(points - center, part.mesh[1]))


def _by_color(mesh: Mesh) -> Iterator[tuple[Floats, np.ndarray]]:
    """Yield the colours of a mesh and the faces of each; many colours are rounded, and rare ones join the nearest."""
    colors = mesh.colors.astype(float)
    keys, which = np.unique(colors.round(3), axis=0, return_inverse=True)
    if len(keys) > _MOST_COLORS:
        keys, which = np.unique((colors / _COLOR_STEP).round(), axis=0, return_inverse=True)
    which = which.ravel()
    large = np.flatnonzero(np.bincount(which) >= min(_LEAST_FACES, len(which)))
    which = large[np.linalg.norm(keys[which][:, None] - keys[large], axis=2).argmin(axis=1)]
    for k in large:
        yield colors[which == k].mean(axis=0), mesh.faces[which == k]


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[Floats, np.ndarray]:
    """Return the vertices that faces use, each position once, and the faces; faces without an area are left out."""
    used = vertices[faces].reshape(-1, 3).astype(float).round(4)
    points, index = np.unique(used, axis=0, return_inverse=True)
    kept = index.reshape(-1, 3)
    kept = kept[(kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 0] != kept[:, 2])]
    return points, kept


def _rounded(size: Floats, radius: float, color: ArrayLike) -> Mesh:
    """Return a box around the origin with round edges."""
    half = size / 2
    inner = half - radius
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    corner = _CORNERS[int(radius > _SMALL)]
    turns = np.concatenate([k * np.pi / 2 + corner for k in range(4)])
    outline = np.repeat(corners, len(corner), axis=0) * inner[:2]
    round_ = np.column_stack([np.cos(turns), np.sin(turns)])
    rings = []
    for sense in (-1.0, 1.0):
        for angle in corner if sense > 0 else -corner[::-1]:
            ring = outline + radius * np.cos(angle) * round_
            rings.append(np.column_stack([ring, np.full(len(ring), sense * inner[2] + radius * np.sin(angle))]))
    tip = np.zeros((len(outline), 3))
    ends = tip - [0, 0, half[2]], tip + [0, 0, half[2]]
    return loft(np.stack([ends[0], *rings, ends[1]]), np.asarray(color, float))


def _text(values: ArrayLike, decimals: int = 4) -> str:
    rounded = np.round(np.ravel(values), decimals) + 0.0  # no negative zero
    return " ".join(f"{value:.{decimals}f}".rstrip("0").rstrip(".") for value in rounded)
