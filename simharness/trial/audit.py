"""Audit of a simulated trial: it must be what its scenario describes, and its truth must fit its pictures.

The checks use other code than the simulation: projection by OpenCV, and ids and depths of newly rendered pictures. A
failed check is a fault of the harness, never of the method, and scores of such a trial would have no meaning.
"""

import cv2
import numpy as np

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.commands.errors import RunError
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.capture import picture_source_of
from simharness.types.random_streams import stream
from simharness.types.sequence import Sequence
from simharness.types.views import Views, Visibility
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback

_FRAMES = 3  # frames in which projections are checked
_PICTURES, _PICTURES_LEAST = 0.01, 3  # share and least number of the pictures that are rendered again
_DEVIATIONS = 4.0  # allowed deviation of a count from its expected value, in standard deviations
_PIXELS = 0.01  # allowed distance between two projections of one point
_SHARE = 0.98  # share of visible joints that must lie on their person; outlines have pixel steps
_SIGMAS = 6.0  # largest allowed error, in standard deviations
_DEPTH = 0.04  # metres added to the radius of a joint, for clothes and flat limbs
_WINDOW = 2  # pixels around a joint in which its person must be visible


class AuditError(RunError):
    """Failed check: the simulated trial is not what its scenario describes."""


def audit(
    scenario: Scenario, scene: Scene, exposures: ExposureSchedule, sequence: Sequence, views: Views, *, every: int = 1
) -> None:
    """Check a simulated trial before its detections are made.

    Clocks and calibration are checked in all frames. Projections are checked in three frames, and one per cent of the
    rendered pictures, at least three: the audit costs less than two per cent of a trial.

    Args:
        scenario: the scenario that was requested.
        scene: the scene that was built.
        exposures: time and camera of every picture.
        sequence: true poses at the frames' times.
        views: truth in the pictures.
        every: step between the frames that were filmed.

    Raises:
        AuditError: a failed check, with its place, the expected and the actual value.
    """
    check_clocks(scenario.faults, exposures, sequence.time, cameras=scenario.cameras, period=1.0 / scenario.rate)
    check_calibration(scenario.faults, exposures)
    playback = Playback(scene)
    frames = np.unique(np.linspace(0, len(views) - 1, min(len(views), _FRAMES)).astype(int) // every * every)
    if not exposures.readout:  # a picture of a rolling shutter has no single time
        for frame in map(int, frames):
            _check_projection(playback, exposures, views, frame)
    if scenario.rendering.renderer != "rays":
        _check_pictures(scenario, playback, exposures, views, every)


def sampled_pictures(exposures: ExposureSchedule, seed: int, every: int = 1) -> list[tuple[int, int]]:
    """Return frame and view of the delivered pictures that an audit renders again: one per cent, at least three."""
    delivered = np.argwhere(exposures.delivered[::every]) * [every, 1]
    count = max(_PICTURES_LEAST, round(_PICTURES * len(delivered)))
    chosen = stream(seed, "audit", "pictures").permutation(len(delivered))[:count]
    return [(int(frame), int(view)) for frame, view in delivered[np.sort(chosen)]]


def check_clocks(
    faults: FaultsSection,
    exposures: ExposureSchedule,
    time: Floats,
    *,
    cameras: CamerasSection | None = None,
    period: float = 0.0,
) -> None:
    """Check that the time of every picture agrees with the parameters of sections [faults] and [cameras].

    Args:
        faults: section [faults].
        exposures: time of every picture.
        time: time of every frame, (T,), seconds.
        cameras: section [cameras]; by default all cameras are triggered together.
        period: time between frames, seconds.

    Raises:
        AuditError: a picture at another time, a dead camera that delivers, a frozen picture of a later time.
    """
    cameras = cameras or CamerasSection()
    taken = exposures.delivered
    nominal = time[np.where(taken, exposures.source, 0)]
    late = np.where(taken, exposures.time - nominal, 0.0)
    free = 0.5 * period if cameras.trigger == "free" else 0.0
    allowed = free + _SIGMAS * (faults.clock_offset + faults.clock_jitter) + 1e-9
    if np.abs(late).max(initial=0.0) > allowed:
        frame, view = map(int, np.unravel_index(np.abs(late).argmax(), late.shape))
        raise AuditError(
            f"clocks: the picture of view {view} in frame {frame} is {1000 * late[frame, view]:.3f} ms late; "
            f"faults.clock_offset, faults.clock_jitter and cameras.trigger allow {1000 * allowed:.3f} ms"
        )
    if (exposures.source > np.arange(len(time))[:, None]).any():
        raise AuditError("clocks: a camera delivers a picture before it is taken")
    frozen = taken & (exposures.source != np.arange(len(time))[:, None])
    for expected, present, keys in (
        (
            faults.dropped > 0 or bool(faults.dead) or max(cameras.every, default=1) > 1,
            not taken.all(),
            "faults.dropped, faults.dead or cameras.every",
        ),
        (faults.frozen > 0, bool(frozen.any()), "faults.frozen"),
    ):
        if present and not expected:
            raise AuditError(f"clocks: pictures are missing or repeated, but the scenario does not set {keys}")
    for camera in faults.dead:
        if taken[:, camera].any() and not any(camera in pair for pair in faults.swapped):
            raise AuditError(f"clocks: camera {camera} delivers pictures, but faults.dead contains it")


def check_calibration(faults: FaultsSection, exposures: ExposureSchedule) -> None:
    """Check that true and believed cameras differ by no more than the parameters of section [faults] allow.

    Raises:
        AuditError: a camera with a larger difference.
    """
    swapped = {view for pair in faults.swapped for view in pair}
    frames = np.unique([0, len(exposures.time) - 1])
    minutes = float(exposures.time.max(initial=0.0) - min(exposures.time.min(initial=0.0), 0.0)) / 60.0 + 1e-3
    for view, believed in enumerate(exposures.believed_rig):
        if view in swapped:
            continue
        for frame in map(int, frames):
            if not exposures.delivered[frame, view]:
                continue
            true = exposures.camera(frame, view)
            for quantity, difference, allowed in (
                ("orientation, degrees", np.degrees(float(np.linalg.norm(cv2.Rodrigues(true.R @ believed.R.T)[0]))),
                 faults.rotation + faults.rotation_drift * minutes),
                ("position, metres", float(np.abs(true.center - believed.center).max()),
                 faults.translation + faults.translation_drift * minutes),
                ("focal length, logarithm of the ratio",
                 abs(float(np.log(true.K[0, 0] / believed.K[0, 0]))), faults.focal),
                ("principal point, pixels", float(np.abs(true.K[:2, 2] - believed.K[:2, 2]).max()), faults.center),
            ):  # fmt: skip
                if difference > _SIGMAS * allowed + 1e-6:
                    raise AuditError(
                        f"calibration: camera {believed.name!r} in frame {frame} differs in {quantity} by "
                        f"{difference:.3g}; "
                        f"the faults allow {_SIGMAS * allowed:.3g}"
                    )


def _check_projection(playback: Playback, exposures: ExposureSchedule, views: Views, frame: int) -> None:
    for view in np.flatnonzero(exposures.delivered[frame]):
        camera, pixels = exposures.camera(frame, int(view)), views.pixels[frame, view]
        if not pixels.size:
            continue
        state = playback.at(exposures.time[frame, view])
        shown = np.isfinite(pixels).any(axis=(-1, -2)) | (views.boxes[frame, view] > 0).any(axis=-1)
        if (shown & ~state.present).any():
            person = int((shown & ~state.present).argmax())
            raise AuditError(f"presence: frame {frame}, view {view} shows person {person}, who is absent")
        expected = np.where(state.present[:, None, None], _projected(camera, state.joints), np.nan)
        # OpenCV also projects points outside the picture that the lens does not image.
        error = np.where(camera.inside(pixels), np.linalg.norm(pixels - expected, axis=-1), 0.0)
        if not (error <= _PIXELS).all():
            person, joint = map(int, np.unravel_index(np.nan_to_num(error, nan=np.inf).argmax(), error.shape))
            raise AuditError(
                f"projection: frame {frame}, view {view}, person {person}, joint {joint} is at "
                f"{pixels[person, joint].round(2).tolist()} px in the truth and OpenCV projects it to "
                f"{expected[person, joint].round(2).tolist()}"
            )


def _projected(camera: Camera, joints: Floats) -> Floats:
    flat = np.ascontiguousarray(joints.reshape(-1, 1, 3))
    pixels, _ = cv2.projectPoints(flat, cv2.Rodrigues(camera.R)[0], camera.t, camera.K, camera.distortion)
    return np.asarray(pixels, float).reshape(*joints.shape[:-1], 2)


def _check_pictures(
    scenario: Scenario, playback: Playback, exposures: ExposureSchedule, views: Views, every: int
) -> None:
    """Check in sampled pictures that visible joints show their person, at about the depth of the joint."""
    picture_source = picture_source_of(scenario, playback)
    radii = [body.joint_radii for body in playback.scene.bodies]
    shown, deep, count = 0, 0, 0
    pictures = sampled_pictures(exposures, scenario.seed, every)
    for frame, view in pictures:
        persons, joints = np.nonzero(views.visibility[frame, view] == Visibility.VISIBLE)
        image, camera = picture_source.image(exposures, frame, view), exposures.camera(frame, view)
        positions = playback.at(exposures.time[frame, view]).joints
        for person, joint in zip(persons, joints, strict=True):
            column, row = np.floor(views.pixels[frame, view, person, joint] + 0.5).astype(int)
            window = np.s_[max(row - _WINDOW, 0) : row + _WINDOW + 1, max(column - _WINDOW, 0) : column + _WINDOW + 1]
            surface = image.ids[window] == person
            count += 1
            shown += bool(surface.any())
            depth = float(camera.depth(positions[person, joint]))
            gap = np.abs(image.depth[window][surface] - depth).min(initial=np.inf)
            deep += bool(gap <= radii[person][joint] + _DEPTH + 0.05 * depth)
    allowed = (1.0 - _SHARE) * count
    allowed += _DEVIATIONS * np.sqrt(allowed)  # of few joints some more may fail by chance
    for relation, correct in (("shows its person at", shown), ("is as deep as the surface at", deep)):
        if count - correct > allowed:
            raise AuditError(
                f"pictures: of {count} visible joints in {len(pictures)} sampled pictures only {correct} lie where the "
                f"picture {relation} their pixel; expected {count - int(allowed)} or more"
            )
