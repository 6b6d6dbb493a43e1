"""Export of a trial for the rerun viewer (https://rerun.io): truth and estimates in 3D and in the pictures."""

import importlib.util
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.report.palette import COCO17_LIMBS, TRUTH, Color, person_color
from simharness.capture.picture import ScenePictures
from simharness.outputs.study.skeleton_view_3d import Replay
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

_THICK, _THIN = 0.02, 0.006  # metres, radii of estimated and of true limbs
_DOT = 3.0  # pixels, radius of a keypoint
MOST_PICTURES = 1000
"""Pictures of a recording: about 60 MB."""

_QUALITY = 80  # of JPEG
_IMAGE_PLANE = 0.4  # metres from a camera's centre to its image plane


def write_rerun(replay: Replay, path: Path) -> None:
    """Write a trial as an ``.rrd`` file.

    The world is in metres, z up. ``world/truth/person0`` and so on hold the true limbs, ``world/estimates`` the limbs
    of every estimate in the colour of its person (grey: a ghost). ``world/cameras/NAME`` are the cameras of the
    believed rig, with their pictures, and with ``detections`` and ``truth`` in their pixels. The timelines are ``time``
    in seconds, and ``frame``. Of long trials every n-th frame has pictures, so that there are at most
    :data:`MOST_PICTURES`; a trial that was run without pictures is rasterised.

    Raises:
        ValueError: the rerun SDK is not installed, or the file cannot be written.
    """
    require_sdk()
    import rerun

    partial = path.with_name(f".{path.name}.partial")
    _check_writable(partial)
    recording = rerun.RecordingStream("simharness", recording_id=f"{replay.trial.scenario.name}-{replay.variant}")
    recording.save(partial)
    recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _log_still(recording, replay)
    step = max(1, -(-len(replay.time) * len(replay.trial.exposures.believed_rig) // MOST_PICTURES))
    source = picture_source_of(replay.trial.scenario, Playback(replay.trial.scene))
    for frame, time in enumerate(replay.time):
        recording.set_time("time", duration=float(time))
        recording.set_time("frame", sequence=frame)
        _log_frame(recording, replay, frame)
        if frame % step == 0:
            _log_pictures(recording, replay, source, frame)
    recording.flush()
    recording.disconnect()
    partial.replace(path)


def require_sdk() -> None:
    """Check that the rerun SDK is installed.

    Raises:
        ValueError: the SDK is missing; the message has the command to install it.
    """
    if importlib.util.find_spec("rerun") is None:
        raise ValueError("--rerun: needs the rerun SDK, which is not installed: pip install -e '.[viewer]'")


def _check_writable(path: Path) -> None:
    """Check that a file can be written: the SDK would only log the error."""
    try:
        path.open("wb").close()
    except OSError as error:
        raise ValueError(f"--rerun {path}: cannot be written: {error.strerror}") from None


def _log_still(recording: Any, replay: Replay) -> None:
    """Log the cameras and the static objects."""
    import rerun

    for camera in replay.trial.exposures.believed_rig:
        place = f"world/cameras/{camera.name}"
        pose = rerun.Transform3D(translation=camera.center, mat3x3=camera.R.T)
        eye = rerun.Pinhole(
            image_from_camera=camera.K,
            resolution=camera.size,
            camera_xyz=rerun.ViewCoordinates.RDF,
            image_plane_distance=_IMAGE_PLANE,
        )
        recording.log(place, pose, eye, static=True)
    for solid in replay.trial.scene.solids:
        if solid.kind != "room" and solid.trajectory is None:
            mesh = rerun.Mesh3D(
                vertex_positions=solid.mesh.vertices, triangle_indices=solid.mesh.faces, albedo_factor=(150, 150, 150)
            )
            recording.log(f"world/things/{solid.name}", mesh, static=True)


def _log_frame(recording: Any, replay: Replay, frame: int) -> None:
    import rerun

    truth, detections, estimate = replay.truth[frame], replay.detections[frame], replay.estimates[frame]
    for person, joints in enumerate(truth.joints):
        thin = rerun.LineStrips3D(_limbs(joints), colors=TRUTH, radii=_THIN)
        recording.log(f"world/truth/person{person}", thin)
    owners = replay.owners(frame)
    strips: list[Floats] = []
    colors: list[Color] = []
    for joints, owner in zip(estimate.joints, owners.tolist(), strict=True):
        limbs = _limbs(joints)
        strips += limbs
        colors += [person_color(owner)] * len(limbs)
    recording.log("world/estimates", rerun.LineStrips3D(strips, colors=colors, radii=_THICK))
    assigned = np.append(owners, -1)[estimate.matching.labels_of(len(detections))]
    for view, camera in enumerate(replay.trial.exposures.believed_rig):
        place = f"world/cameras/{camera.name}"
        points, shades = _keypoints(detections.keypoints, np.flatnonzero(detections.view == view), assigned)
        recording.log(f"{place}/detections", rerun.Points2D(points, colors=shades, radii=_DOT))
        drawn = [limb for pixels in truth.pixels[view] for limb in _limbs(pixels)]
        recording.log(f"{place}/truth", rerun.LineStrips2D(drawn, colors=TRUTH))


def _log_pictures(recording: Any, replay: Replay, source: ScenePictures, frame: int) -> None:
    import rerun

    for view, camera in enumerate(replay.trial.exposures.believed_rig):
        bgr = cv2.cvtColor(source.picture(replay.trial.exposures, frame, view), cv2.COLOR_RGB2BGR)
        done, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        if not done:
            raise RuntimeError(f"OpenCV cannot encode a picture of shape {bgr.shape} as JPEG")
        picture = rerun.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg")
        recording.log(f"world/cameras/{camera.name}", picture)


def _limbs(joints: Floats) -> list[Floats]:
    """Return the limbs whose two joints have a position, (2, D) each."""
    known = np.asarray(np.isfinite(joints).all(axis=1))
    return [joints[[a, b]] for a, b in COCO17_LIMBS if known[a] and known[b]]


def _keypoints(keypoints: Floats, indices: NDArray[np.intp], assigned: NDArray[np.int64]) -> tuple[Floats, list[Color]]:
    """Return the detected keypoints of one view, (n, 2), and the colours of their assigned people.

    Args:
        keypoints: keypoints of all detections, (m, J, 2) pixels.
        indices: detections of the view, (k,).
        assigned: person of each detection, (m,), -1 for none.
    """
    points = keypoints[indices]
    detection, joint = np.nonzero(np.isfinite(points).all(axis=-1))
    people = np.asarray(assigned[indices])[detection]
    return points[detection, joint], [person_color(person) for person in people.tolist()]
