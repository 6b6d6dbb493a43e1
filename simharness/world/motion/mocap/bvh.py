"""Reader for Biovision BVH files.

The channels of a joint are rotations about its local axes in the listed order: v' = R1 R2 R3 v. The position channels
of the root replace its offset; those of other joints are ignored, because bones do not stretch.
Source: M. Meredith and S. Maddock, "Motion Capture File Formats Explained", University of Sheffield, 2001.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from simharness.world.motion.mocap.line_reader import Line, Reader, quoted
from simharness.world.motion.mocap.skeleton import END, MocapSkeleton, RecordedMotion

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "xyz")
_MOST_JOINTS = 2000


@dataclass
class _Joint:
    name: str
    line: Line
    parent: int
    offset: list[float] | None = None
    channels: list[str] = field(default_factory=list)
    first: int = 0  # column of its first channel


def read_bvh(path: Path) -> RecordedMotion:
    """Read the skeleton and the motion of a BVH file.

    Raises:
        ValueError: not a valid BVH file; the message names file and line.
    """
    reader = Reader(path)
    joints = _hierarchy(reader)
    offsets = np.array([joint.offset if joint.parent >= 0 else [0.0, 0.0, 0.0] for joint in joints])
    names, parents = tuple(joint.name for joint in joints), np.array([joint.parent for joint in joints])
    skeleton = MocapSkeleton(names, parents, offsets)
    width = sum(len(joint.channels) for joint in joints)
    frames, rate = _heading(reader)
    rows = reader.rest()
    if len(rows) != frames:
        where = rows[-1] if rows else None
        message = f"Frames: states {frames}, got {len(rows)} lines of values"
        raise where.error(message) if where else reader.error(message)
    table = np.array([line.numbers(line.words, width, f"{len(joints)} joints' channels") for line in rows])

    turns = np.zeros((frames, len(joints), 4))
    turns[..., 0] = 1.0
    root = np.tile(np.array(joints[0].offset, float), (frames, 1))
    for j, joint in enumerate(joints):
        columns = {name: joint.first + k for k, name in enumerate(joint.channels)}
        order = "".join(name[0] for name in joint.channels if name.endswith("rotation"))
        if order:
            angles = table[:, [columns[f"{axis}rotation"] for axis in order]]
            turns[:, j] = Rotation.from_euler(order.upper(), angles, degrees=True).as_quat(scalar_first=True)
        if j == 0:
            for k, axis in enumerate("xyz"):
                if f"{axis}position" in columns:
                    root[:, k] = table[:, columns[f"{axis}position"]]
    return RecordedMotion(file=path.name, skeleton=skeleton, rate=rate, root=root, turns=turns)


def _hierarchy(reader: Reader) -> list[_Joint]:
    """Read the joints up to the line MOTION; return them with parents before children."""
    first = reader.take("HIERARCHY")
    if first.words[0].upper() != "HIERARCHY":
        raise first.error(f"expected HIERARCHY, got {quoted(first.words[0])}; is it a BVH file?")
    joints: list[_Joint] = []
    opened: list[int] = []
    width = 0
    while True:
        line = reader.take("MOTION" if joints and not opened else "a joint or its end")
        key = line.words[0].upper()
        if not opened and joints:
            if key != "MOTION":
                raise line.error(f"expected MOTION after the one ROOT, got {quoted(' '.join(line.words))}")
            break
        if key in ("ROOT", "JOINT", "END"):
            joints.append(_joint(line, key, joints, opened))
            if line.words[-1] != "{":
                brace = reader.take("{")
                if brace.words != ("{",):
                    raise brace.error(f"expected {{ alone, got {quoted(' '.join(brace.words))}")
            opened.append(len(joints) - 1)
        elif not opened:
            raise line.error(f"expected ROOT, got {quoted(line.words[0])}")
        elif key == "OFFSET":
            joints[opened[-1]].offset = line.numbers(line.words[1:], 3, f"OFFSET of {joints[opened[-1]].name}")
        elif key == "CHANNELS":
            joint = joints[opened[-1]]
            joint.channels, joint.first = _channels(line, joint), width
            width += len(joint.channels)
        elif key == "}":
            joint = joints[opened.pop()]
            if joint.offset is None:
                raise line.error(f"{joint.name}, which begins in line {joint.line.number}, has no OFFSET")
        else:
            raise line.error(f"expected OFFSET, CHANNELS, JOINT, End Site or }}, got {quoted(line.words[0])}")
    return joints


def _joint(line: Line, key: str, joints: list[_Joint], opened: list[int]) -> _Joint:
    parent = opened[-1] if opened else -1
    if (key == "ROOT") != (parent < 0):
        raise line.error(f"a {key} {'inside another joint' if parent >= 0 else 'before the ROOT'}")
    if len(joints) >= _MOST_JOINTS:
        raise line.error(f"more than {_MOST_JOINTS} joints")
    words = line.words[1:]
    if words[-1:] == ("{",):
        words = words[:-1]
    if not words:
        raise line.error(f"expected a name after {line.words[0]}")
    if parent >= 0 and joints[parent].name.endswith(END):
        raise line.error(f"{joints[parent].name!r} is an End Site and carries no joint")
    name = joints[parent].name + END if key == "END" else " ".join(words)
    if any(joint.name == name for joint in joints):
        raise line.error(f"the joint {quoted(name)} is defined twice")
    return _Joint(name, line, parent)


def _channels(line: Line, joint: _Joint) -> list[str]:
    if joint.channels:
        raise line.error(f"{joint.name} already has CHANNELS")
    names = [word.lower() for word in line.words[2:]]
    if len(line.words) < 2 or line.words[1] != str(len(names)):
        count = quoted(line.words[1]) if len(line.words) > 1 else "no number"
        raise line.error(f"CHANNELS of {joint.name} states {count} but lists {len(names)}")
    if joint.name.endswith(END) or set(names) - set(_CHANNELS) or len(set(names)) != len(names):
        raise line.error(
            f"expected CHANNELS of {joint.name} to be some of Xposition Yposition Zposition Xrotation Yrotation "
            f"Zrotation, each once, got {quoted(' '.join(line.words[2:]))}"
        )
    return names


def _heading(reader: Reader) -> tuple[int, float]:
    """Read the heading of the motion; return the number of frames and the rate in frames per second."""
    line = reader.take("Frames:")
    if line.words[0].lower() != "frames:":
        raise line.error(f"expected Frames: and a count, got {quoted(' '.join(line.words))}")
    if len(line.words) != 2 or not line.words[1].isdecimal() or int(line.words[1][:18]) < 1:
        raise line.error(f"expected a count of 1 or more after Frames:, got {quoted(' '.join(line.words[1:]))}")
    frames = int(line.words[1][:18])
    line = reader.take("Frame Time:")
    if tuple(word.lower() for word in line.words[:2]) != ("frame", "time:"):
        raise line.error(f"expected Frame Time: and seconds, got {quoted(' '.join(line.words))}")
    (step,) = line.numbers(line.words[2:], 1, "Frame Time")
    if not 1e-4 <= step <= 10:
        raise line.error(f"expected a Frame Time of 0.0001 to 10 s, got {step:g}")
    return frames, 1.0 / step
