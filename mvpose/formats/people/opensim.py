"""Files for OpenSim beside the markers of TRC files: joint angles, a marker set, setups to scale a model and solve it.

The model is that of Rajagopal et al., 2016 (:mod:`mvpose.skeleton_fit.joint_angles`), which comes with OpenSim, or any
with its bodies and coordinates. Its bodies have their origins in the centres of joints, so markers of joints lie there
in a model of any size; those of head, trunk and feet lie as in an average body of ours.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.formats.people import trc
from mvpose.formats.people.people_files import Export, each_person, marker_label
from mvpose.skeleton import Skeleton
from mvpose.skeleton_fit import FittedBody, joint_angles
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.joint_angles import AXES

_HIPS = np.array([-0.056276, -0.07849, 0.07726])  # metres; centre of the right hip in the pelvis of that model
_SHOULDERS = np.array([0.003155, 0.3715, 0.0])  # middle between the centres of the shoulders in its torso
_HEEL = np.array([-0.04877, -0.04195, 0.00792])  # origin of the right calcaneus from the centre of the ankle
_BODIES = {"UpLeg": "femur", "Leg": "tibia", "Foot": "talus", "Arm": "humerus", "ForeArm": "ulna", "Hand": "hand"}


def write_mot(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the coordinates of each person to whom a body can be fitted, which OpenSim plays on its model.

    Times are those of the TRC file of the person.
    """
    world = export.axes("y")
    for fit in export.bodies:
        table = {**_pelvis(fit, world), **joint_angles(fit, world)}
        name = f"person_{fit.identity}.mot"
        counts = (f"nRows={len(fit.times)}", f"nColumns={1 + len(table)}")
        header = [name, "version=1", *counts, "inDegrees=yes", "endheader"]
        yield name, _table(header, fit.times, table, "\t")


def write_angles(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the joint angles of each person to whom a body can be fitted, in degrees, as CSV."""
    world = export.axes("y")
    for fit in export.bodies:
        table = joint_angles(fit, world)
        yield f"person_{fit.identity}_angles.csv", _table([], fit.times, table, ",")


def write_setup(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the markers on the bodies of the model, and of each person its TRC file and setups to scale and to solve.

    Raises:
        ValueError: a skeleton without hips and shoulders.
    """
    people = export.uniform
    markers = {marker_label(joint): place for joint, place in marker_places(people.skeleton).items()}
    yield "opensim_markers.xml", _filled("opensim_markers.xml", markers=markers)
    yield from trc.write(export)
    for _, identity, span in each_person(people):
        name = f"person_{identity}"
        times = f"{people.times[span.start]:.6f} {people.times[span.stop - 1]:.6f}"
        for kind in ("scale", "ik"):
            yield f"{name}_{kind}.xml", _filled(f"opensim_{kind}.xml", name=name, times=times, markers=markers)


def _filled(template: str, **values: Any) -> bytes:
    import jinja2

    folder = jinja2.FileSystemLoader(Path(__file__).parents[1] / "data")
    made = jinja2.Environment(loader=folder, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return made.get_template(template).render(values).encode()


def marker_places(skeleton: Skeleton) -> dict[str, tuple[str, Floats]]:
    """Return, by joint, the body of the unscaled model on which its marker lies, and where there, (3,), metres.

    Knuckles are left out: the hand of the model turns as the forearm does.

    Raises:
        ValueError: a skeleton without hips and shoulders.
    """
    body, found = ArticulatedBody.of_skeleton(skeleton), {}
    for joint, carrier, place in zip(body.joints, body.carriers, body.places, strict=True):
        segment, local = body.segments[carrier].name, AXES @ place
        side = "r" if segment.startswith("Right") else "l"
        part = segment.removeprefix("Right").removeprefix("Left")
        mirror = np.array([1.0, 1.0, 1.0 if side == "r" else -1.0])
        if segment == "Hips":
            found[joint] = ("pelvis", _HIPS * [1.0, 1.0, 0.0])
        elif segment == "Neck":
            found[joint] = ("torso", _SHOULDERS + local)
        elif part == "UpLeg":
            found[joint] = ("pelvis", _HIPS * mirror)
        elif not place.any():
            found[joint] = (f"{_BODIES[part]}_{side}", np.zeros(3))
        elif part == "Foot":
            found[joint] = (f"calcn_{side}", local - _HEEL * mirror)
    return found


def _pelvis(fit: FittedBody, world: Floats) -> dict[str, Floats]:
    """Return the origin of the model's pelvis in the world, by coordinate, metres; its hips are those of the body."""
    size = fit.lengths["hip"] / _HIPS[2]
    turned = world @ fit.pose.rotations[:, 0] @ AXES.T
    origin = fit.pose.root @ world.T - turned @ (size * _HIPS * [1.0, 1.0, 0.0])
    return dict(zip(("pelvis_tx", "pelvis_ty", "pelvis_tz"), origin.T, strict=True))


def _table(header: Sequence[str], times: Floats, columns: Mapping[str, Floats], separator: str) -> bytes:
    header = [*header, separator.join(("time", *columns))]
    rows = np.column_stack([times, *columns.values()])
    return ("\n".join([*header, *(separator.join(f"{x:.6f}" for x in row) for row in rows)]) + "\n").encode()
