"""Skeletons in TOML files: those that are shipped (``data/``), and those of users.

A file has a name and a table of the joints in the order of the detector::

    name = "feet"

    [joints]
    nose = {}                                                    # a joint of COCO17: parent and sigma are known
    left_big_toe = { parent = "left_ankle", sigma = 0.068 }      # its mirror image is right_big_toe
    face_0 = { parent = "nose", sigma = 0.042, mirror = "face_16" }

``parent = ""`` is the root of the tree. A joint whose name begins with ``left_`` or ``right_`` has that of the other
side as its mirror image, any other joint itself, unless ``mirror`` says otherwise.
"""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from mvpose.files.input_files import parse_toml, read_bytes
from mvpose.skeleton import COCO17, Skeleton

_DATA = Path(__file__).parent / "data"
_WHAT = "a skeleton: a name, and a table of joints { parent, sigma, mirror }"
_KEYS = {"parent", "sigma", "mirror"}

SKELETONS = (
    "body25", "halpe26", "openpose137", "wholebody133",
    "body25b", "body135", "halpe68", "halpe136", "coco18", "mpii15", "blazepose33",
)  # fmt: skip
"""Names of the shipped skeletons."""

_REGISTERED: dict[str, Skeleton] = {}


def register(skeleton: Skeleton) -> None:
    """Make a skeleton known by its name.

    Raises:
        ValueError: a shipped skeleton, or COCO17, has this name.
    """
    if skeleton.name in (*SKELETONS, COCO17.name):
        raise ValueError(f"skeleton {skeleton.name!r}: the name is that of a shipped skeleton; choose another one")
    _REGISTERED[skeleton.name] = skeleton


def known_names() -> tuple[str, ...]:
    """Return the names of the shipped and registered skeletons."""
    return (*SKELETONS, *_REGISTERED)


def skeleton_by_name(name: str) -> Skeleton:
    """Return a shipped or registered skeleton.

    Raises:
        ValueError: an unknown name.
    """
    return _REGISTERED[name] if name in _REGISTERED else _shipped(name)


@cache
def _shipped(name: str) -> Skeleton:
    if name not in SKELETONS:
        raise ValueError(
            f"unknown skeleton {name!r}; expected one of {', '.join(SKELETONS)}, or a file for read_skeleton"
        )
    return read_skeleton(_DATA / f"{name}.toml")


def read_skeleton(path: str | Path) -> Skeleton:
    """Read a skeleton from a TOML file.

    Raises:
        ValueError: the file is missing, is no TOML, or does not describe a skeleton; the message names file and joint.
    """
    path = Path(path)
    try:
        content = parse_toml(read_bytes(path, what=_WHAT).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: no TOML: {error}; expected {_WHAT}") from None
    name, joints = content.get("name"), content.get("joints")
    if not isinstance(name, str) or not isinstance(joints, dict) or not joints or set(content) != {"name", "joints"}:
        raise ValueError(f"{path}: expected {_WHAT}; got {', '.join(content) or 'nothing'}")
    entries = {joint: _entry(path, joint, given) for joint, given in joints.items()}
    rows = {joint: row for row, joint in enumerate(entries)}

    def row(joint: str, key: str, wanted: str) -> int:
        if wanted not in rows:
            raise ValueError(f"{path}: joints.{joint}: {key} {wanted!r} is no joint of the file")
        return rows[wanted]

    try:
        return Skeleton(
            name,
            tuple(entries),
            tuple(row(joint, "parent", each["parent"]) if each["parent"] else -1 for joint, each in entries.items()),
            tuple(row(joint, "mirror", each["mirror"]) for joint, each in entries.items()),
            tuple(each["sigma"] for each in entries.values()),
        )
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None


def _entry(path: Path, joint: str, given: Any) -> dict[str, Any]:
    """Return parent, sigma and mirror image of a joint; what the file leaves out is known or follows from the name."""
    if not isinstance(given, dict) or set(given) - _KEYS:
        raise ValueError(f"{path}: joints.{joint}: expected a table with parent, sigma, mirror, got {given!r:.60}")
    known: dict[str, Any] = {"mirror": _other_side(joint)}
    if joint in COCO17.joints:
        number = COCO17.index(joint)
        parent = COCO17.parents[number]
        known |= {"parent": COCO17.joints[parent] if parent >= 0 else "", "sigma": COCO17.sigmas[number]}
    entry = known | given
    for key in sorted(_KEYS - set(entry)):
        raise ValueError(f"{path}: joints.{joint}: needs {key}, because it is no joint of COCO17")
    sigma = entry["sigma"]
    if isinstance(sigma, bool) or not isinstance(sigma, int | float):
        raise ValueError(f"{path}: joints.{joint}: sigma must be a number, got {sigma!r:.60}")
    for key in ("parent", "mirror"):
        if not isinstance(entry[key], str):
            raise ValueError(f"{path}: joints.{joint}: {key} must be the name of a joint, got {entry[key]!r:.60}")
    return entry | {"sigma": float(sigma)}


def _other_side(joint: str) -> str:
    side, _, part = joint.partition("_")
    other = {"left": "right", "right": "left"}.get(side)
    return f"{other}_{part}" if other and part else joint
