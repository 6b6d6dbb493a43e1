"""Extrinsics of a rig from nothing but lenses and people: the people are the board.

The poses of pairs of cameras (:mod:`.view_pairs`) are edges of a graph. Its spanning tree of greatest evidence puts all
cameras into one world; rotations and then centres are averaged over all edges that agree with it (robustly: Hartley et
al., "Rotation Averaging", IJCV 2013). From there the rig is one that is believed to some degrees, which the repair
(:mod:`.repair`) matches over seconds and adjusts, until it stays as it is. The people also give what pictures do not
show: their stature the unit, their feet the floor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats
from mvpose.calibration.adjustment import shared_joints
from mvpose.calibration.calibration_prior import Prior
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.findings import camera_names
from mvpose.calibration.floor import floor_of
from mvpose.calibration.normal_equations import PARAMETERS, normal_equations, with_errors
from mvpose.calibration.pieces import cut_into_windows
from mvpose.calibration.repair import NARROW, Repair, repair
from mvpose.calibration.rig_size import Bodies, relative_size, resized
from mvpose.calibration.sightings import sightings_of
from mvpose.calibration.sufficiency import RECORD, travelled
from mvpose.calibration.tracklet_matching import match_tracklets
from mvpose.calibration.tracklets import Tracklets, chosen_frames, link
from mvpose.calibration.view_pairs import RelativePose, relative_poses
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.reconstruction.bone_length_prior import STATURE, STATURE_DEVIATION

_FAR = np.radians(15.0)  # of an edge from the average, beyond which it is wrong
_LEAST_AGREEMENT = 0.75
"""Agreement of two views that see the same people: .87 and more for right poses of simulated cameras."""
_ROUNDS = 50
_PRIOR = Prior(float(np.radians(2.0)), 0.2)  # of what averaging leaves
_MOST_TURNS = 6
_STAYS = (float(np.radians(0.02)), 0.002)  # rad, m: changes of a repair that is at its end
_LEAST_TRAVELLED = 1.0  # metres, all people together
_SPACING = 0.2  # seconds between the frames in which people show size and floor
_STATURES = (0.5, 2.5)  # metres


@dataclass(frozen=True)
class PeopleCalibration:
    """Extrinsics found from people."""

    rig: Rig
    """The cameras: metres, z up from the floor."""
    repair: Repair
    """The last adjustment, with uncertainties, clocks and residuals; its world is another one."""
    people: int
    """People whom two cameras or more see."""
    size_sigma: float
    """Standard deviation of the size of the rig, as a fraction of it; 0 where a distance was measured."""
    warnings: tuple[str, ...]
    """What the people do not determine well."""


def calibrate_from_people(
    rig: Rig,
    frames: Sequence[Detections],
    *,
    period: float = 0.04,
    stature: float = STATURE,
    distance: tuple[str, str, float] | None = None,
) -> PeopleCalibration:
    """Return the extrinsics of cameras that see people who move.

    Args:
        rig: cameras, of which only the lenses, the sizes of pictures and the names are used.
        frames: detections of each frame, all views; clocks differ by a tenth of a second at most.
        period: seconds between frames whose detections carry no time.
        stature: mean stature of the people, metres, which decides the size of the rig.
        distance: names of two cameras and the distance between their lenses, metres, which decides it instead.

    Raises:
        ValueError: the people do not determine the cameras; the message says which, and what to record. Also a stature
            or a distance that is none.
    """
    if not _STATURES[0] < stature < _STATURES[1]:
        raise ValueError(f"the stature must be between {_STATURES[0]} and {_STATURES[1]} m, got {stature:g}")
    names = camera_names(rig)
    measured = _views(names, distance) if distance else None
    if len(rig) < 3:
        raise ValueError(
            "cannot tell: nothing confirms the poses of two cameras; add a third that sees the same people"
        )
    tracklets = link(rig, frames, period=period)
    if not len(tracklets):
        raise ValueError(f"cannot tell: there are no detections; {RECORD}")
    consistency = Consistency(cut_into_windows(tracklets))
    result = _settled(_start(rig, tracklets, consistency), frames, period)
    found, warnings = result.rig, list(result.held)
    reading = Reading.as_given(found.packed)
    agreement = consistency.agreement(reading)
    apart = [f"{names[v]} ({agreement[v]:.2f})" for v in np.flatnonzero(agreement < _LEAST_AGREEMENT)]
    if apart:
        raise ValueError(
            f"no poses explain the detections of camera {', '.join(apart)} (agreement with the others, expected "
            f"{_LEAST_AGREEMENT} or more): check that all cameras film the same people at the same time, and the lenses"
        )
    bodies = _bodies(found, tracklets)
    size, _ = relative_size(consistency, reading, tracklets.skeleton)
    sigma = STATURE_DEVIATION
    if measured is not None and distance is not None:
        factor, sigma = distance[2] / float(np.linalg.norm(np.subtract(*found.centers[list(measured)]))), 0.0
    elif np.isfinite(size):
        factor = stature / STATURE / size
    else:
        raise ValueError(
            "cannot tell the size of the rig: too few limbs are seen whole to measure people; measure the distance of "
            "two cameras, or record people from head to foot"
        )
    middle = found.centers.mean(axis=0)
    found, bodies = resized(found, factor), replace(bodies, joints=middle + factor * (bodies.joints - middle))
    moved = sum(travelled(bodies.middle("hip")[bodies.person == each]) for each in np.unique(bodies.person))
    if moved < _LEAST_TRAVELLED:
        raise ValueError(f"cannot tell: people stood still (they moved by {moved:.1f} m in all); {RECORD}")
    floor = floor_of(bodies)
    if floor is None:
        warnings.append("people do not show which way is up: z is not the vertical; record people who stand and walk")
    else:
        found = floor.leveled(found)
        if not floor.feet:
            warnings.append("too few steps are seen: the floor is that below the hips of adults who stand")
    return PeopleCalibration(found, result, result.people, sigma, tuple(warnings))


def _views(names: Sequence[str], distance: tuple[str, str, float]) -> tuple[int, int]:
    """Return the views of the two cameras of a distance."""
    one, other, metres = distance
    for name in (one, other):
        if name not in names:
            raise ValueError(f"the distance names camera {name!r}; expected two of {', '.join(names)}")
    if one == other or not 0.0 < metres < np.inf:
        raise ValueError(f"the distance must be that of two cameras, in metres above 0, got {one}, {other}, {metres:g}")
    return names.index(one), names.index(other)


def _start(rig: Rig, tracklets: Tracklets, consistency: Consistency) -> Rig:
    """Return the rig by pairs of cameras."""
    edges = [e for e in relative_poses(rig, tracklets, consistency) if e.agreement >= _LEAST_AGREEMENT]
    R, centers, known = averaged(edges, len(rig))
    if not known.all():
        alone = ", ".join([name for name, seen in zip(camera_names(rig), known, strict=True) if not (edges and seen)])
        raise ValueError(f"cannot tell: camera {alone} sees no people whom the others see at the same time; {RECORD}")
    return Rig([replace(c, R=turn, t=-turn @ x) for c, turn, x in zip(rig, R, centers, strict=True)])


def _settled(rig: Rig, frames: Sequence[Detections], period: float) -> Repair:
    """Return the repair of a rig that has no further effect.

    Raises:
        ValueError: the repair is refused.
    """
    options: dict[str, Any] = {"period": period, "prior": _PRIOR}
    for _ in range(_MOST_TURNS):
        result = repair(rig, frames, **options)
        if result.refused:
            raise ValueError(result.refused)
        rig = result.rig
        turns, shifts = (np.abs(result.corrections[:, part]).max() for part in (slice(0, 3), slice(3, 6)))
        if turns < _STAYS[0] and shifts < _STAYS[1]:
            break
    return result


def _bodies(rig: Rig, tracklets: Tracklets) -> Bodies:
    """Return the people in frames a fifth of a second apart."""
    sightings = sightings_of(tracklets, match_tracklets(rig, tracklets, NARROW).person)
    sightings = sightings.select(chosen_frames(tracklets, spacing=_SPACING)[sightings.frame])
    joints, rows = shared_joints(sightings)
    cameras = with_errors(rig.packed, np.zeros(PARAMETERS * len(rig)))
    return Bodies.of_joints(sightings, rows[joints.start[:-1]], normal_equations(cameras, joints).joints)


def averaged(edges: Sequence[RelativePose], views: int) -> tuple[Floats, Floats, Bools]:
    """Return rotations (V, 3, 3) and centres (V, 3) of cameras in the world of the first one of the largest part.

    Returns:
        Poses, and the cameras that have one, (V,).
    """
    weights = np.zeros((views, views))
    of_pair = {each.views: each for each in edges}
    for each in edges:
        weights[each.views] = -each.evidence
    tree = minimum_spanning_tree(weights)
    degree = -(weights + weights.T).sum(axis=1)
    order, before = breadth_first_order(tree, int(degree.argmax()), directed=False)
    R, centers, known = np.tile(np.eye(3), (views, 1, 1)), np.zeros((views, 3)), np.zeros(views, np.bool_)
    known[order[0]] = True
    for view in order[1:]:
        parent = before[view]
        pose, known[view] = of_pair[min(view, parent), max(view, parent)], True
        turn, shift = (pose.R, pose.t) if parent < view else (pose.R.T, -pose.R.T @ pose.t)
        R[view] = turn @ R[parent]
        centers[view] = centers[parent] - R[view].T @ shift
    within = [each for each in edges if known[each.views[0]] and known[each.views[1]]]
    R = _average_rotations(within, R)
    near = [each for each in within if _off(each, R) < _FAR]
    return R, _average_centers(near, R, centers), known


def _off(edge: RelativePose, R: Floats) -> float:
    """Return the angle between the rotation of an edge and that between two cameras."""
    i, j = edge.views
    return float(np.linalg.norm(Rotation.from_matrix(edge.R.T @ R[j] @ R[i].T).as_rotvec()))


def _average_rotations(edges: Sequence[RelativePose], R: Floats) -> Floats:
    """Return rotations of least weighted sum of angles to those of the edges (Weiszfeld's algorithm)."""
    for _ in range(_ROUNDS):
        before = R.copy()
        for view in range(len(R)):
            wanted, weights = [], []
            for each in edges:
                i, j = each.views
                if view in (i, j):
                    wanted.append(each.R.T @ R[j] if view == i else each.R @ R[i])
                    weights.append(each.points**0.5 / max(_off(each, R), 1e-3))
            if wanted:
                R[view] = Rotation.from_matrix(np.array(wanted)).mean(weights).as_matrix()
        if np.abs(R - before).max() < 1e-5:
            break
    return R


def _average_centers(edges: Sequence[RelativePose], R: Floats, centers: Floats) -> Floats:
    """Return centres of least weighted sum of distances from those that the edges say."""
    for _ in range(_ROUNDS):
        before = centers.copy()
        for view in range(len(R)):
            wanted, weights = [], []
            for each in edges:
                i, j = each.views
                if view in (i, j):
                    along = -R[j].T @ each.t  # from the first centre to the second
                    wanted.append(centers[j] - along if view == i else centers[i] + along)
                    weights.append(each.points**0.5 / max(float(np.linalg.norm(wanted[-1] - centers[view])), 1e-3))
            if wanted:
                centers[view] = np.average(wanted, axis=0, weights=weights)
        if np.abs(centers - before).max() < 1e-5:
            break
    return centers
