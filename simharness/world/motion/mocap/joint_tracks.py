"""Files of joint tracks: joints of several people over time, recorded together at one place.

A file is a NumPy archive (npz) with ``joints`` (T, P, 17, 3), COCO-17 in metres with z up, and ``rate``, frames per
second. ``names`` (17,), the names of the joints, is optional and allows another order of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.files.archives import arrays_of
from mvpose.files.input_files import read_bytes
from mvpose.skeleton import COCO17
from simharness.scenario.sections.people_section import PeopleSection
from simharness.world.humans.body_size import body_lengths

_TRUNK = (0.15, 0.9)  # metres: least and greatest trunk of children and adults, with much tolerance
_APART = 0.001  # metres: least distance between left and right
_EXPECTED = (
    "a NumPy archive (npz) with joints (T, P, 17, 3) in metres, COCO-17 with z up, and rate in frames per second"
)


@dataclass(frozen=True)
class PeopleTracks:
    """Joint tracks of P people in T frames.

    Attributes:
        file: name of the file, for messages.
        joints: COCO-17 joints, (T, P, 17, 3) metres, z up, finite.
        rate: frames per second.

    Raises:
        ValueError: wrong shape, no frame, a value that is not finite, a trunk that is not that of a person in metres,
            hips or shoulders in one point, or a rate that is not positive.
    """

    file: str
    joints: Floats
    rate: float

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints)
        if joints.dtype.kind not in "fiu" or joints.ndim != 4 or joints.shape[2:] != (17, 3) or not joints.size:
            raise ValueError(
                f"{self.file}: expected joints (T, P, 17, 3) of one or more frames and people, got "
                f"{joints.dtype} {joints.shape}: write COCO-17 joints"
            )
        missing = np.argwhere(~np.isfinite(joints).all(axis=-1))
        if len(missing):
            frame, person, joint = missing[0].tolist()
            raise ValueError(
                f"{self.file}: expected finite joints, got {len(missing)} that are not, the first one "
                f"{COCO17.joints[joint]} of person {person} in frame {frame}: fill the gaps, or leave the person out"
            )
        if np.ndim(self.rate) or not 0 < self.rate < np.inf:
            raise ValueError(f"{self.file}: expected a positive rate in frames per second, got {self.rate}: correct it")
        object.__setattr__(self, "joints", joints.astype(float))
        for person in range(self.people):
            self._check_trunk(person)
        object.__setattr__(self, "rate", float(self.rate))

    def _check_trunk(self, person: int) -> None:
        joints = self.joints[:, person]
        trunk, (shortest, longest) = body_lengths(joints)["trunk"], _TRUNK
        if not shortest <= trunk <= longest:
            raise ValueError(
                f"{self.file}: the trunk of person {person} is {trunk:.3g} m long from hips to shoulders, expected "
                f"{shortest:g} to {longest:g} m: write COCO-17 joints in metres"
            )
        for name in ("hip", "shoulder"):
            sides = [joints[:, COCO17.index(f"{side}_{name}")] for side in ("left", "right")]
            close = np.flatnonzero(np.linalg.norm(sides[0] - sides[1], axis=1) < _APART)
            if len(close):
                raise ValueError(
                    f"{self.file}: left and right {name} of person {person} are in one point in frame {close[0]}, so "
                    "the person faces nowhere: correct the joints"
                )

    @property
    def people(self) -> int:
        """Number of people."""
        return self.joints.shape[1]

    @property
    def duration(self) -> float:
        """Time from the first frame to the last, seconds."""
        return (len(self.joints) - 1) / self.rate


def tracks_file(path: Path, joints: ArrayLike, rate: float) -> None:
    """Write joint tracks (T, P, 17, 3), COCO-17 in metres with z up, at ``rate`` frames per second.

    Raises:
        ValueError: the tracks are not valid, see :class:`PeopleTracks`.
    """
    tracks = PeopleTracks(str(path), np.asarray(joints), rate)
    with path.open("wb") as stream:  # np.savez would add a suffix
        np.savez_compressed(stream, joints=tracks.joints, rate=tracks.rate, names=np.array(COCO17.joints))


def read_joint_tracks(path: Path) -> PeopleTracks:
    """Read a file of joint tracks.

    Raises:
        ValueError: the file is missing, is no such archive, or its content is not valid.
    """
    archive = read_bytes(path, what=_EXPECTED)
    try:
        content = arrays_of(archive, only=("joints", "rate", "names"))
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read ({error}); expected {_EXPECTED}: write it again") from None
    for key in ("joints", "rate"):
        if key not in content:
            raise ValueError(f"{path}: has no array {key!r}; expected {_EXPECTED}: add it")
    if content["rate"].dtype.kind not in "fiu" or content["rate"].size != 1:
        raise ValueError(f"{path}: expected rate, one number of frames per second, got {content['rate']}: correct it")
    joints = content["joints"]
    if "names" in content:
        names = [str(name) for name in content["names"].ravel()]
        if joints.ndim != 4 or len(names) != joints.shape[2] or sorted(names) != sorted(COCO17.joints):
            raise ValueError(
                f"{path}: expected names to be those of the joints, {', '.join(COCO17.joints)}, got {', '.join(names)} "
                f"for joints {joints.shape}: map the joints to COCO-17"
            )
        joints = joints[:, :, [names.index(joint) for joint in COCO17.joints]]
    return PeopleTracks(str(path), joints, float(content["rate"].item()))


def load_tracks(people: PeopleSection) -> PeopleTracks:
    """Load the joint tracks that the people of a scenario re-enact.

    Raises:
        ValueError: the file is missing or not valid, it has another number of people, or ``start`` is after its end.
    """
    motion = people.motion
    tracks = read_joint_tracks(Path(motion.file))
    if tracks.people != people.count:
        raise ValueError(
            f"people.count = {people.count}, but {motion.file} has the tracks of {tracks.people} people, who are all "
            f"re-enacted: set people.count = {tracks.people}"
        )
    if motion.start > tracks.duration:
        raise ValueError(
            f"people.motion.start = {motion.start:g} s is not within {motion.file}: expected 0 to "
            f"{tracks.duration:.4g} s"
        )
    return tracks
