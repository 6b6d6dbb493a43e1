"""Readers for Acclaim skeleton (ASF) and motion (AMC) files, the format of the CMU motion capture database.

A bone rotates about its head in its local axes. With C the rotation of these axes and M that of the bone's values, both
applied about fixed axes in the order in which the file lists them, the rotation relative to the parent is C M C^-1.
Source: J. Lander, "Working with Motion Capture File Formats", Game Developer, January 1998.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.motion.mocap.line_reader import Line, Reader, quoted
from simharness.world.motion.mocap.skeleton import END, MocapSkeleton, RecordedMotion

RATE = 120.0  # Hz: AMC files do not state the rate; this is the rate of CMU recordings
_TURNS, _SHIFTS = ("rx", "ry", "rz"), ("tx", "ty", "tz")
_ROOT = "root"
_MOST_BONES = 1000


@dataclass
class _Bone:
    """Bone as given in the file, in whose ``line`` its name is."""

    line: Line
    offset: Floats
    frame: Rotation
    dofs: tuple[str, ...]


@dataclass(frozen=True)
class Acclaim:
    """Contents of an ASF file: the skeleton, and how the values of an AMC file rotate it."""

    skeleton: MocapSkeleton
    """Skeleton; its joints are the heads of the bones with their names, and the tips of the last bones."""
    frames: dict[str, Rotation]
    """Local axes by name of the bone."""
    dofs: dict[str, tuple[str, ...]]
    """Kinds of the values by name of the bone, in order: "rx", "ry", "rz", for the root also "tx", "ty", "tz"."""
    origin: Floats
    """Offset added to the position of the root, (3,)."""
    degrees: bool
    """Whether angles are in degrees."""


def read_asf(path: Path) -> Acclaim:
    """Read the skeleton of an ASF file.

    Raises:
        ValueError: not a valid ASF file; the message names file and line.
    """
    reader = Reader(path)
    sections: dict[str, list[Line]] = {}
    section: list[Line] = []
    for line in reader.rest():
        if line.words[0].startswith(":"):
            section = sections[line.words[0].lower()] = []
        elif not sections:
            raise line.error(f"expected a section such as :bonedata, got {quoted(line.words[0])}")
        else:
            section.append(line)
    for missing in (":root", ":bonedata", ":hierarchy"):
        if missing not in sections:
            raise reader.error(f"has no section {missing}; is it an ASF file?")
    degrees = _units(sections.get(":units", []))
    origin, frame, dofs = _root(sections[":root"], degrees)
    bones = _bones(sections[":bonedata"], degrees)
    parents = _hierarchy(sections[":hierarchy"], bones)
    orphan = next((name for name in bones if name not in parents), None)
    if orphan is not None:
        raise bones[orphan].line.error(f"bone {quoted(orphan)} has no parent in :hierarchy")
    return Acclaim(
        skeleton=_skeleton(bones, parents),
        frames={_ROOT: frame} | {name: bone.frame for name, bone in bones.items()},
        dofs={_ROOT: dofs} | {name: bone.dofs for name, bone in bones.items()},
        origin=origin,
        degrees=degrees,
    )


def read_amc(path: Path, acclaim: Acclaim) -> RecordedMotion:
    """Read the motion of an AMC file for a skeleton; its rate is taken to be ``RATE``.

    Raises:
        ValueError: not a valid AMC file, or not one for this skeleton; the message names file and line.
    """
    reader = Reader(path)
    degrees = acclaim.degrees
    while (line := reader.peek()) is not None and line.words[0].startswith(":"):
        degrees = {":DEGREES": True, ":RADIANS": False}.get(line.words[0].upper(), degrees)
        reader.take("")
    moving = {name: dofs for name, dofs in acclaim.dofs.items() if dofs}
    values: dict[str, list[list[float]]] = {name: [] for name in moving}
    frames = first = 0
    while reader.peek() is not None:
        head = reader.take("")
        number = head.words[0] if not frames else str(first + frames)  # an excerpt may start at any number
        if head.words != (number,) or not number.isdecimal():
            expected = f"the number of frame {number}" if frames else "the number of the first frame"
            raise head.error(f"expected {expected} alone, got {quoted(' '.join(head.words))}")
        first = first if frames else int(number[:9])
        frames += 1
        absent = set(moving) - _frame(reader, moving, values)
        if absent:
            raise head.error(f"frame {number} has no values for {', '.join(sorted(absent))}")
    if not frames:
        raise reader.error("has no frames; is it an AMC file?")
    return _recording(path.name, acclaim, values, frames, degrees=degrees)


def _frame(reader: Reader, moving: dict[str, tuple[str, ...]], values: dict[str, list[list[float]]]) -> set[str]:
    """Read the lines of one frame into ``values``; return the names of its bones."""
    seen: set[str] = set()
    while (line := reader.peek()) is not None and not line.words[0].isdigit():
        name = line.words[0]
        if name not in moving:
            raise line.error(f"the skeleton has no bone {quoted(name)} that moves; it has {', '.join(moving)}")
        if name in seen:
            raise line.error(f"{name} appears twice in one frame")
        dofs = moving[name]
        values[name].append(line.numbers(line.words[1:], len(dofs), f"{name} ({' '.join(dofs)})"))
        seen.add(name)
        reader.take("")
    return seen


def _recording(
    file: str, acclaim: Acclaim, values: dict[str, list[list[float]]], frames: int, *, degrees: bool
) -> RecordedMotion:
    skeleton = acclaim.skeleton
    turns = np.zeros((frames, len(skeleton), 4))
    turns[..., 0] = 1.0
    root = np.tile(acclaim.origin, (frames, 1))
    for name, rows in values.items():
        table = np.array(rows, float)
        dofs = acclaim.dofs[name]
        for k, axis in enumerate(_SHIFTS):
            if axis in dofs:
                root[:, k] += table[:, dofs.index(axis)]
        turning = [k for k, dof in enumerate(dofs) if dof in _TURNS]
        if turning:
            order = "".join(dofs[k][1] for k in turning)
            rotation = Rotation.from_euler(order, table[:, turning], degrees=degrees)
            frame = acclaim.frames[name]
            turn = frame * rotation * frame.inv()
            turns[:, skeleton.names.index(name)] = turn.as_quat(scalar_first=True)
    return RecordedMotion(file=file, skeleton=skeleton, rate=RATE, root=root, turns=turns)


def _skeleton(bones: dict[str, _Bone], parents: dict[str, str]) -> MocapSkeleton:
    names, above, offsets = [_ROOT], [-1], [np.zeros(3)]
    for place, name in enumerate(names):  # grows during the iteration: children follow their parents
        tip = bones[name].offset if name in bones else np.zeros(3)
        children = [child for child, parent in parents.items() if parent == name]
        if not children and name in bones:
            children = [name + END]
        names += children
        above += [place] * len(children)
        offsets += [tip] * len(children)
    unconnected = [bone for name, bone in bones.items() if name not in names]
    if unconnected:
        raise unconnected[0].line.error(
            f"bone {quoted(unconnected[0].line.words[1])} is not connected to the root in :hierarchy"
        )
    return MocapSkeleton(tuple(names), np.array(above), np.array(offsets))


def _units(lines: list[Line]) -> bool:
    """Read the section :units; return whether angles are in degrees."""
    degrees = True
    for line in lines:
        if line.words[0].lower() == "angle":
            unit = line.words[1].lower() if len(line.words) > 1 else ""
            if unit not in ("deg", "rad"):
                raise line.error(f"expected angle deg or rad, got {quoted(unit)}")
            degrees = unit == "deg"
    return degrees


def _root(lines: list[Line], degrees: bool) -> tuple[Floats, Rotation, tuple[str, ...]]:
    """Read the section :root; return its position, its axes and the kinds of its values."""
    kinds: tuple[str, ...] = (*_SHIFTS, *_TURNS)
    place, values, axis = np.zeros(3), [0.0, 0.0, 0.0], "xyz"
    for line in lines:
        key, *_ = line.words
        if key.lower() == "order":
            kinds = _kinds(line, (*_SHIFTS, *_TURNS), "an order of TX TY TZ RX RY RZ")
        elif key.lower() == "axis":
            axis = _axis(line, line.words[1:])
        elif key.lower() == "position":
            place = np.array(line.numbers(line.words[1:], 3, "the root's position"))
        elif key.lower() == "orientation":
            values = line.numbers(line.words[1:], 3, "the root's orientation")
        else:
            raise line.error(f"expected order, axis, position or orientation, got {quoted(key)}")
    return place, Rotation.from_euler(axis, values, degrees=degrees), kinds


def _bones(lines: list[Line], degrees: bool) -> dict[str, _Bone]:
    """Read the section :bonedata; return the bones by name."""
    bones: dict[str, _Bone] = {}
    rest = iter(lines)
    for begin in rest:
        if begin.words[0].lower() != "begin":
            raise begin.error(f"expected begin, got {quoted(begin.words[0])}")
        if len(bones) >= _MOST_BONES:
            raise begin.error(f"more than {_MOST_BONES} bones")
        line, given = begin, {}
        for line in rest:
            if (key := line.words[0].lower()) in ("begin", "end"):
                break
            given[key] = line
        if line is begin or line.words[0].lower() != "end":
            raise line.error(f"the bone that begins in line {begin.number} has no end")
        bone = _bone(begin, given, degrees)
        name = bone.line.words[1]
        if name in bones or name == _ROOT:
            raise bone.line.error(f"the bone {quoted(name)} is defined twice")
        bones[name] = bone
    return bones


def _bone(begin: Line, given: dict[str, Line], degrees: bool) -> _Bone:
    """Return the bone that is given by lines by their first word."""
    for missing in ("name", "direction", "length"):
        if missing not in given:
            raise begin.error(f"the bone that begins here has no {missing}")
    name, towards, long = given["name"], given["direction"], given["length"]
    if len(name.words) != 2:
        raise name.error(f"expected one name, got {len(name.words) - 1}")
    direction = np.array(towards.numbers(towards.words[1:], 3, "direction"))
    if np.linalg.norm(direction) < 1e-6:
        raise towards.error("expected a direction, got a vector of length 0")
    direction /= np.linalg.norm(direction)
    (length,) = long.numbers(long.words[1:], 1, "length")
    if length < 0:
        raise long.error(f"expected a length of 0 or more, got {length:g}")
    frame = Rotation.identity()
    if axis := given.get("axis"):
        values = axis.numbers(axis.words[1:4], 3, "axis")
        frame = Rotation.from_euler(_axis(axis, axis.words[4:]), values, degrees=degrees)
    dofs = _kinds(given["dof"], _TURNS, "dof to be some of rx ry rz") if "dof" in given else ()
    return _Bone(name, direction * length, frame, dofs)


def _kinds(line: Line, allowed: tuple[str, ...], expected: str) -> tuple[str, ...]:
    """Return the kinds of values that a line lists, each once."""
    kinds = tuple(word.lower() for word in line.words[1:])
    if set(kinds) - set(allowed) or len(set(kinds)) != len(kinds):
        raise line.error(f"expected {expected}, got {quoted(' '.join(line.words[1:]))}")
    return kinds


def _axis(line: Line, words: tuple[str, ...]) -> str:
    order = words[0].lower() if len(words) == 1 else ""
    if sorted(order) != ["x", "y", "z"]:
        raise line.error(f"expected the order of the axes, such as XYZ, got {quoted(' '.join(words))}")
    return order


def _hierarchy(lines: list[Line], bones: dict[str, _Bone]) -> dict[str, str]:
    """Read the section :hierarchy; return the name of the parent by name of the bone."""
    parents: dict[str, str] = {}
    for line in lines:
        if line.words[0].lower() in ("begin", "end") and len(line.words) == 1:
            continue
        parent, *children = line.words
        for name in line.words:
            if name != _ROOT and name not in bones:
                raise line.error(f":bonedata has no bone {quoted(name)}")
        for child in children:
            if child in parents or child == _ROOT:
                raise line.error(f"{child} already has a parent")
            parents[child] = parent
    return parents
