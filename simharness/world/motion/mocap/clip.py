"""A recorded motion as an activity: any body performs it, at any place, for as long as it takes.

The clip begins at time 0 and is played back and forth: people go on moving, come back to where they were, and nothing
jumps. At either end the motion comes to rest and sets off again within ``TURN`` seconds; so does one that begins with
the first frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.scenario.sections.people import Mocap
from simharness.world.motion.mocap.asf import read_amc, read_asf
from simharness.world.motion.mocap.bvh import read_bvh
from simharness.world.motion.mocap.retarget import SourceMotion, pelvis_path, retarget, source_motion
from simharness.world.motion.mocap.skeleton import Recording
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.trajectory import RATE, interpolate_poses

TURN = 0.3  # seconds that turning round at an end of the clip takes


@dataclass(frozen=True)
class Clip:
    """A recorded motion.

    Attributes:
        recording: what the file holds.
        start: where in it to begin, seconds.

    Raises:
        ValueError: a start that is not in the clip, a clip too short to turn round in, or a skeleton that is not a
            person's.
    """

    recording: Recording
    start: float = 0.0

    def __post_init__(self) -> None:
        file, duration = self.recording.file, self.recording.duration
        if duration < TURN:
            raise ValueError(
                f"people.motion.file: {file} lasts {duration:.3g} s, {len(self.recording)} frames; a motion takes at "
                f"least {TURN:g} s"
            )
        if not 0 <= self.start <= duration:
            raise ValueError(f"people.motion.start = {self.start:g} s is not in {file}, which lasts {duration:.4g} s")
        _ = self._recorded  # a skeleton that is not understood shows here

    @cached_property
    def _recorded(self) -> SourceMotion:
        return source_motion(self.recording, rate=RATE)

    @property
    def time(self) -> Floats:
        """Seconds from the file's first frame, (N,), about ``RATE`` a second."""
        return self._recorded.time

    def moment(self, time: ArrayLike) -> Floats:
        """Seconds into the clip at times (...): back and forth, from ``start`` at time 0."""
        return back_and_forth(np.asarray(time, float), start=self.start, end=float(self.time[-1]))

    def path(self, kinematics: Kinematics) -> Floats:
        """Way of the body's pelvis over ``time``, (N, 2) metres, as if it were at the origin and faced +x at
        ``start``.
        """
        turns = Rotation.from_matrix(self._recorded.turns["pelvis"]).as_quat(scalar_first=True)
        way = pelvis_path(self._recorded, kinematics)
        place, bearing = self._begin(np.concatenate([way, turns], axis=1))
        return Rotation.from_euler("Z", -bearing).apply(way - place)[:, :2]

    def perform(
        self,
        kinematics: Kinematics,
        time: Floats,
        *,
        place: ArrayLike,
        bearing: float,
        rng: np.random.Generator | None = None,
    ) -> Motion:
        """The clip on a body.

        Args:
            kinematics: the body.
            time: seconds, (T,), ascending.
            place: where the pelvis is at time 0, (2,) metres.
            bearing: where it then faces, radians from the x axis.
            rng: not used: a recording leaves nothing to draw.
        """
        whole = retarget(self._recorded, kinematics)
        origin, facing = self._begin(whole.root)
        shift = Rotation.from_euler("Z", bearing - facing)
        root, angles = whole.read(self.moment(time))
        position = shift.apply(root[:, :3] - origin) + [*np.asarray(place, float), 0.0]
        turn = (shift * Rotation.from_quat(root[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
        return Motion(np.asarray(time, float), np.concatenate([position, turn], axis=1), angles)

    def _begin(self, root: Floats) -> tuple[Floats, float]:
        """The point of the floor (x, y, 0) over which a pelvis (N, 7) is at the start, and where it then faces."""
        pose = interpolate_poses(self.time, root, self.start)
        forward = Rotation.from_quat(pose[3:], scalar_first=True).apply([1.0, 0.0, 0.0])
        return np.array([pose[0], pose[1], 0.0]), float(np.arctan2(forward[1], forward[0]))


def back_and_forth(time: Floats, *, start: float, end: float) -> Floats:
    """From ``start`` at time 0 to ``end``, back to 0 and so on, (...): at the speed of time but for the turns.

    Around a turn speed changes evenly from 1 to -1, which takes ``TURN`` seconds and stays TURN / 4 from the tip that
    an abrupt turn would reach; the tips are set so that 0 and ``end`` are just reached.
    """
    bow = TURN / 4
    low, high = -bow, end + bow  # tips of the abrupt turns
    span = high - low
    # The place on the abrupt zigzag that is eased to ``start``: near a tip solve the parabola, else it is start itself.
    begin = start
    if start < low + TURN / 2:
        begin = low + np.sqrt(max(start, 0.0) * TURN)
    elif start > high - TURN / 2:
        begin = high - np.sqrt(max(end - start, 0.0) * TURN)
    along = np.mod(time + begin - low, 2 * span)
    away = span - np.abs(along - span)  # 0 at the low tip, span at the high one
    near = np.minimum(away, span - away)
    eased = np.where(near < TURN / 2, bow + near**2 / TURN, near)
    return np.clip(low + np.where(away > span / 2, span - eased, eased), 0.0, end)


def load_clip(mocap: Mocap) -> Clip:
    """Read the motion that a scenario names.

    Args:
        mocap: the section ``people.motion``.

    Raises:
        ValueError: a file that is not there or not understood, naming the key or the file and line.
    """
    file = Path(mocap.file)
    if file.suffix.lower() not in (".amc", ".bvh"):
        raise ValueError(f"people.motion.file = {mocap.file!r}: expected the name of an AMC or a BVH file")
    if not file.is_file():
        raise ValueError(f"people.motion.file = {mocap.file!r}: there is no such file")
    if file.suffix.lower() == ".bvh":
        return Clip(read_bvh(file), mocap.start)
    return Clip(read_amc(file, read_asf(_skeleton(mocap, file))), mocap.start)


def _skeleton(mocap: Mocap, file: Path) -> Path:
    if mocap.skeleton:
        skeleton = Path(mocap.skeleton)
        if not skeleton.is_file():
            raise ValueError(f"people.motion.skeleton = {mocap.skeleton!r}: there is no such file")
        return skeleton
    beside = sorted(path for path in file.parent.iterdir() if path.suffix.lower() == ".asf")
    if len(beside) != 1:
        raise ValueError(
            f"people.motion.file = {mocap.file!r}: an AMC file needs its skeleton, and there are {len(beside)} ASF "
            "files beside it: name it by people.motion.skeleton"
        )
    return beside[0]
