"""Files for OpenSim beside the markers of TRC files: joint angles, a marker set, setups to scale a model and solve it.

The model is that of Rajagopal et al., 2016 (:mod:`mvpose.skeleton_fit.joint_angles`), which comes with OpenSim, or any
with its bodies and coordinates. Its bodies have their origins in the centres of joints, so markers of joints lie there
in a model of any size; those of head, trunk and feet lie as in an average body of ours.
"""

from collections.abc import Iterator, Mapping, Sequence
from xml.etree import ElementTree as Xml

import numpy as np

from mvpose.arrays import Floats
from mvpose.formats.people import trc
from mvpose.formats.people.people_files import Export, each_person, marker_label
from mvpose.skeleton import Skeleton
from mvpose.skeleton_fit import FittedBody, joint_angles
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.joint_angles import AXES

MODEL, MARKERS = "Rajagopal2016.osim", "opensim_markers.xml"
"""File of the model that the setups name, and of the markers on its bodies."""

_HIPS = np.array([-0.056276, -0.07849, 0.07726])  # metres; centre of the right hip in the pelvis of that model
_SHOULDERS = np.array([0.003155, 0.3715, 0.0])  # middle between the centres of the shoulders in its torso
_HEEL = np.array([-0.04877, -0.04195, 0.00792])  # origin of the right calcaneus from the centre of the ankle
_BODIES = {"UpLeg": "femur", "Leg": "tibia", "Foot": "talus", "Arm": "humerus", "ForeArm": "ulna", "Hand": "hand"}
_MEASURES = {  # bodies, and their axes, that are scaled by the distance between two joints of either side, or of both
    "pelvis": (("pelvis",), "X Y Z", ("hip", "hip")),
    "trunk": (("torso",), "X Y", ("hip", "shoulder")),
    "shoulders": (("torso",), "Z", ("shoulder", "shoulder")),
    "thigh": (("femur_r", "femur_l"), "X Y Z", ("hip", "knee")),
    "shank": (("tibia_r", "tibia_l", "patella_r", "patella_l"), "X Y Z", ("knee", "ankle")),
    "foot": (("talus_r", "calcn_r", "toes_r", "talus_l", "calcn_l", "toes_l"), "X Y Z", ("heel", "big_toe")),
    "upper arm": (("humerus_r", "humerus_l"), "X Y Z", ("shoulder", "elbow")),
    "forearm": (("ulna_r", "radius_r", "hand_r", "ulna_l", "radius_l", "hand_l"), "X Y Z", ("elbow", "wrist")),
}
_HEAD_WEIGHT = 0.1  # of markers on the head, which is fixed to the torso of that model; others have 1


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
    places = marker_places(people.skeleton)
    yield MARKERS, _document(_marker_set(places))
    yield from trc.write(export)
    for _, identity, span in each_person(people):
        name = f"person_{identity}"
        times = f"{people.times[span.start]:.6f} {people.times[span.stop - 1]:.6f}"
        yield f"{name}_scale.xml", _document(_scaling(name, times, people.skeleton))
        yield f"{name}_ik.xml", _document(_solving(name, times, places))


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


def _element(tag: str, *content: Xml.Element | str, name: str = "") -> Xml.Element:
    element = Xml.Element(tag, {"name": name} if name else {})
    for each in content:
        if isinstance(each, str):
            element.text = each
        else:
            element.append(each)
    return element


def _document(content: Xml.Element) -> bytes:
    document = Xml.Element("OpenSimDocument", {"Version": "40000"})
    document.append(content)
    Xml.indent(document, "\t")
    return b'<?xml version="1.0" encoding="UTF-8" ?>\n' + Xml.tostring(document) + b"\n"


def _marker_set(places: Mapping[str, tuple[str, Floats]]) -> Xml.Element:
    markers = [
        _element(
            "Marker",
            _element("socket_parent_frame", f"/bodyset/{body}"),
            _element("location", " ".join(f"{x:.6f}" for x in place)),
            _element("fixed", "true"),
            name=marker_label(joint),
        )
        for joint, (body, place) in places.items()
    ]
    return _element("MarkerSet", _element("objects", *markers), name="mvpose")


def _pairs(joints: tuple[str, str], skeleton: Skeleton) -> list[str]:
    """Return the pairs of markers whose distances give the size of a body, those that the skeleton has."""
    first, second = joints
    sides = (("right", "left"),) if first == second else (("right", "right"), ("left", "left"))
    pairs = [(f"{one}_{first}", f"{other}_{second}") for one, other in sides]
    return [" ".join(map(marker_label, pair)) for pair in pairs if set(pair) <= set(skeleton.joints)]


def _scaling(name: str, times: str, skeleton: Skeleton) -> Xml.Element:
    measures = []
    for measure, (bodies, axes, joints) in _MEASURES.items():
        if pairs := [_element("MarkerPair", _element("markers", each)) for each in _pairs(joints, skeleton)]:
            scales = [_element("BodyScale", _element("axes", axes), name=each) for each in bodies]
            content = (
                _element("apply", "true"),
                _element("MarkerPairSet", _element("objects", *pairs)),
                _element("BodyScaleSet", _element("objects", *scales)),
            )
            measures.append(_element("Measurement", *content, name=measure))
    return _element(
        "ScaleTool",
        _element("GenericModelMaker", _element("model_file", MODEL), _element("marker_set_file", MARKERS)),
        _element(
            "ModelScaler",
            _element("apply", "true"),
            _element("scaling_order", "measurements"),
            _element("MeasurementSet", _element("objects", *measures)),
            _element("marker_file", f"{name}.trc"),
            _element("time_range", times),
            _element("output_model_file", f"{name}_scaled.osim"),
        ),
        _element("MarkerPlacer", _element("apply", "false")),
        name=name,
    )


def _solving(name: str, times: str, places: Mapping[str, tuple[str, Floats]]) -> Xml.Element:
    tasks = [
        _element(
            "IKMarkerTask",
            _element("apply", "true"),
            _element("weight", f"{_HEAD_WEIGHT if body == 'torso' and (place != _SHOULDERS).any() else 1.0}"),
            name=marker_label(joint),
        )
        for joint, (body, place) in places.items()
    ]
    return _element(
        "InverseKinematicsTool",
        _element("model_file", f"{name}_scaled.osim"),
        _element("IKTaskSet", _element("objects", *tasks)),
        _element("marker_file", f"{name}.trc"),
        _element("time_range", times),
        _element("output_motion_file", f"{name}_ik.mot"),
        name=name,
    )
