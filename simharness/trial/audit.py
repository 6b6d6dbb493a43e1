"""The self-audit of every run: is what was filmed what was asked for, and does the truth fit the pictures?

Checked by other means than those that made it: projection by OpenCV, ids and depths of freshly drawn pictures. What
fails here is a fault of the harness, never of the method, and no score of such a run would mean anything.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose import Camera
from mvpose.arrays import Floats
from simharness.runtime.frame_pool import RunError
from simharness.scenario.sections.scenario import Faults, Scenario
from simharness.trial.stages.frame_tasks import studio_of
from simharness.types.sequence import Sequence
from simharness.types.views import Views
from simharness.types.visibility import Visibility
from simharness.world.rigs.shots import Shots
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback

_FRAMES = 3  # of a run are looked at closely
_PIXELS = 0.01  # between two projections of one point
_SHARE = 0.98  # of the visible joints must be found where they should be: outlines are ragged
_SIGMAS = 6.0  # an error of so many standard deviations is a mistake
_DEPTH = 0.04  # metres beside a joint's own radius: clothes and flat limbs
_WINDOW = 2  # pixels about a joint in which its person must be seen


class AuditError(RunError):
    """What was filmed is not what was asked for."""


def audit(scenario: Scenario, scene: Scene, shots: Shots, sequence: Sequence, views: Views) -> None:
    """Check a run before its detections are made.

    Args:
        scenario: what was asked for.
        scene: what was built.
        shots: when and with which lens every picture was taken.
        sequence: the truth at the frames' times.
        views: the truth in the pictures.

    Raises:
        AuditError: naming the check, the place, what was expected and what was found.
    """
    check_clocks(scenario.faults, shots, sequence.time)
    check_calibration(scenario.faults, shots)
    playback = Playback(scene)
    frames = np.unique(np.linspace(0, len(views) - 1, min(len(views), _FRAMES)).astype(int))
    if not shots.readout:  # a rolling shutter has no one moment to compare with
        for frame in map(int, frames):
            _check_projection(playback, shots, views, frame)
    if scenario.rendering.renderer != "rays":
        _check_pictures(scenario, playback, shots, views, frames)


def check_clocks(faults: Faults, shots: Shots, time: Floats) -> None:
    """Check that every picture was taken when the faults' dials allow.

    Raises:
        AuditError: a picture at another time, a dead camera that delivers, a frozen picture of a later time.
    """
    taken = shots.delivered
    nominal = time[np.where(taken, shots.source, 0)]
    late = np.where(taken, shots.time - nominal, 0.0)
    allowed = _SIGMAS * (faults.clock_offset + faults.clock_jitter) + 1e-9
    if np.abs(late).max(initial=0.0) > allowed:
        frame, view = map(int, np.unravel_index(np.abs(late).argmax(), late.shape))
        raise AuditError(
            f"clocks: the picture of view {view} in frame {frame} is {1000 * late[frame, view]:.3f} ms late; "
            f"faults.clock_offset and faults.clock_jitter allow {1000 * allowed:.3f} ms"
        )
    if (shots.source > np.arange(len(time))[:, None]).any():
        raise AuditError("clocks: a camera delivers a picture before it is taken")
    frozen = taken & (shots.source != np.arange(len(time))[:, None])
    for asked, found, what in (
        (faults.dropped > 0 or bool(faults.dead), not taken.all(), "faults.dropped and faults.dead"),
        (faults.frozen > 0, bool(frozen.any()), "faults.frozen"),
    ):
        if found and not asked:
            raise AuditError(f"clocks: pictures are missing or repeated, and {what} ask for none")
    for camera in faults.dead:
        if taken[:, camera].any() and not any(camera in pair for pair in faults.swapped):
            raise AuditError(f"clocks: camera {camera} delivers pictures, and faults.dead says that it is dead")


def check_calibration(faults: Faults, shots: Shots) -> None:
    """Check that the true cameras differ from the believed ones as much as the faults' dials allow, and no more.

    Raises:
        AuditError: a camera that is off by more.
    """
    swapped = {view for pair in faults.swapped for view in pair}
    frames = np.unique([0, len(shots.time) - 1])
    minutes = float(shots.time.max(initial=0.0) - min(shots.time.min(initial=0.0), 0.0)) / 60.0 + 1e-3
    for view, believed in enumerate(shots.believed):
        if view in swapped:
            continue
        for frame in map(int, frames):
            if not shots.delivered[frame, view]:
                continue
            true = shots.camera(frame, view)
            for what, off, allowed in (
                ("orientation, degrees", np.degrees(_angle(true.R @ believed.R.T)),
                 faults.rotation + faults.rotation_drift * minutes),
                ("position, metres", float(np.abs(true.center - believed.center).max()),
                 faults.translation + faults.translation_drift * minutes),
                ("focal length, logarithm of the ratio",
                 abs(float(np.log(true.K[0, 0] / believed.K[0, 0]))), faults.focal),
                ("principal point, pixels", float(np.abs(true.K[:2, 2] - believed.K[:2, 2]).max()), faults.center),
            ):  # fmt: skip
                if off > _SIGMAS * allowed + 1e-6:
                    raise AuditError(
                        f"calibration: camera {believed.name!r} in frame {frame} is off in its {what}, by {off:.3g}; "
                        f"the faults allow {_SIGMAS * allowed:.3g}"
                    )


def _angle(turn: Floats) -> float:
    """Of a rotation (3, 3), radians; exact where it is small."""
    return float(np.linalg.norm(cv2.Rodrigues(turn)[0]))


def _check_projection(playback: Playback, shots: Shots, views: Views, frame: int) -> None:
    for view in np.flatnonzero(shots.delivered[frame]):
        camera, said = shots.camera(frame, int(view)), views.pixels[frame, view]
        if not said.size:
            continue
        joints = playback.at(shots.time[frame, view]).joints
        expected = _projected(camera, joints)
        # Beyond the picture a lens may image nothing, which OpenCV does not ask.
        off = np.where(camera.inside(said), np.linalg.norm(said - expected, axis=-1), 0.0)
        if not (off <= _PIXELS).all():
            person, joint = map(int, np.unravel_index(np.nan_to_num(off, nan=np.inf).argmax(), off.shape))
            raise AuditError(
                f"projection: frame {frame}, view {view}, person {person}, joint {joint} is at "
                f"{said[person, joint].round(2).tolist()} px in the truth and OpenCV projects it to "
                f"{expected[person, joint].round(2).tolist()}"
            )


def _projected(camera: Camera, joints: Floats) -> Floats:
    flat = np.ascontiguousarray(joints.reshape(-1, 1, 3))
    pixels, _ = cv2.projectPoints(flat, cv2.Rodrigues(camera.R)[0], camera.t, camera.K, camera.distortion)
    return np.asarray(pixels, float).reshape(*joints.shape[:-1], 2)


def _check_pictures(
    scenario: Scenario, playback: Playback, shots: Shots, views: Views, frames: NDArray[np.int64]
) -> None:
    """Joints that are called visible must be seen as their person, about as deep as they lie."""
    studio = studio_of(scenario, playback)
    radii = [body.joint_radii for body in playback.scene.bodies]
    found, deep, count = 0, 0, 0
    for frame in map(int, frames):
        for view in map(int, np.flatnonzero(shots.delivered[frame])):
            persons, joints = np.nonzero(views.visibility[frame, view] == Visibility.VISIBLE)
            image, camera = studio.image(shots, frame, view), shots.camera(frame, view)
            where = playback.at(shots.time[frame, view]).joints
            for person, joint in zip(persons, joints, strict=True):
                column, row = np.floor(views.pixels[frame, view, person, joint] + 0.5).astype(int)
                window = np.s_[
                    max(row - _WINDOW, 0) : row + _WINDOW + 1, max(column - _WINDOW, 0) : column + _WINDOW + 1
                ]
                seen = image.ids[window] == person
                count += 1
                found += bool(seen.any())
                depth = float(camera.depth(where[person, joint]))
                gap = np.abs(image.depth[window][seen] - depth).min(initial=np.inf)
                deep += bool(gap <= radii[person][joint] + _DEPTH + 0.05 * depth)
    for what, right in (("shows its person at", found), ("is as deep as the surface at", deep)):
        if count and right < _SHARE * count:
            raise AuditError(
                f"pictures: of {count} visible joints in frames {frames.tolist()} only {right} lie where the picture "
                f"{what} their pixel; expected {_SHARE:.0%} or more"
            )
