"""Recorded motion as an activity: performed by any body, at any place, for any duration.

The clip starts at time 0 and is played back and forth, so that people keep moving, return to their start, and nothing
jumps. At either end, and at a start in the first frame, the motion stops and reverses within ``TURN`` seconds.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.scenario.sections.people_section import MocapSection
from simharness.world.motion.mocap.asf import read_amc, read_asf
from simharness.world.motion.mocap.bvh import read_bvh
from simharness.world.motion.mocap.retarget import SourceMotion, retarget, source_motion
from simharness.world.motion.mocap.skeleton import RecordedMotion
from simharness.world.motion.motion import RATE, Motion, interpolate_poses
from simharness.world.motion.poses.kinematics import Kinematics

TURN = 0.3  # seconds of the reversal at an end of the clip


@dataclass(frozen=True)
class Clip:
    """Recorded motion that bodies can perform.

    Raises:
        ValueError: the start is not within the recording, the recording is too short to reverse, or its skeleton is
            not that of a person.
    """

    recording: RecordedMotion
    """Contents of the file."""
    start: float = 0.0
    """Time in the recording at which the clip starts, seconds."""

    def __post_init__(self) -> None:
        file, duration = self.recording.file, self.recording.duration
        if duration < TURN:
            raise ValueError(
                f"people.motion.file: {file} lasts {duration:.3g} s ({len(self.recording)} frames), expected "
                f"{TURN:g} s or more: choose a longer recording"
            )
        if not 0 <= self.start <= duration:
            raise ValueError(
                f"people.motion.start = {self.start:g} s is not within {file}: expected 0 to {duration:.4g} s"
            )
        _ = self._source  # raises if the skeleton cannot be mapped

    @cached_property
    def _source(self) -> SourceMotion:
        return source_motion(self.recording, rate=RATE)

    @property
    def time(self) -> Floats:
        """Times from the first frame of the file in seconds, (N,), about ``RATE`` per second."""
        return self._source.time

    def moment(self, time: ArrayLike) -> Floats:
        """Return the time in the recording, (...) seconds, at times (...): back and forth, ``start`` at time 0."""
        return back_and_forth(np.asarray(time, float), start=self.start, end=float(self.time[-1]))

    def perform(self, kinematics: Kinematics, time: Floats, *, place: ArrayLike, bearing: float) -> Motion:
        """Return the motion of the clip, performed by a body.

        Args:
            kinematics: body.
            time: times in seconds, (T,), ascending.
            place: position of the pelvis at time 0, (2,) metres.
            bearing: facing direction at time 0, radians from the x axis.
        """
        whole = retarget(self._source, kinematics)
        start = interpolate_poses(self.time, whole.root, self.start)
        forward = Rotation.from_quat(start[3:], scalar_first=True).apply([1.0, 0.0, 0.0])
        shift = Rotation.from_euler("Z", bearing - float(np.arctan2(forward[1], forward[0])))
        root, angles = whole.read(self.moment(time))
        position = shift.apply(root[:, :3] - [start[0], start[1], 0.0]) + [*np.asarray(place, float), 0.0]
        turn = (shift * Rotation.from_quat(root[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
        return Motion(np.asarray(time, float), np.concatenate([position, turn], axis=1), angles)


def back_and_forth(time: Floats, *, start: float, end: float) -> Floats:
    """Return clip time, (...), that runs from ``start`` at time 0 to ``end``, back to 0 and so on.

    The speed is 1, except in reversals, where it changes linearly from 1 to -1 within ``TURN`` seconds. A reversal
    stays TURN / 4 below the tip of an abrupt one; the tips are set so that 0 and ``end`` are just reached.
    """
    bow = TURN / 4
    low, high = -bow, end + bow  # tips of the abrupt reversals
    span = high - low
    # Position on the abrupt zigzag that is smoothed to ``start``: near a tip from the parabola, else ``start``.
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


def load_clip(mocap: MocapSection) -> Clip:
    """Load the recorded motion of a scenario.

    Args:
        mocap: section ``people.motion``.

    Raises:
        ValueError: the file does not exist or is not valid; the message names the key, or file and line.
    """
    file = Path(mocap.file)
    if not os.path.isfile(file):
        raise ValueError(f"people.motion.file = {mocap.file!r}: no such file")
    if file.suffix.lower() == ".bvh":
        return Clip(read_bvh(file), mocap.start)
    return Clip(read_amc(file, read_asf(_skeleton(mocap, file))), mocap.start)


def _skeleton(mocap: MocapSection, file: Path) -> Path:
    if mocap.skeleton:
        skeleton = Path(mocap.skeleton)
        if not os.path.isfile(skeleton):
            raise ValueError(f"people.motion.skeleton = {mocap.skeleton!r}: no such file")
        return skeleton
    beside = sorted(path for path in file.parent.iterdir() if path.suffix.lower() == ".asf")
    if len(beside) != 1:
        raise ValueError(
            f"people.motion.file = {mocap.file!r}: expected one ASF file (the skeleton) beside the AMC file, found "
            f"{len(beside)}: set people.motion.skeleton to its name"
        )
    return beside[0]
