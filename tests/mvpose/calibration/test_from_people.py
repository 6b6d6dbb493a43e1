"""Extrinsics from people alone: shape, size and floor of the rig, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import film, walk
from people import ring
from scipy.spatial.transform import Rotation

from mvpose import COCO17, Detections, Rig
from mvpose.calibration.floor import ANKLE, floor_of
from mvpose.calibration.from_people import calibrate_from_people
from mvpose.calibration.rig_size import Bodies

RIG = ring(4)
PERIOD = 0.1
JOINTS = walk(2, frames=80, seed=2)


def scattered(rig, seed):
    """The lenses of a rig at random places."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(len(rig), rng=rng).as_matrix()
    return Rig([replace(c, R=R, t=rng.normal(size=3)) for c, R in zip(rig, turns, strict=True)])


@pytest.fixture(scope="module")
def frames():
    return film(RIG, JOINTS, noise=3.0)[0]


@pytest.fixture(scope="module")
def found(frames):
    return calibrate_from_people(scattered(RIG, 0), frames, period=PERIOD).rig


def angles(one, other):
    return np.degrees(Rotation.from_matrix(np.swapaxes(one, -1, -2) @ other).magnitude())


def test_cameras_stand_to_each_other_as_they_do(found):
    relative, true = ([c.R @ rig[0].R.T for c in rig] for rig in (found, RIG))
    assert angles(np.array(relative), np.array(true)).max() < 0.5
    apart, real = (np.linalg.norm(rig.centers[:, None] - rig.centers[None], axis=-1) for rig in (found, RIG))
    off = ~np.eye(len(RIG), dtype=bool)
    ratio = apart[off] / real[off]
    assert np.ptp(ratio) < 0.03 * ratio.mean()


def test_the_world_is_that_of_the_floor(found):
    up = np.mean([c.R.T @ true.R[:, 2] for c, true in zip(found, RIG, strict=True)], axis=0)  # the true vertical
    assert np.degrees(np.arccos(up[2] / np.linalg.norm(up))) < 1.5
    assert abs(found[0].R[0, 2]) < 0.02 or abs(found[0].R[0] @ [0, 1, 0]) < 1e-9  # x is to the right of the first


@pytest.mark.slow
def test_where_the_given_cameras_stand_has_no_effect(found, frames):
    again = calibrate_from_people(scattered(RIG, 7), frames, period=PERIOD).rig
    np.testing.assert_allclose(again.centers, found.centers, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("options", "factor"), [({"stature": 1.87}, 1.1), ({"distance": ("cam0", "cam2", 7.0)}, None)])
def test_the_size_is_that_of_the_stature_or_of_the_distance(found, frames, options, factor):
    named = Rig([replace(c, name=f"cam{k}") for k, c in enumerate(RIG)])
    other = calibrate_from_people(named, frames, period=PERIOD, **options).rig
    before, after = (float(np.linalg.norm(rig.centers[0] - rig.centers[2])) for rig in (found, other))
    assert after == pytest.approx(7.0 if factor is None else factor * before, rel=1e-6)


def test_people_who_stand_still_are_refused():
    still, _ = film(RIG, walk(2, frames=60, still=True), noise=3.0)
    with pytest.raises(ValueError, match="cannot tell"):
        calibrate_from_people(RIG, still, period=PERIOD)


def test_a_camera_of_another_time_is_named(frames):
    later = film(RIG, walk(3, frames=80, seed=9), noise=3.0)[0]
    mixed = []
    for a, b in zip(frames, later, strict=True):
        parts = a.select(a.view != 3), b.select(b.view == 3)
        columns = (np.concatenate([getattr(each, key) for each in parts]) for key in ("view", "keypoints", "scores"))
        mixed.append(Detections.from_keypoints(*columns))
    with pytest.raises(ValueError, match=r"camera .*3"):
        calibrate_from_people(RIG, mixed, period=PERIOD)


@pytest.mark.parametrize("degrees", [0.0, 20.0, 170.0])
def test_the_floor_of_feet_on_a_plane(degrees):
    turn = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    bodies = np.full((60, 17, 3), np.nan)
    rng = np.random.default_rng(0)
    spots = np.column_stack([rng.uniform(-2, 2, (60, 2)), np.zeros(60)])
    for name, height in (("shoulder", 1.4), ("hip", 0.9), ("ankle", ANKLE)):
        for side in ("left", "right"):
            bodies[:, COCO17.index(f"{side}_{name}")] = spots + [0.0, 0.0, height]
    spot = np.array([0.3, -0.2, 1.1])
    floor = floor_of(Bodies(bodies @ turn.T + spot, np.arange(60), np.arange(60), COCO17))
    np.testing.assert_allclose(floor.up, turn[:, 2], atol=1e-6)
    assert (floor.origin - spot) @ turn[:, 2] == pytest.approx(0.0, abs=1e-6)
