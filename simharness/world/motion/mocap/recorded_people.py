"""People whose joints were recorded together, to be re-enacted: read from files, checked, and their body shapes.

Files are of any format of :mod:`mvpose.formats.people` that is read. All joints of COCO-17 have to be known in all
frames, because bodies cannot be nowhere.

Bodies that re-enact them have their limb lengths, and their shoulders and hips are as wide.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mvpose.files.message_text import one_line
from mvpose.formats.joint_names import KNOWN, to_skeleton
from mvpose.formats.people import read_people
from mvpose.recording import People
from mvpose.skeleton import COCO17
from simharness.scenario.sections.people_section import PeopleSection
from simharness.world.humans.anatomy import SIDES
from simharness.world.humans.body import body_model, make_body
from simharness.world.humans.shape import LIMITS, STRETCHED, Shape
from simharness.world.motion.mocap.reenactment import across, follow, middle, segment
from simharness.world.motion.poses.kinematics import Kinematics

TRUNK = (0.15, 0.9)
"""Least and greatest trunk of children and adults, with much tolerance, metres."""

_APART = 0.001  # metres: least distance between left and right
_POSES = 120  # most poses, spread over the recording, in which lengths are compared


def load_people(section: PeopleSection) -> People:
    """Load the people whom those of a scenario re-enact.

    Returns:
        People on COCO-17, of whom all joints are known, at times from 0.

    Raises:
        ValueError: the file is missing or not valid, its people cannot be re-enacted (:func:`check_people`), it has
            another number of people, or ``start`` is after its end.
    """
    motion = section.motion
    try:
        people = to_skeleton(read_people(motion.file, skeleton=KNOWN["coco17"]), COCO17)
        check_people(people)
    except ValueError as error:
        where = "" if str(error).startswith(motion.file) else f"{motion.file}: "
        raise ValueError(one_line(f"{where}{error}")) from None
    people = replace(people, times=people.times - people.times[0])
    if len(people) != section.count:
        raise ValueError(
            f"people.count = {section.count}, but {motion.file} has {len(people)} people, who are all re-enacted: set "
            f"people.count = {len(people)}"
        )
    if motion.start > people.times[-1]:
        raise ValueError(
            f"people.motion.start = {motion.start:g} s is not within {motion.file}: expected 0 to "
            f"{people.times[-1]:.4g} s"
        )
    return people


def check_people(people: People) -> None:
    """Check that people on COCO-17 can be re-enacted.

    Raises:
        ValueError: nobody, a joint that is absent in a frame, a trunk that is not that of a person in metres, or hips
            or shoulders in one point.
    """
    if not people.joints.size:
        raise ValueError(f"has {people.frames} frames of {len(people)} people, expected one or more of each")
    missing = np.argwhere(~people.present)
    if len(missing):
        frame, person, joint = missing[0].tolist()
        raise ValueError(
            f"expected all joints in all frames, got {len(missing)} that are absent, the first one "
            f"{COCO17.joints[joint]} of person {person} in frame {frame}: fill the gaps, or leave the person out"
        )
    for person in range(len(people)):
        joints = people.joints[:, person]
        trunk, (shortest, longest) = body_lengths(joints)["trunk"], TRUNK
        if not shortest <= trunk <= longest:
            raise ValueError(
                f"the trunk of person {person} is {trunk:.3g} m long from hips to shoulders, expected {shortest:g} to "
                f"{longest:g} m: write joints in metres"
            )
        for name in ("hip", "shoulder"):
            sides = [joints[:, COCO17.index(f"{side}_{name}")] for side in ("left", "right")]
            close = np.flatnonzero(np.linalg.norm(sides[0] - sides[1], axis=1) < _APART)
            if len(close):
                raise ValueError(
                    f"left and right {name} of person {person} are in one point in frame {close[0]}, so the person "
                    "faces nowhere: correct the joints"
                )


def recorded_shape(shape: Shape, people: People, person: int) -> Shape:
    """Return the shape with the size of a recorded person, as far as any body has it.

    Distances between COCO-17 joints change with the pose: a bent trunk is shorter, and so is a thigh in a squat. So the
    lengths are compared while the body performs the recorded poses, and corrected once.

    Args:
        shape: drawn shape; parameters other than stature, limb lengths and widths are kept.
        people: people who are re-enacted.
        person: column of the person in them.
    """
    frames = np.unique(np.linspace(0, people.frames - 1, _POSES).round().astype(int))
    joints = people.joints[:, person]
    recorded = body_lengths(joints)
    first = resize(shape, recorded)
    kinematics = Kinematics(make_body(first))
    performed = body_lengths(kinematics.joints(follow(joints[frames], kinematics, time=people.times[frames])))
    wanted = body_lengths(joints[frames])
    return resize(shape, {name: recorded[name] * wanted[name] / performed[name] for name in recorded})


_AT_REST = {"trunk": 1.037, "hips": 1.038}  # lengths with raised arms and legs astride over those of a standing person
_ROUNDS = 6  # of factors: limb lengths between COCO-17 joints are almost proportional to them, widths less so


def body_lengths(joints: ArrayLike) -> dict[str, float]:
    """Return the median lengths of trunk, upper arm, forearm, thigh and shank, and the widths of shoulders and hips.

    In metres. The trunk reaches from mid-hips to mid-shoulders; the length of a limb is that of both sides.

    Args:
        joints: COCO-17 joints over time, (T, 17, 3) metres.
    """
    joints = np.asarray(joints, float)
    spans = {"trunk": [middle(joints, "shoulder") - middle(joints, "hip")]}
    for limb in ("upper_arm", "forearm", "thigh", "shank"):
        spans[limb] = [segment(joints, side, limb.removeprefix("upper_")) for side in SIDES]
    spans |= {width: [across(joints, width.removesuffix("s"))] for width in ("shoulders", "hips")}
    return {name: float(np.median(np.linalg.norm(span, axis=-1))) for name, span in spans.items()}


def resize(shape: Shape, lengths: Mapping[str, float]) -> Shape:
    """Return the shape with stature, limb lengths and widths changed so that its body has them, as far as any body has.

    Args:
        shape: initial shape; its other parameters are kept.
        lengths: trunk, limbs and widths with hanging arms, see :func:`body_lengths`.
    """
    lengths = {name: value * _AT_REST.get(name, 1.0) for name, value in lengths.items()}

    def trunk(height: float) -> float:
        return _at_rest(replace(shape, height=height))["trunk"] - lengths["trunk"]

    low, high = LIMITS["height"]
    if trunk(low) >= 0:
        height = low
    elif trunk(high) <= 0:
        height = high
    else:
        height = float(brentq(trunk, low, high, xtol=1e-4))
    shape = replace(shape, height=height)
    for _ in range(_ROUNDS):
        present = _at_rest(shape)
        factors = {name: getattr(shape, name) * lengths[name] / present[name] for name in STRETCHED}
        shape = replace(shape, **{name: float(np.clip(value, *LIMITS[name])) for name, value in factors.items()})
    return shape


def _at_rest(shape: Shape) -> dict[str, float]:
    model = body_model()
    vertices, _ = model.rest_of_shape(shape)
    return body_lengths(model.joints(vertices)[None])
