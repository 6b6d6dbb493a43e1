"""3D view of people over time: truth, estimates as bodies of capsules, cameras, objects and the floor of a trial.

Radii of bodies are about those of the median circumferences of men and women in ANSUR II (Gordon et al., 2014),
averaged along each limb: they make a person of joints recognisable, and measure nothing.

The trial is replayed for pictures: scene, detections and estimates, which tables of scores do not hold.
"""

from dataclasses import dataclass

import numpy as np

from mvpose import Detections, Estimate
from mvpose.arrays import Floats, Integers
from mvpose.report.palette import COCO17_LIMBS, css, person_color
from mvpose.report.view_3d import PYRAMID, Piece3D, Scene3D, Shape3D, Style3D, View3D, camera_pyramid, view_3d
from mvpose.skeleton import COCO17
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.pairing import pair
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import Trial
from simharness.types.truth import Truth


@dataclass(frozen=True)
class Replay:
    """Scene, truth, detections and estimates of one variant in a trial."""

    trial: Trial
    """The built scenario."""
    variant: str
    """Variant of the method."""
    time: Floats
    """Time of each frame, (T,), seconds."""
    truth: tuple[Truth, ...]
    """Truth of each frame, T."""
    detections: tuple[Detections, ...]
    """Detections of each frame, T."""
    estimates: tuple[Estimate, ...]
    """Estimates of the variant for each frame, T."""

    def owners(self, frame: int) -> Integers:
        """Return the true person of each estimate of a frame, (n,), -1 for a ghost."""
        estimate = self.estimates[frame]
        return pair(self.truth[frame].joints, estimate.joints).owners(len(estimate))


def replay(scenario: Scenario, variant: str) -> Replay:
    """Run one variant on a scenario again; the same scenario and code give the same result.

    Raises:
        ValueError: the scenario cannot be built any more, for example because a file that it names is missing.
    """
    result = run_trial(scenario, variants=[variant], until="estimate")
    recording = result.recording
    return Replay(
        result.trial, variant, recording.time, recording.truth, recording.detections, result.estimates[variant]
    )


MAX_FRAMES = 60
"""Frames of one view: those around the frame that it shows first."""

_MIDDLE = 0.55  # metres: height of the point that the view turns around
_PYRAMID = 0.34  # metres from a camera's centre to the base of its pyramid
_CAMERA, _OBJECT, _GRID = Style3D("--faint", 1.0), Style3D("--faint", 0.7), Style3D("--line", 1.0)
_TRUTH, _MISSED = Style3D("--ink", 1.5), Style3D("--ink", 1.5, dashed=True)
_NOBODY = Style3D("--line", rim="--faint")  # body where nobody was estimated
_HULL = Shape3D(lines=((0, 1), (0, 2), (0, 4), (3, 1), (3, 2), (3, 7), (5, 1), (5, 4), (5, 7), (6, 2), (6, 4), (6, 7)))

_LIMBS = (("shoulder", "elbow", 0.046), ("elbow", "wrist", 0.036), ("hip", "knee", 0.072), ("knee", "ankle", 0.048))
_SHOULDERS = [COCO17.index("left_shoulder"), COCO17.index("right_shoulder")]
_TRUNK = (*_SHOULDERS, COCO17.index("right_hip"), COCO17.index("left_hip"))
_FACE = list(range(5))
_HEAD, _NECK = 17, 18  # indices of the points that follow the joints

SKELETON = Shape3D(lines=tuple(COCO17_LIMBS))
"""Limbs of a person as lines."""

BODY = Shape3D(
    bodies=(
        *(
            ((COCO17.index(f"{side}_{one}"), COCO17.index(f"{side}_{other}")), radius)
            for one, other, radius in _LIMBS
            for side in ("left", "right")
        ),
        (_TRUNK, 0.085),
        ((_HEAD,), 0.098),
        ((_NECK, _HEAD), 0.052),
    )
)
"""Limbs, trunk, head and neck of a person with the points of :func:`body_points`."""


def skeleton_view_3d(replay: Replay, frame: int) -> View3D:
    """Return a view of the truth, the estimates, the cameras, the objects and the floor of a trial.

    Args:
        replay: the trial.
        frame: frame that the view shows first.
    """
    return view_3d(scene_of(replay, frame))


def scene_of(replay: Replay, frame: int) -> Scene3D:
    """Return what :func:`skeleton_view_3d` shows."""
    frames = _frames_around(frame, len(replay.time))
    rig, joints = replay.trial.exposures.believed_rig, replay.truth[frame].joints.reshape(-1, 3)
    pyramids = [camera_pyramid(camera, _PYRAMID) for camera in rig]
    floor = _floor(replay.trial.scenario.room.size[:2])
    objects = [solid.hull.corners for solid in replay.trial.scene.solids if solid.kind != "room"]
    return Scene3D(
        label="People in 3D: estimates as bodies, truth as thin lines, cameras as pyramids",
        center=_center(np.concatenate([replay.truth[each].joints.reshape(-1, 3) for each in frames]), rig.centers),
        fitted=np.concatenate([joints, *pyramids, *floor]),
        fixed=[
            Piece3D.of_lines(floor, _GRID),
            *(Piece3D(corners, _HULL, _OBJECT) for corners in objects),
            *(Piece3D(pyramid, PYRAMID, _CAMERA) for pyramid in pyramids),
        ],
        frames=[_people(replay, each) for each in frames],
        times=[float(replay.time[each]) for each in frames],
        first=frames.start,
        start=frame - frames.start,
    )


def body_points(joints: Floats) -> Floats:
    """Return the points of :data:`BODY`: the joints, the middle of the head, and the middle of the shoulders.

    Args:
        joints: joints, (J, 3), metres, the first 17 those of COCO-17; NaN where unknown.

    Returns:
        (19, 3) metres; NaN where unknown. The middle of the head is that of the known joints of the face.
    """
    face = joints[_FACE][np.isfinite(joints[_FACE]).all(axis=1)]
    head = face.mean(axis=0) if len(face) else np.full(3, np.nan)
    return np.vstack([joints[: len(COCO17.joints)], head, joints[_SHOULDERS].mean(axis=0)])


def _people(replay: Replay, frame: int) -> list[Piece3D]:
    """Return the estimates of a frame as bodies, and its true people as lines; with a pale body where missed."""
    owners, truth = replay.owners(frame).tolist(), replay.truth[frame].joints
    pieces = [
        Piece3D(body_points(joints), BODY, Style3D(css(person_color(owner))))
        for owner, joints in zip(owners, replay.estimates[frame].joints, strict=True)
    ]
    pieces += [Piece3D(body_points(joints), BODY, _NOBODY) for k, joints in enumerate(truth) if k not in owners]
    lines = [Piece3D(joints, SKELETON, _TRUTH if k in owners else _MISSED) for k, joints in enumerate(truth)]
    return [*pieces, *lines]


def _frames_around(frame: int, count: int) -> range:
    """Return up to :data:`MAX_FRAMES` frames of ``count`` with ``frame`` among them, in the middle where possible."""
    first = min(max(0, frame - MAX_FRAMES // 2), max(0, count - MAX_FRAMES))
    return range(first, min(count, first + MAX_FRAMES))


def _center(joints: Floats, centers: Floats) -> Floats:
    """Return the middle of the people's joints (n, 3); where none is known, that of the cameras' centres (V, 3)."""
    known = joints[np.isfinite(joints).all(axis=1)]
    points = known if len(known) else centers
    return np.array([*(points.min(axis=0) + points.max(axis=0))[:2] / 2, _MIDDLE])


def _floor(size: tuple[float, ...]) -> list[Floats]:
    """Return the lines of a grid of one metre around the middle of a room, and its edges."""
    half = np.array(size) / 2
    lines = []
    for axis in (0, 1):
        steps = np.arange(np.ceil(-half[axis]), half[axis] + 1e-9)
        for step in (-half[axis], half[axis], *steps.tolist()):
            ends = np.zeros((2, 3))
            ends[:, axis], ends[:, 1 - axis] = step, (-half[1 - axis], half[1 - axis])
            lines.append(ends)
    return lines
