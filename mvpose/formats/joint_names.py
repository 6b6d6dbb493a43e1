"""Joint names of skeletons in files, and conversion to the skeletons of mvpose by name.

Names are compared by :func:`canonical`, so that "LHip", "left hip", "Subject:L_Hip" and "left_hip" are the same joint.
"""

import difflib
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import COCO17, SHELF14
from mvpose.arrays import Floats, Integers
from mvpose.recording import People
from mvpose.skeleton import PANOPTIC19, HeadMapping, Skeleton, coco17_to_shelf14
from mvpose.wholebody import SKELETONS, known_names, skeleton_by_name

_SIDES = {"l": "left", "r": "right"}


def canonical(name: str) -> str:
    """Return a joint's name in the form of ours: lower case, words joined by "_", the side first and in full.

    "LHip", "l_hip", "leftHip", "hip_left", "Left hip" and "Subject:LHip" all become "left_hip".
    """
    name = name.rpartition(":")[2]
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    parts = [_SIDES.get(word, word) for word in re.split(r"[^a-z0-9]+", words.lower()) if word]
    if len(parts) > 1 and parts[-1] in ("left", "right"):
        parts = [parts[-1], *parts[:-1]]
    return "_".join(parts)


@dataclass(frozen=True)
class JointNames:
    """Skeleton of a file: the names of its joints in their order.

    Raises:
        ValueError: no names.
    """

    name: str
    """Name of the skeleton in messages."""
    joints: tuple[str, ...]
    """Names of the J joints; of equal names the first counts."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(self.joints))
        if not self.joints:
            raise ValueError(f"skeleton {self.name}: expected the names of its joints, got none")

    def __len__(self) -> int:
        return len(self.joints)

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {canonical(joint): row for row, joint in reversed(list(enumerate(self.joints)))}

    def renamed(self, names: Mapping[str, str]) -> "JointNames":
        """Return the skeleton with some joints under our names.

        Args:
            names: our name, of COCO17 or SHELF14, of some joints of the file, by the file's name: ``{ours: theirs}``.

        Raises:
            ValueError: a joint that the file or we do not have; the message names the nearest.
        """
        own = self._rows
        ours = dict.fromkeys((*COCO17.joints, *SHELF14.joints))
        joints = list(self.joints)
        for new, old in names.items():
            if canonical(new) not in ours:
                raise ValueError(f"no joint {new!r} in COCO17 or SHELF14; {_nearest(canonical(new), ours)}")
            if canonical(old) not in own:
                raise ValueError(f"skeleton {self.name} has no joint {old!r}; {_nearest(old, self.joints)}")
            for row, joint in enumerate(joints):
                if canonical(joint) == canonical(new):
                    joints[row] = f"other {joint}"  # the joint that had our name before
        for new, old in names.items():
            joints[own[canonical(old)]] = canonical(new)
        return JointNames(self.name, tuple(joints))

    def rows(self, wanted: Sequence[str]) -> Integers:
        """Return the index of each wanted joint, (n,); -1 where the file does not have it."""
        return np.array([self._rows.get(canonical(joint), -1) for joint in wanted])


_FILE: dict[str, dict[str, Any]] = tomllib.loads((Path(__file__).parent / "data" / "joints.toml").read_text("utf-8"))
_ORDERS = {
    "coco17": COCO17.joints,
    **{name: tuple(joints) for name, joints in _FILE["orders"].items()},
    **{"shelf14": SHELF14.joints, "panoptic19": PANOPTIC19.joints, "panoptic15": PANOPTIC19.joints[:15]},
}


@cache
def _named(name: str) -> JointNames:
    return JointNames(name, _ORDERS.get(name) or skeleton_by_name(name).joints)


class _Known(Mapping[str, JointNames]):
    """Skeletons by name; those of files are read when they are first looked up."""

    def __getitem__(self, name: str) -> JointNames:
        if name not in (*_ORDERS, *SKELETONS):
            raise KeyError(name)
        return _named(name)

    def __iter__(self) -> Iterator[str]:
        return iter((*_ORDERS, *SKELETONS))

    def __len__(self) -> int:
        return len(_ORDERS) + len(SKELETONS)


KNOWN = _Known()
"""Skeletons that are known by name."""


def known_skeleton(name: str) -> JointNames:
    """Return a known skeleton; "BODY_25" and "body25" are the same name, and models of Pose2Sim are known as well.

    Raises:
        ValueError: an unknown name; the message lists the known ones.
    """
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    plain = _FILE["other_names"].get(plain, plain)
    if plain not in KNOWN:
        raise ValueError(f"no skeleton {name!r} is known; {_nearest(plain, KNOWN)}")
    return KNOWN[plain]


def skeleton_of(names: JointNames) -> Skeleton:
    """Return the skeleton of a file: the shipped one that has its joints, by name and in their order, or another one.

    Another one has no tree: all joints hang at the first one. Equal names get numbers.
    """
    plain = [canonical(joint) for joint in names.joints]
    for known in (COCO17, SHELF14, PANOPTIC19, *map(skeleton_by_name, known_names())):
        if len(known) == len(plain) and [canonical(joint) for joint in known.joints] == plain:
            return known
    joints = [
        joint if joint not in names.joints[:row] else f"{joint} ({row})" for row, joint in enumerate(names.joints)
    ]
    count = len(joints)
    return Skeleton(names.name, tuple(joints), (-1, *[0] * (count - 1)), tuple(range(count)), (_SIGMA,) * count)


def to_skeleton(people: People, skeleton: Skeleton) -> People:
    """Convert people to another skeleton by the names of joints; joints that they lack are absent.

    Raises:
        ValueError: they have none of the joints.
    """
    if people.skeleton.joints == skeleton.joints:
        return people
    rows = _some_rows(JointNames(people.skeleton.name, people.skeleton.joints), skeleton.joints, skeleton.name)
    covariance, freedom = people.covariance, people.freedom
    return replace(
        people,
        joints=people.joints[:, :, rows],
        scores=np.where(rows >= 0, people.scores[:, :, rows], 0.0),
        covariance=None if covariance is None else covariance[:, :, rows],
        freedom=None if freedom is None else freedom[:, :, rows],
        skeleton=skeleton,
    )


def to_coco17(keypoints: Floats, scores: Floats, names: JointNames) -> tuple[Floats, Floats]:
    """Convert 2D keypoints to COCO17 by name.

    Args:
        keypoints: (n, J, 2), pixels.
        scores: (n, J); 0 where missing.
        names: the J joints.

    Returns:
        Keypoints (n, 17, 2), NaN where missing, and scores (n, 17), clipped to 0..1: networks overshoot at the
        interpolated peaks of heat maps. Joints that the skeleton lacks are missing.

    Raises:
        ValueError: the skeleton has none of the 17 joints.
    """
    rows = _some_rows(names, COCO17.joints, "COCO17")
    with np.errstate(invalid="ignore"):
        chosen = np.where(rows >= 0, np.clip(np.nan_to_num(scores[:, rows]), 0.0, 1.0), 0.0)
    return np.where(chosen[..., None] > 0, keypoints[:, rows], np.nan), chosen


def to_shelf14(joints: Floats, names: JointNames, *, head: HeadMapping = "voxelpose") -> Floats:
    """Convert 3D joints to SHELF14 by name.

    A joint of the head that the skeleton lacks is computed from nose, ears and shoulders by the protocol's rule
    (:func:`mvpose.skeleton.coco17_to_shelf14`), as for estimates.

    Args:
        joints: (..., J, 3), metres, z up; NaN where undefined.
        names: the J joints.
        head: rule for the head.

    Returns:
        (..., 14, 3); NaN where a joint is neither named nor can be computed.

    Raises:
        ValueError: the skeleton has none of the 12 limb joints.
    """
    limbs = SHELF14.joints[:_LIMBS]
    _some_rows(names, limbs, "the limbs of SHELF14")
    found = _take(joints, names.rows(SHELF14.joints))
    computed = coco17_to_shelf14(_take(joints, names.rows(COCO17.joints)), head=head)
    lacking = names.rows(SHELF14.joints) < 0
    lacking[:_LIMBS] = False
    return np.where(lacking[:, None], computed, found)


_SIGMA = 0.08  # OKS standard deviation of a joint of which nothing is known: about that of a knee
_LIMBS = 12  # joints of SHELF14 before those of the head


def _take(joints: Floats, rows: Integers) -> Floats:
    """Return joints by their rows, (..., n, 3); NaN for a row of -1."""
    return np.where((rows >= 0)[:, None], joints[..., rows, :], np.nan)


def _some_rows(names: JointNames, wanted: Sequence[str], title: str) -> Integers:
    rows = names.rows(wanted)
    if (rows < 0).all():
        raise ValueError(
            f"skeleton {names.name} has no joint of {title}: it has {_listed(names.joints)}; expected names such as "
            f"{wanted[0]}: declare a skeleton with a map {{ {wanted[0]} = ... }}"
        )
    return rows


def _nearest(name: str, known: Sequence[str] | Mapping[str, object]) -> str:
    near = difflib.get_close_matches(name, list(known), n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"{hint}expected one of {_listed(list(known))}"


def _listed(names: Sequence[str], most: int = 40) -> str:
    return ", ".join(names[:most]) + (", ..." if len(names) > most else "")
