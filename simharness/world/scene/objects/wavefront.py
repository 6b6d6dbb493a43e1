"""Wavefront OBJ files with their materials (MTL): colours and pictures of faces, as a MuJoCo model.

MuJoCo reads the mesh of an OBJ file, but neither its materials nor groups of faces.
"""

from collections.abc import Iterator
from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.files.input_files import read_bytes
from simharness.world.scene.objects.surfaces import add_surface

_GREY = (0.7, 0.7, 0.7)  # of faces without a material


def read_obj(path: Path) -> mujoco.MjSpec:
    """Return a MuJoCo model with a geom for each material of an OBJ file.

    Raises:
        ValueError: the file has no faces, or one that cannot be read; the message gives the line.
    """
    vertices: list[list[float]] = []
    places: list[list[float]] = []
    groups: dict[str, list[list[tuple[int, int]]]] = {}
    materials: dict[str, tuple[tuple[float, ...], Path | None]] = {}
    current = ""
    for number, (key, values) in _lines(path):
        try:
            if key == "v":
                vertices.append([float(value) for value in values[:3]])
            elif key == "vt":
                places.append([float(value) for value in values[:2]])
            elif key == "f":
                corners = [_corner(value, len(vertices), len(places)) for value in values]
                triangles = [[corners[0], *corners[k : k + 2]] for k in range(1, len(corners) - 1)]
                groups.setdefault(current, []).extend(triangles)
            elif key == "usemtl":
                current = " ".join(values)
            elif key == "mtllib":
                materials |= _materials(path.parent / " ".join(values))
        except (ValueError, IndexError) as error:
            raise ValueError(f"line {number}: {error}") from None
    if not groups:
        raise ValueError("it has no faces (lines that begin with f)")
    spec = mujoco.MjSpec()
    for k, (name, triangles) in enumerate(groups.items()):
        color, picture = materials.get(name, (_GREY, None))
        _add_group(
            spec, f"{k} {name}".strip(), np.array(vertices), np.array(places), np.array(triangles), color, picture
        )
    return spec


def obj_dependencies(path: Path) -> tuple[Path, ...]:
    """Return an OBJ file, its MTL files and their pictures."""
    files = [path]
    for file in files:  # files are added on the way
        if file.is_file() and file.suffix.lower() in (".obj", ".mtl"):
            files += [
                file.parent / (" ".join(values) if key == "mtllib" else values[-1])
                for _, (key, values) in _lines(file)
                if key in ("mtllib", "map_Kd") and values
            ]
    return tuple(dict.fromkeys(files))


def _add_group(
    spec: mujoco.MjSpec,
    name: str,
    vertices: np.ndarray,
    places: np.ndarray,
    triangles: np.ndarray,
    color: tuple[float, ...],
    picture: Path | None,
) -> None:
    """Add the faces of one material: vertices (n, 3), texture coordinates (m, 2), and their indices (k, 3, 2)."""
    corners, faces = np.unique(triangles.reshape(-1, 2), axis=0, return_inverse=True)
    has_places = picture is not None and (corners[:, 1] >= 0).all()
    add_surface(
        spec,
        name,
        vertices[corners[:, 0]],
        faces,
        color,
        places=places[corners[:, 1]] if has_places else None,
        picture=_picture(picture) if picture is not None and has_places else None,
    )


def _picture(path: Path) -> NDArray[np.uint8]:
    """Return a picture, (h, w, 3), blue first."""
    encoded = np.frombuffer(read_bytes(path, what="a texture (map_Kd of the MTL file)"), np.uint8)
    content = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if len(encoded) else None
    if content is None:
        raise ValueError(f"picture {path} cannot be read: expected a PNG or JPEG file (map_Kd of its MTL file)")
    return content.astype(np.uint8, copy=False)


def _lines(path: Path) -> Iterator[tuple[int, tuple[str, list[str]]]]:
    """Yield the numbers of the lines that say something, and their first word and the others."""
    content = read_bytes(path, what="an object as OBJ, with its MTL file").decode("utf-8", errors="replace")
    for number, line in enumerate(content.splitlines(), 1):
        words = line.partition("#")[0].split()
        if words:
            yield number, (words[0], words[1:])


def _corner(text: str, vertices: int, places: int) -> tuple[int, int]:
    """Return the indices of vertex and texture coordinate of a corner, -1 for no coordinate."""
    first, second, *_ = [*text.split("/"), ""]
    indices = [int(first), int(second) if second else 0]
    vertex, place = (
        index - 1 if index > 0 else count + index if index < 0 else -1
        for index, count in zip(indices, (vertices, places), strict=True)
    )
    if not (0 <= vertex < vertices and place < places):
        raise ValueError(f"corner {text!r} refers to a vertex that does not come before it ({vertices} do)")
    return vertex, place


def _materials(path: Path) -> dict[str, tuple[tuple[float, ...], Path | None]]:
    """Return the colour and the picture of the materials of an MTL file, by name."""
    result: dict[str, tuple[tuple[float, ...], Path | None]] = {}
    name = ""
    for _, (key, values) in _lines(path):
        if key == "newmtl":
            name = " ".join(values)
            result[name] = (_GREY, None)
        elif key == "Kd":
            result[name] = (tuple(float(value) for value in values[:3]), result[name][1])
        elif key == "map_Kd":
            result[name] = (result[name][0], path.parent / values[-1])
    return result
