"""EasyMocap calibrations: ``intri.yml`` and ``extri.yml`` in one folder.

For each camera NAME of the list ``names``: ``K_NAME`` (3x3), ``dist_NAME`` (k1 k2 p1 p2 k3) and, in newer files,
``H_NAME`` and ``W_NAME``; ``R_NAME`` (Rodrigues vector), ``Rot_NAME`` (3x3, the same rotation) and ``T_NAME``:
``x_cam = Rot X + T``, metres, z up.
"""

from pathlib import Path
from typing import Any

from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.files.message_text import prefixed
from mvpose.formats.calibration.calibration_file import CalibrationFormat
from mvpose.formats.calibration.camera_entry import camera, check_names, image_size
from mvpose.formats.calibration.file_storage import matrix, missing_half, read_beside, write_storage

_WHAT = "EasyMocap's intri.yml and extri.yml: a list names, and for each name K_, dist_, R_ or Rot_, and T_"


def read_calibration(path: str | Path, *, size: tuple[int, int]) -> Rig:
    """Read an EasyMocap calibration.

    Args:
        path: either of the two files; the other one is in the same folder.
        size: width and height of the images in pixels, for files that do not hold them.

    Returns:
        The cameras in the order of ``names``.

    Raises:
        ValueError: a file does not exist or cannot be read, a camera lacks a value or has one of a wrong shape, or the
            cameras make no rig.
    """
    path = Path(path)
    values = read_beside(path, what=_WHAT)
    names = values.get("names")
    if not isinstance(names, list):
        raise ValueError(f"{path}: no list 'names'; expected {_WHAT}")
    with prefixed(path):
        return Rig([_camera(str(name), values, size, path) for name in names])


def write_calibration(path: str | Path, rig: Rig) -> None:
    """Write ``intri.yml`` and ``extri.yml`` of a rig into the folder ``path``.

    Raises:
        ValueError: a camera name with characters other than letters, digits, spaces, - and _, or names that are not
            distinct.
    """
    check_names(rig)
    folder = Path(path)
    names = [each.name for each in rig]
    inner: dict[str, Any] = {"names": names}
    outer: dict[str, Any] = {"names": names}
    for each in rig:
        inner |= {f"K_{each.name}": each.K, f"dist_{each.name}": matrix(each.distortion)}
        inner |= {f"W_{each.name}": each.size[0], f"H_{each.name}": each.size[1]}
        outer |= {
            f"R_{each.name}": matrix(Rotation.from_matrix(each.R).as_rotvec()).T,
            f"Rot_{each.name}": each.R,
            f"T_{each.name}": matrix(each.t).T,
        }
    write_storage(folder / "intri.yml", inner)
    write_storage(folder / "extri.yml", outer)


FORMAT = CalibrationFormat(
    "EasyMocap (YAML)",
    lambda file: isinstance((file.storage or {}).get("names"), list),
    lambda path, *, size, only: read_calibration(path, size=size),
    lambda path, rig: write_calibration(path.parent, rig),
)


def _camera(name: str, values: dict[str, Any], size: tuple[int, int], path: Path) -> Camera:
    turn = next((values[key] for key in (f"Rot_{name}", f"R_{name}") if key in values), None)
    needed = {
        f"K_{name}": values.get(f"K_{name}"),
        f"R_{name} or Rot_{name}": turn,
        f"T_{name}": values.get(f"T_{name}"),
    }
    missing = [key for key, value in needed.items() if value is None]
    if missing:
        raise ValueError(f"camera {name!r} lacks {', '.join(missing)}, in this file and in {missing_half(path)}")
    return camera(
        name,
        K=values[f"K_{name}"],
        R=turn,
        t=values[f"T_{name}"],
        terms=values.get(f"dist_{name}", []),
        size=image_size(
            (values.get(f"W_{name}", size[0]), values.get(f"H_{name}", size[1])), f"camera {name!r}: W and H"
        ),
    )
