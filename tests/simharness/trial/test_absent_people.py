"""A person who is absent is in no picture, no detection and no truth, as if the scene had been built without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mvpose.commands.progress import Silence, Stages
from mvpose.skeleton import SHELF14
from simharness import load_scenario
from simharness.capture.ray_casting import RayCaster
from simharness.reality.annotation_errors import annotate_simulation
from simharness.trial.archive import pack_detected, unpack_detected
from simharness.trial.audit import AuditError, audit
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.trial.stages.simulation import capture_trial, detect_trial
from simharness.types.views import Visibility
from simharness.world.motion.motion import ALWAYS, Presence, held
from simharness.world.scene.playback import Playback

FRAMES, GONE = 6, 3  # frames, and the first one in which person 1 is absent


def trial_of(people, renderer, *overrides):
    scenario = load_scenario(
        "quickstart",
        overrides=[
            f"people.count={people}",
            'people.activities=["wave"]',
            f"duration={FRAMES / 10}",
            "rate=10",
            "cameras.count=2",
            "clutter.boxes=0",
            "clutter.shelves=0",
            "cameras.size=[160, 120]",
            'method.variants=["fast"]',
            f'rendering.renderer="{renderer}"',
            *overrides,
        ],
    )
    return build_trial(scenario)


def leaving(trial):
    """Return the trial with person 1 absent from frame ``GONE`` on."""
    presence = (ALWAYS, Presence([[-np.inf, (GONE - 0.5) / 10]]))
    return replace(trial, scene=replace(trial.scene, presence=presence))


def captured(trial):
    return capture_trial(trial, Stages(Silence()))


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["rays", "raster"])
def test_views_without_an_absent_person_are_those_of_a_scene_without_the_person(renderer):
    one, two = trial_of(1, renderer), trial_of(2, renderer)
    alone, both, left = (captured(each).views for each in (one, two, leaving(two)))
    for key in ("pixels", "visibility", "boxes", "area_visible"):
        before, after = getattr(left, key)[:GONE], getattr(left, key)[GONE:]
        np.testing.assert_array_equal(before, getattr(both, key)[:GONE])
        np.testing.assert_array_equal(after[:, :, :1], getattr(alone, key)[GONE:])
    assert np.isnan(left.pixels[GONE:, :, 1]).all()
    assert (left.visibility[GONE:, :, 1] == Visibility.OUTSIDE).all()
    assert not left.boxes[GONE:, :, 1].any()
    assert (both.visibility[GONE:, :, 1] != Visibility.OUTSIDE).any()  # otherwise nothing was tested


def test_an_absent_person_stops_no_ray():
    trial = trial_of(2, "rays")
    camera = trial.exposures.true_rig[0]
    owners = []
    for each in (trial, leaving(trial)):
        state = Playback(each.scene).at(GONE / 10)
        caster = RayCaster(each.scene)
        caster.place(state)
        behind = state.joints[1] + 0.3 * (state.joints[1] - camera.center)
        owners.append(caster.cast(camera, behind)[0])
    assert (owners[0] == 1).sum() > 10
    assert not (owners[1] == 1).any()


@pytest.mark.slow
def test_pictures_do_not_show_an_absent_person_nor_a_shadow():
    one, two = trial_of(1, "raster"), trial_of(2, "raster")
    pictures = [
        picture_source_of(each.scenario, Playback(each.scene)).picture(each.exposures, GONE, 0)
        for each in (one, leaving(two), two)
    ]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert (pictures[2] != pictures[1]).any()


def test_truth_and_detections_of_absent_people():
    trial = leaving(trial_of(2, "rays"))
    simulation = captured(trial)
    audit(trial.scenario, trial.scene, trial.exposures, simulation.sequence, simulation.views)
    detected = detect_trial(simulation, Stages(Silence()))
    for frame, each in enumerate(detected.frames):
        assert each.truth.present.tolist() == [True, frame < GONE]
        assert np.isnan(each.truth.joints[1]).all() == (frame >= GONE)
        assert frame < GONE or 1 not in each.truth.person
    assert any(1 in each.truth.person for each in detected.frames)
    restored = unpack_detected(pack_detected(detected), trial.scenario)
    for one, other in zip(detected.frames, restored.frames, strict=True):
        np.testing.assert_array_equal(one.truth.joints, other.truth.joints)
    annotated = annotate_simulation(trial.scenario, simulation.sequence, trial.exposures.true_rig)
    assert annotated.shape[2] == len(SHELF14)
    np.testing.assert_array_equal(np.isnan(annotated).all(axis=(2, 3)), ~simulation.sequence.present)


def test_the_audit_finds_a_person_in_pictures_who_is_absent():
    trial = trial_of(2, "rays")
    simulation = captured(trial)
    with pytest.raises(AuditError, match=r"presence: frame .* shows person 1, who is absent"):
        audit(trial.scenario, leaving(trial).scene, trial.exposures, simulation.sequence, simulation.views)


def test_presence_in_time():
    presence = Presence([[-np.inf, 1.0], [2.0, 3.0]])
    assert presence.at([-5.0, 1.0, 1.5, 2.0, 3.0, 3.1]).tolist() == [True, True, False, True, True, False]
    assert ALWAYS.always
    assert not presence.always
    assert not Presence(np.zeros((0, 2))).at(0.0)
    with pytest.raises(ValueError, match="ascending"):
        Presence([[0.0, 2.0], [1.0, 3.0]])


def test_absent_values_are_held_from_the_nearest_present_time():
    present = np.array([0, 0, 1, 0, 0, 0, 1, 1, 0], bool)
    values = np.arange(9.0)
    assert held(values, present).tolist() == [2, 2, 2, 2, 2, 6, 6, 7, 7]
    assert held(values, np.zeros(9, bool)).tolist() == values.tolist()
