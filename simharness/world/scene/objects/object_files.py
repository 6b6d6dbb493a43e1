"""Objects from files: MJCF with geoms, meshes and textures, OBJ with its MTL, or glTF; of users, and shipped.

What pictures show is what MuJoCo shows of the file: its visible geoms (groups 0 to 2) at their initial positions, with
their colours, materials and textures. The same geoms stop rays and people. A site for each of the COCO-17 joints
(``<site name="nose"/>`` and so on) makes the object a decoy, and a box whose material has a reflectance of 0.5 or more
is a mirror that looks to +x. The object is moved so that its lowest point stands on the floor and its bounding box is
centred on the origin; a site ``origin`` is moved to the origin instead: of an object that hangs, it is where wall and
floor meet. Lengths are metres, z is up and the front is +x.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mvpose.arrays import Floats
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import one_line
from mvpose.skeleton import COCO17
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.scene.objects.geoms import Box, Surface
from simharness.world.scene.objects.gltf_objects import gltf_dependencies, read_gltf
from simharness.world.scene.objects.materials import Sheet
from simharness.world.scene.objects.shapes import bar_mesh, box_mesh, joined, lathe
from simharness.world.scene.objects.solids import ObjectModel
from simharness.world.scene.objects.wavefront import obj_dependencies, read_obj

ASSETS = Path(__file__).parents[3] / "assets" / "objects"
"""Folder of the objects that simharness ships."""

_LARGEST, _SMALLEST = 30.0, 0.01  # metres: limits of the largest extent of an object
_SHOWN_GROUPS = 3  # groups of geoms that MuJoCo's viewer shows from the start
_CREASE = np.cos(np.radians(40))  # faces that bend more do not share normals
_ROUND = ((0.02, 8), (0.06, 12), (0.15, 18), (np.inf, 28))  # sides of a round bar up to a radius in metres
_DEFAULT_COLOR = (0.5, 0.5, 0.5, 1.0)  # of geoms in MuJoCo; a material replaces it
_KEPT = 64  # files, at most about 1 MB each
_FLAT = 1e-4  # metres: a thinner part is a sheet
_REFLECTS = 0.5  # reflectance from which a material is a mirror


_OTHER_FILES = {".obj": (read_obj, obj_dependencies)} | dict.fromkeys((".glb", ".gltf"), (read_gltf, gltf_dependencies))
"""Readers of files that MuJoCo does not read, and of the names of the files that belong to them."""


@dataclass(frozen=True)
class _Part:
    """Part of one colour: a mesh in the frame of the object, and its texture by name, "" for none.

    Attributes:
        mesh: mesh, in the frame of its geom.
        place, turn: position (3,) and rotation (3, 3) of the geom.
        texture: name of its texture.
        uv: texture coordinates of the corners of the faces, (k, 3, 2); None where the texture is projected on them.
        kind: its type in MuJoCo.
        touches: whether people can touch it.
    """

    mesh: Mesh
    place: Floats
    turn: Floats
    texture: str = ""
    uv: NDArray[np.float32] | None = None
    kind: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_MESH
    touches: bool = True

    @property
    def vertices(self) -> Floats:
        """Positions of its vertices in the file, (n, 3), metres."""
        return self.mesh.vertices @ self.turn.T + self.place

    def geom(self, points: Floats) -> Box | Surface:
        """Return the geom of the part with its vertices at ``points`` (n, 3).

        Round geoms are the meshes that pictures show of them, so that rays and pictures agree.
        """
        if self.kind == mujoco.mjtGeom.mjGEOM_BOX and self.touches and np.allclose(self.turn, np.eye(3), atol=1e-6):
            return Box.around(points)
        is_flat = np.ptp(self.mesh.vertices, axis=0).min() < _FLAT  # without a hull for contacts
        return Surface(points, self.mesh.faces, touches=self.touches and not is_flat)


@dataclass(frozen=True)
class ObjectFile:
    """Object read from a file."""

    path: Path
    """The file."""
    parts: tuple[_Part, ...]
    """Its parts."""
    textures: Mapping[str, NDArray[np.uint8]]
    """Its pictures by name, (h, w, 3) uint8; where it is shown with a sheet, those of the same names replace them."""
    offset: Floats
    """Vector that moves the object to its place on the floor, (3,), metres."""
    size: Floats
    """Depth, width and height, (3,), metres: the numbers ``size`` of the file, or its extents."""
    figure: Floats | None
    """COCO-17 joints, (17, 3), metres, of a decoy."""
    mirror: Mirror | None
    """Glass of a mirror."""

    def mesh(self, sheet: Sheet | None = None) -> Mesh:
        """Return the mesh for pictures.

        Args:
            sheet: materials and prints of the scene, which shipped objects use by name; pictures of the file itself
                are put on a sheet of their own.
        """
        names = sorted({part.texture for part in self.parts} - {""})
        if names and sheet is None:
            sheet = Sheet.pack({"plain": np.ones((8, 8, 3)), **{name: self.textures[name] / 255 for name in names}})
        meshes, uv = [], []
        for number, part in enumerate(self.parts):
            meshes.append(part.mesh.moved(part.vertices + self.offset))
            if sheet is not None:
                name = part.texture or "plain"
                place = None if part.uv is None else _within(part.uv)
                uv.append(sheet.projected(part.mesh, name, number) if place is None else sheet.uv(name, place))
        mesh = joined(*meshes)
        return mesh if sheet is None else replace(mesh, texture=sheet.texture, uv=np.concatenate(uv))

    def fitting(self, sheet: Sheet, corners: tuple[ArrayLike, ArrayLike], text: str = "") -> Mesh:
        """Return the mesh stretched from its own size to a box between two corners (3,), metres.

        Args:
            sheet: materials and prints of the scene.
            corners: lowest and highest corner; its own depth fills 1 metre.
            text: print that replaces its own.
        """
        parts = (replace(each, texture=text) if text and each.uv is not None else each for each in self.parts)
        mesh, low = replace(self, parts=tuple(parts)).mesh(sheet), np.asarray(corners[0], float)
        return mesh.moved(mesh.vertices * ((np.asarray(corners[1], float) - low) / self.size) + low)

    def model(self, sheet: Sheet | None = None, *, scale: ArrayLike = (1.0, 1.0, 1.0)) -> ObjectModel:
        """Return the model to be placed, stretched along x, y and z by ``scale`` (3,); see :meth:`mesh`."""
        stretch: Floats = np.asarray(scale, float)
        points: list[Floats] = [(part.vertices + self.offset) * stretch for part in self.parts]
        mesh = self.mesh(sheet).moved(np.concatenate(points))
        geoms = (part.geom(each) for part, each in zip(self.parts, points, strict=True))
        figure = None if self.figure is None else self.figure * stretch
        return ObjectModel(mesh, tuple(geoms), figure, None if self.mirror is None else self.mirror.stretched(scale))


def variants(name: str) -> tuple[Path, ...]:
    """Return the files of a shipped object: ``NAME.xml``, and ``NAME.2.xml`` and so on."""
    first = ASSETS / f"{name}.xml"
    return (first, *sorted(ASSETS.glob(f"{name}.[0-9]*.xml")))


def draw_variant(rng: np.random.Generator, name: str) -> ObjectFile:
    """Draw a variant of a shipped object."""
    files = variants(name)
    return load_shipped(files[rng.integers(len(files))])


def draw_shipped(rng: np.random.Generator, name: str, stretch: float, *, height: float | None = None) -> ObjectModel:
    """Draw a variant of a shipped object, stretched in width and height by up to a share, or to a height in metres."""
    file, (wide, tall) = draw_variant(rng, name), 1 + stretch * rng.uniform(-1, 1, 2)
    return file.model(scale=(wide, wide, tall if height is None else height / file.size[2]))


def object_dependencies(path: Path) -> tuple[Path, ...]:
    """Return the files of an object: the file itself, and meshes, textures and materials that it names."""
    if path.suffix.lower() in _OTHER_FILES:
        return _OTHER_FILES[path.suffix.lower()][1](path)
    if not path.is_file():
        return (path,)
    return tuple(Path(file) for file in sorted(mujoco.mju_getXMLDependencies(str(path))))


def load_object(path: Path) -> ObjectFile:
    """Return the object of a file, MJCF (.xml), OBJ (.obj) or glTF (.glb, .gltf).

    Raises:
        ValueError: the file does not exist, cannot be read, shows nothing, or is too large or too small; the message
            names the file and what to change.
    """
    read_bytes(path, what="an object as MJCF (.xml), OBJ (.obj) or glTF (.glb, .gltf)")
    try:
        read, _ = _OTHER_FILES.get(path.suffix.lower(), (_read_mjcf, None))
        spec = read(path)
        result = _object_file(path, spec)
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read as an object: {one_line(str(error))}") from None
    corners = result.mesh().vertices
    extent = np.ptp(corners, axis=0)
    if not _SMALLEST <= extent.max() <= _LARGEST:
        size = " x ".join(f"{side:.3g}" for side in extent)
        raise ValueError(
            f"{path}: the object is {size} m large, expected {_SMALLEST:g} to {_LARGEST:g} m: lengths in files of "
            "objects are metres, so scale the file, for example by 0.001 if it is in millimetres"
        )
    return result


load_shipped = lru_cache(maxsize=_KEPT)(load_object)
"""Loading of a shipped object, read once in a process."""


def _read_mjcf(path: Path) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(path))


def _object_file(path: Path, spec: mujoco.MjSpec) -> ObjectFile:
    """Return the object of a MuJoCo model.

    Raises:
        ValueError: the model cannot be compiled, or shows nothing.
    """
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts = []
    for geom in range(model.ngeom):
        color = _color(model, geom)
        if model.geom_group[geom] >= _SHOWN_GROUPS or color[3] == 0.0:
            continue
        mesh, uv = _shape(model, geom, np.clip(color[:3], 0, 1))
        turn = data.geom_xmat[geom].reshape(3, 3).copy()
        texture = _texture(model, geom)
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        touches = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        place, uv = data.geom_xpos[geom].copy(), uv if texture else None
        parts.append(_Part(mesh, place, turn, texture, uv, kind, touches))
    if not parts:
        raise ValueError("it has no geom that is visible (group 0 to 2, alpha above 0): add a geom")
    vertices = np.concatenate([part.vertices for part in parts])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    pictures = {model.texture(k).name: _picture(model, k) for k in range(model.ntex)}
    sites = {model.site(k).name: data.site_xpos[k] for k in range(model.nsite)}
    offset = -sites["origin"] if "origin" in sites else np.array([*(-(low + high) / 2)[:2], -low[2]])
    figure = [sites[name] + offset for name in COCO17.joints] if set(COCO17.joints) <= set(sites) else None
    size = next((numbers.data for numbers in spec.numerics if numbers.name == "size"), high - low)
    shown = None if figure is None else np.array(figure)
    return ObjectFile(path, tuple(parts), pictures, offset, np.array(size), shown, _mirror(model, data, offset))


def _mirror(model: mujoco.MjModel, data: mujoco.MjData, offset: Floats) -> Mirror | None:
    """Return the glass on the front of the first box that reflects, if there is one."""
    for geom in np.flatnonzero((model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) & (model.geom_matid >= 0)):
        if model.mat_reflectance[model.geom_matid[geom]] >= _REFLECTS:
            depth, width, height = model.geom_size[geom].tolist()
            x, y, z = (data.geom_xpos[geom] + offset + [depth, 0.0, 0.0]).tolist()
            return Mirror((x, y, z), (1.0, 0.0, 0.0), (width, height))
    return None


def _color(model: mujoco.MjModel, geom: int) -> Floats:
    """Return the colour of a geom, (4,): that of its material, unless it has one itself."""
    color, material = np.array(model.geom_rgba[geom], float), int(model.geom_matid[geom])
    return color if material < 0 or tuple(color) != _DEFAULT_COLOR else np.array(model.mat_rgba[material], float)


def _texture(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of the texture of a geom, "" for none."""
    material = int(model.geom_matid[geom])
    texture = -1 if material < 0 else int(model.mat_texid[material][mujoco.mjtTextureRole.mjTEXROLE_RGB])
    return "" if texture < 0 else str(model.texture(texture).name)


def _picture(model: mujoco.MjModel, texture: int) -> NDArray[np.uint8]:
    """Return a texture, (h, w, 3) uint8; of a cube its first side."""
    height, width, channels = (int(v[texture]) for v in (model.tex_height, model.tex_width, model.tex_nchannel))
    first = int(model.tex_adr[texture])
    picture = model.tex_data[first : first + height * width * channels].reshape(height, width, channels)
    picture = picture[:width] if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE else picture
    return np.array(np.repeat(picture, 3, axis=2) if channels == 1 else picture[..., :3], np.uint8)


def _shape(model: mujoco.MjModel, geom: int, color: Floats) -> tuple[Mesh, NDArray[np.float32] | None]:
    """Return the mesh of a geom in its frame, and the texture coordinates that it has.

    Raises:
        ValueError: a geom that is no surface of finite size.
    """
    kind, (a, b, c) = mujoco.mjtGeom(int(model.geom_type[geom])), (float(v) for v in model.geom_size[geom])
    sides = next(n for limit, n in _ROUND if a <= limit)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]), color)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return box_mesh([Box((0.0, 0.0, 0.0), (a, b, c))], color[None]), None
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return bar_mesh((0.0, 0.0, -b), (0.0, 0.0, b), a, color, sides=sides), None
    round_ = {"mjGEOM_SPHERE": (a, a, a, 0.0), "mjGEOM_CAPSULE": (a, a, a, b), "mjGEOM_ELLIPSOID": (a, b, c, 0.0)}
    if kind.name not in round_:
        raise ValueError(
            f"geom {model.geom(geom).name!r} is of type {kind.name.removeprefix('mjGEOM_').lower()}, expected box, "
            "sphere, capsule, ellipsoid, cylinder or mesh"
        )
    x, y, z, half = round_[kind.name]
    angle = np.linspace(-np.pi / 2, np.pi / 2, 13)
    height = np.sin(angle) * z + np.where(angle < 0, -half, half)
    profile = np.column_stack([np.where(np.abs(angle) < 1.57, np.cos(angle), 0.0) * y, height])
    return lathe(profile, color, sides=max(sides, 16), squash=x / y), None


def _mesh(model: mujoco.MjModel, mesh: int, color: Floats) -> tuple[Mesh, NDArray[np.float32] | None]:
    """Return a mesh of a model with sharp edges where faces bend, and its texture coordinates."""
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    faces = model.mesh_face[first : first + count]
    uv = None
    if model.mesh_texcoordnum[mesh]:
        points = model.mesh_texcoord[model.mesh_texcoordadr[mesh] :][: model.mesh_texcoordnum[mesh]]
        uv = np.array(points[model.mesh_facetexcoord[first : first + count]], np.float32)
    points, corners = _creased(np.array(vertices, float), np.array(faces))
    colors = np.tile(color.astype(np.float32), (count, 1))
    return Mesh(points.astype(np.float32), corners.astype(np.int32), colors, smooth=True), uv


def _creased(vertices: Floats, faces: NDArray[np.int32]) -> tuple[Floats, NDArray[np.int64]]:
    """Return vertices and faces of a mesh whose vertices are separate where two faces meet at a sharp edge."""
    vertices, welded = np.unique(vertices.round(6), axis=0, return_inverse=True)
    corners = welded.ravel()[faces]
    a, b, c = np.moveaxis(vertices[corners], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    corner = np.arange(3 * len(faces)).reshape(-1, 3)
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    edge = np.minimum(starts, ends).astype(np.int64) * len(vertices) + np.maximum(starts, ends)
    order = np.argsort(edge, kind="stable")
    one, two = order[:-1], order[1:]
    met = (edge[one] == edge[two]) & ((normals[one // 3] * normals[two // 3]).sum(axis=1) >= _CREASE)
    one, two = one[met], two[met]
    first, last = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    same = starts[one] == starts[two]
    links = [(first[one], np.where(same, first[two], last[two])), (last[one], np.where(same, last[two], first[two]))]
    rows, columns = (np.concatenate(each) for each in zip(*links, strict=True))
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(corner.size, corner.size))
    count, which = connected_components(graph, directed=False)
    points = np.empty((count, 3))
    points[which] = vertices[corners.ravel()]
    return points, which.reshape(-1, 3)


def _within(uv: NDArray[np.float32]) -> Floats:
    """Return texture coordinates with each face moved by whole periods into 0..1, as far as it fits there."""
    periods = np.floor(uv.min(axis=1, keepdims=True) + 1e-4)
    return np.clip(uv - periods, 0.0, 1.0).astype(float)
