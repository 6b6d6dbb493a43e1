"""People are made once in a process: scenes that share them are those that would be built without sharing."""

import numpy as np
import pytest

from simharness.scenario.load import load
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import true_rig
from simharness.world.humans.wardrobe import draw_looks
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.scene.build import build, make_person, shape_of_person

SMALL = ("duration=0.4", "rate=5", "people.count=2", "rendering.renderer=rays", "clutter.shelves=0")


def built(*overrides):
    scenario = load("quickstart", overrides=[*SMALL, *overrides])
    return build(scenario, true_rig(scenario))


@pytest.fixture
def nobody_made():
    """Forget all people, as in a new process."""
    make_person.cache_clear()
    shape_of_person.cache_clear()


def arrays(scene):
    """Return what depends on the people of a scene: bodies, figures, motions and the compiled model."""
    return [
        *(array for body in scene.bodies for array in (body.vertices, body.faces, body.weights, body.heads)),
        *(array for mesh in scene.figures for array in (mesh.vertices, mesh.colors, mesh.parts)),
        *(array for mesh in scene.figures for array in (mesh.texture, mesh.uv) if array is not None),
        *(array for motion in scene.motions for array in (motion.root, motion.angles)),
        *(getattr(scene.model, name) for name in ("body_mass", "body_pos", "geom_pos", "geom_size", "qpos0")),
    ]


@pytest.mark.slow
def test_a_scene_after_others_and_after_their_trials_is_that_of_a_new_process(nobody_made):
    new = [array.copy() for array in arrays(built("seed=3"))]
    assert make_person.cache_info().misses == 2
    for other in ("people.activities=['hug', 'talk']", "cameras.count=3", "people.playback=dynamic"):
        scenario = load("quickstart", overrides=[*SMALL, "seed=3", other])
        run_trial(scenario, variants=["fast"], until="estimate")
    again = arrays(built("seed=3"))
    assert make_person.cache_info().misses == 2, "nobody is made a second time"
    for first, second in zip(new, again, strict=True):
        np.testing.assert_array_equal(first, second)


@pytest.mark.slow
@pytest.mark.parametrize("other", ["seed=4", "people.look_alike=1.0", "people.children=1.0"])
def test_other_people_are_not_taken_for_these(nobody_made, other):
    here, there = built("seed=3"), built("seed=3", other)
    assert not {id(body) for body in here.bodies} & {id(body) for body in there.bodies}
    assert built("seed=3").bodies[0] is here.bodies[0]


@pytest.mark.slow
def test_poses_leave_nothing_behind_in_the_kinematics_that_scenes_share(nobody_made):
    walking, waving = built("seed=3").motions
    mover = make_person(shape_of_person(3, 0, 0.0), draw_looks(3, 1)[0]).mover
    assert make_person.cache_info().misses == 2  # that of the scene
    mover.joints(waving)
    np.testing.assert_array_equal(mover.joints(walking), Kinematics(mover.body).joints(walking))
