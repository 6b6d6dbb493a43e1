"""Mistakes that leave the agreement of the cameras as it is: unit, vertical axis of the world, size of the pictures.

They show in the people: adults have known sizes, stand upright more often than not, and lie within the pictures.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.consistency import Reading
from mvpose.calibration.findings import Finding
from mvpose.calibration.mends import AXES, axis_vector
from mvpose.calibration.rig_size import Bodies
from mvpose.calibration.sightings import Sightings
from mvpose.calibration.tracklets import Tracklets
from mvpose.camera import Camera, Rig

_UNITS = {
    0.001: "divided by 1000 twice (or metres taken for millimetres)",
    0.01: "divided by 100 (or metres taken for centimetres)",
    0.1: "divided by 10",
    0.0254: "metres taken for inches",
    10.0: "in decimetres",
    39.37: "in inches",
    100.0: "in centimetres",
    1000.0: "in millimetres",
    3.281: "in feet",
}
_SAME_UNIT = 1.3  # factor within which people's size names a unit: adults and children differ by more from other sizes
_ODD = 1.6  # times as large or as small as adults: an alarm; a child of six has two thirds of an adult's size
_UNUSUAL = 1.25  # a note

_TILTED = float(np.radians(35.0))  # between people and the vertical: people who exercise lean, but not all and always
_NEAR_AXIS = float(np.radians(15.0))  # an axis of the world this near to the people is the vertical
_ALIGNED = 0.7  # length of the mean of unit vectors from hips to shoulders: 1 for parallel trunks, 0 for random ones
_FEWEST_TRUNKS = 20
_ANKLES = ("left_ankle", "right_ankle")
_SHOULDERS, _HIPS = ("left_shoulder", "right_shoulder"), ("left_hip", "right_hip")
_BELOW = 0.3  # metres below the lowest feet, where no camera stands

_OFF_CENTER = 0.3  # of the picture: principal points farther from its middle are of another picture
_CENTERED = 0.12  # those of pictures that are not cropped are nearer
_SIZES = (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 1.0, 4 / 3, 1.5, 2.0, 3.0, 4.0)


def unit_findings(reading: Reading, ratio: float) -> tuple[Reading, list[Finding]]:
    """Return the reading in metres, and what the size of people says about the unit.

    Args:
        reading: cameras whose scale is to be checked.
        ratio: how many times as large as adults people are under it; NaN if unknown.
    """
    if not np.isfinite(ratio) or 1 / _UNUSUAL < ratio < _UNUSUAL:
        return reading, []
    size = {"times_adults": float(ratio)}
    interval = {"times_adults": (float(ratio / 1.15), float(ratio * 1.15))}
    if 1 / _ODD < ratio < _ODD:
        text = f"people are {ratio:.2f} times as large as adults: they are children or very tall, or the scale of the "
        text += "calibration (the squares of the board) is wrong"
        mend = "measure a distance between two cameras; the true over the calibrated one is the FACTOR of "
        mend += "`mvpose repair --mend unit:FACTOR`"
        cost = abs(float(np.log(ratio))) * 0.3
        return reading, [Finding("wrong-unit", text, "note", 0.5, None, None, size, interval, cost, mend)]
    factor = min(_UNITS, key=lambda each: abs(np.log(each / ratio)))
    named = abs(np.log(factor / ratio)) < np.log(_SAME_UNIT)
    scale = factor if named else float(f"{ratio:.2g}")
    cameras = reading.cameras.copy()
    cameras[:, 14:17] /= scale
    text = f"the translations of all cameras are {_UNITS[factor] if named else 'not in metres'}: "
    text += f"people are {ratio:.3g} times as large as adults"
    repair = ("--mend", f"unit:{1 / scale:.6g}")
    alarm = Finding("wrong-unit", text, "alarm", 0.99, None, None, size, interval, 1.0, repair=repair)
    return replace(reading, cameras=cameras), [alarm]


def size_findings(rig: Sequence[Camera], tracklets: Tracklets, names: Sequence[str]) -> list[Finding]:
    """Return the cameras whose stated size of pictures is not that of the pictures, as one finding if all are.

    The principal point is near the middle of the picture, and keypoints are inside of it.

    Args:
        rig: cameras, read rightly otherwise.
        tracklets: detections in pixels of its pictures.
        names: names of the cameras.
    """
    sizes = {}
    for view, camera in enumerate(rig):
        keypoints = tracklets.keypoints[tracklets.view == view]
        better = _better_size(camera, keypoints[np.isfinite(keypoints[..., 0])])
        if better is not None:
            sizes[view] = better
    if not sizes:
        return []
    text = "the size of the pictures of {} is stated as {} x {}, but is {} x {}, by principal points and keypoints"
    if len(sizes) == len(rig) and len(set(sizes.values())) == 1:
        width, height = sizes[0]
        text, repair = text.format("all cameras", *rig[0].size, width, height), ("--mend", f"size:{width}x{height}")
        return [Finding("picture-size", text, "alarm", 0.97, cost=0.05, repair=repair)]
    findings = []
    for view, (width, height) in sizes.items():
        of_view = text.format(names[view], *rig[view].size, width, height)
        repair, cost = ("--mend", f"size:{width}x{height}@{names[view]}"), 0.05 / len(rig)
        findings.append(Finding("picture-size", of_view, "alarm", 0.97, names[view], view, cost=cost, repair=repair))
    return findings


def _better_size(camera: Camera, keypoints: Floats) -> tuple[int, int] | None:
    """Return the size of which the principal point is the middle, if the stated one cannot be right; else None."""
    middle, stated = camera.K[:2, 2], np.array(camera.size, float)
    reach = np.quantile(keypoints, 0.995, axis=0) if len(keypoints) else np.zeros(2)
    if not _off(middle, stated) > _OFF_CENTER:
        return None
    sides = [factor * each for factor in _SIZES for each in (stated, stated[::-1])]
    best = min(sides, key=lambda each: _off(middle, each))
    if _off(middle, best) > _CENTERED or (reach > 1.02 * best).any():
        return None
    width, height = np.rint(best).astype(int).tolist()
    return width, height


def _off(middle: Floats, size: Floats) -> float:
    """Return how far a principal point is from the middle of a picture, as a share of its size."""
    return float(np.abs(middle / size - 0.5).max())


def world_findings(
    rig: Rig, sightings: Sightings, first: Integers, joints: Floats, up: str | None
) -> tuple[list[Finding], list[str]]:
    """Return whether the world stands as it should, and a line with the height of the floor.

    Pictures do not show how the world is turned: a calibration whose board was taken for its mirror image has the same
    reprojection errors, with all cameras below the floor and people on their heads.

    Args:
        rig: cameras, read rightly otherwise.
        sightings: matched keypoints.
        first: a sighting of each joint, (G,).
        joints: places of joints, (G, 3), metres; NaN where unknown.
        up: axis of the world that points up by the user, "z", "-y" ...; None for z.
    """
    wanted = (*_SHOULDERS, *_HIPS, *_ANKLES)
    if not set(wanted) <= set(sightings.skeleton.joints):
        return [], []
    bodies = Bodies.of_joints(sightings, first, joints)
    trunks = bodies.upright
    if len(trunks) < _FEWEST_TRUNKS or np.linalg.norm(trunks.mean(axis=0)) < _ALIGNED:
        return [], []
    mean = trunks.mean(axis=0) / np.linalg.norm(trunks.mean(axis=0))
    vertical = axis_vector(up or "z")
    angle = float(np.arccos(np.clip(mean @ vertical, -1.0, 1.0)))
    if angle > _TILTED:
        return [_turned(mean, vertical, angle, up)], []
    ankles = np.concatenate([bodies.joint(joint) for joint in _ANKLES]) @ vertical
    ankles = ankles[np.isfinite(ankles)]
    if len(ankles) < _FEWEST_TRUNKS:
        return [], []
    floor = float(np.quantile(ankles, 0.05))
    low = [view for view in range(len(rig)) if rig.centers[view] @ vertical < floor - _BELOW]
    line = f"people's feet are at {up or 'z'} = {floor:.2f} m, cameras between {(rig.centers @ vertical).min():.2f} m "
    line += f"and {(rig.centers @ vertical).max():.2f} m"
    if len(low) <= 0.5 * len(rig):
        return [], [line]
    text = f"{len(low)} of {len(rig)} cameras are below the floor on which people walk (feet at {floor:.2f} m): the "
    text += "calibration is mirrored"
    mend = "calibrate again, with views of the board from the side: flat ones fit its mirror image as well"
    return [Finding("world-turned", text, "alarm", 0.95, cost=1.0, mend=mend)], [line]


def _turned(mean: Floats, vertical: Floats, angle: float, up: str | None) -> Finding:
    """Return the finding of a world in which people stand along another direction, (3,), than the vertical."""
    near = max(AXES, key=lambda axis: float(axis_vector(axis) @ mean))
    on_axis = np.arccos(min(float(axis_vector(near) @ mean), 1.0)) < _NEAR_AXIS
    where = f"the {near} axis" if on_axis else f"({', '.join(f'{each:.2f}' for each in mean)})"
    axis = near if on_axis else ",".join(f"{each:.4f}" for each in mean)
    if np.degrees(angle) > 150.0:
        text = f"the world is upside down: people stand on their heads along {up or 'z'}"
        text += ", and what should be above the floor is below it (a board that was taken for its mirror image?)"
    else:
        text = f"people stand along {where} of the world, not along {up or 'z'}: {np.degrees(angle):.0f} degrees off"
    wrong = f"--up={up} is wrong: " if up is not None else ""
    mend = f"{wrong}give --up={near} instead" if on_axis else f"{wrong}calibrate the floor again"
    size = {"degrees": float(np.degrees(angle))}
    if up is not None:
        return Finding("world-turned", text, "alarm", 0.97, size=size, cost=0.5, mend=mend)
    return Finding("world-turned", text, "alarm", 0.97, size=size, cost=0.5, repair=("--mend", f"up:{axis}"))
