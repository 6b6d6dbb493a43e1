"""Scenes of a rehearsal: scored by sets of cameras, and as wide as the volume."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mvpose import Rig
from simharness.planning.rehearsal_scene import RehearsalSetup, SceneSettings
from simharness.planning.rig_file import read_rig
from simharness.planning.simulated_scenes import Condition, SceneBatch, loss_of, simulate_scenes
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.room_section import ClutterSection
from simharness.types.floor import Volume
from simharness.world.scene.objects.geoms import Box

WHOLE = (0, 1, 2, 3, 4)
WORSE = Condition(WHOLE, "rotation", 2.0)
LATE = Condition(WHOLE, "clock_offset", 0.5)


def settings(*, rig=None, **changes):
    content = dict(volume=Volume.box(4.0, 2.0), people=2, detector=read_profile("typical"))
    return SceneSettings(rig or read_rig("ring5"), RehearsalSetup(**content | changes), frames=4)


def simulated(conditions, *, seed=3, **changes):
    (results,) = simulate_scenes([SceneBatch(settings(**changes), tuple(conditions), (seed,))])
    return results[0]


@pytest.fixture(scope="module")
def scene():
    conditions = [Condition(WHOLE), Condition((0, 1)), Condition((3,)), WORSE, LATE]
    return simulated(conditions)


def test_people_are_in_the_volume_and_use_its_length(scene):
    assert scene.inside.mean() > 0.95
    spread = np.ptp(scene.places.reshape(-1, 2), axis=0)
    assert spread[0] > 1.5 * spread[1] > 0.7


def test_fewer_cameras_and_wrong_calibrations_and_clocks_score_less(scene):
    whole = scene.scores[Condition(WHOLE)]
    assert whole.pcp > 95
    assert whole.recall == 100
    assert scene.scores[Condition((0, 1))].mpjpe_mm > whole.mpjpe_mm
    assert scene.scores[WORSE].pcp < whole.pcp - 20
    assert scene.scores[LATE].mpjpe_mm > whole.mpjpe_mm + 20
    assert loss_of([scene], WORSE, Condition(WHOLE)).mean == pytest.approx(whole.pcp - scene.scores[WORSE].pcp)


def test_one_camera_finds_nobody(scene):
    alone = scene.scores[Condition((3,))]
    assert alone.pcp == alone.recall == 0.0
    assert np.isnan(alone.mpjpe_mm)


def test_the_world_may_be_moved_with_its_rig_and_volume(scene):
    turn, shift = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([7.0, -3.0, 0.0])
    rig = Rig([replace(each, R=each.R @ turn.T, t=each.t - each.R @ turn.T @ shift) for each in read_rig("ring5")])
    volume = Volume(Volume.box(4.0, 2.0).outline @ turn[:2, :2].T + shift[:2])
    moved = simulated([Condition(WHOLE)], rig=rig, volume=volume)
    assert moved.inside.mean() > 0.95
    assert moved.scores[Condition(WHOLE)].pcp > 95


@pytest.mark.slow
def test_an_obstacle_before_two_cameras_costs_what_their_failure_does():
    walls = []
    for camera in list(read_rig("ring5"))[:2]:
        x, y, _ = 0.9 * camera.center
        walls.append(Box((float(x), float(y), 1.5), (0.05, 1.5, 1.5), float(np.arctan2(y, x))))
    failed = Condition((2, 3, 4))
    hidden = simulated([Condition(WHOLE), failed], obstacles=tuple(walls))
    assert hidden.scores[Condition(WHOLE)].mpjpe_mm == pytest.approx(hidden.scores[failed].mpjpe_mm, abs=8)


def test_people_who_do_not_fit_are_named():
    with pytest.raises(ValueError, match="30 people do not fit"):
        simulated([Condition(WHOLE)], people=30, volume=Volume.box(1.5, 1.5))


def test_a_crowd_that_does_not_fit_is_left_out_beside_people_who_do():
    small = SceneBatch(settings(), (Condition(WHOLE),), (3,))
    crowd = SceneBatch(settings(people=100), (Condition(WHOLE),), (0, 1))
    fit, none = simulate_scenes([small, crowd])
    assert len(fit) == 1
    assert none == []


def test_clutter_hides_people_in_one_long_take():
    cluttered = simulated([Condition(WHOLE)], clutter=ClutterSection(boxes=3))
    assert cluttered.places.shape[0] == 16
    assert 50 < cluttered.scores[Condition(WHOLE)].pcp <= 100


@pytest.mark.slow
def test_results_do_not_depend_on_the_number_of_processes():
    batches = [SceneBatch(settings(), (Condition(WHOLE), WORSE), (0, 1)), SceneBatch(settings(people=3), (LATE,), (0,))]
    alone, shared = (simulate_scenes(batches, workers=workers) for workers in (1, 2))
    for one, other in zip([each for batch in alone for each in batch], [e for b in shared for e in b], strict=True):
        assert one.scores == other.scores
        assert np.array_equal(one.places, other.places)
