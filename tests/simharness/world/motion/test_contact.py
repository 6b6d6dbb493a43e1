import mujoco
import numpy as np
import pytest
from casting import penetration, performer

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.mujoco_model import person_spec
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.contact import ContactModel
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.kinematics import Addresses

TIME = np.arange(0.0, 3.0, 0.1)


def gliding(start, end, *, yaw=0.0, pose=None):
    """Return the motion of a person in a fixed pose that moves from one position to another."""
    share = np.linspace(0, 1, len(TIME))[:, None]
    root = np.zeros((len(TIME), 7))
    root[:, :2] = np.array(start) + share * (np.array(end) - np.array(start))
    root[:, 2] = 1.0
    root[:, 3], root[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
    angles = np.zeros((len(TIME), len(DOFS)))
    for name, value in (pose or {}).items():
        angles[:, DOFS.index(name)] = np.radians(value)
    return Motion(TIME, root, angles)


def nearest_by_brute_force(one, other, first, second, rows):
    """Return the least signed distance of all pairs of geometries, from MuJoCo's distances instead of its contacts."""
    spec = mujoco.MjSpec()
    for prefix, mover in (("a/", one), ("b/", other)):
        spec.attach(person_spec(mover.body, prefix[:-1]), prefix=prefix, frame=spec.worldbody.add_frame())
    model = spec.compile()
    data = mujoco.MjData(model)
    geoms = [[g for g in range(model.ngeom) if model.geom(g).name.startswith(p)] for p in ("a/", "b/")]
    for row in rows:
        for prefix, mover, motion in (("a/", one, first), ("b/", other, second)):
            Addresses(model, mover.body, prefix=prefix).write(data.qpos, motion.root[row], motion.angles[row])
        mujoco.mj_kinematics(model, data)
        yield min(mujoco.mj_geomDistance(model, data, a, b, 5.0, None) for a in geoms[0] for b in geoms[1])


def test_depth_is_the_distance_of_the_nearest_shapes():
    one, other = performer(0), performer(1)
    first, second = gliding([0, 0], [0, 0]), gliding([0.9, 0.05], [0.1, 0.0], yaw=np.pi)
    depth = penetration([one, other], [first, second], TIME)
    np.testing.assert_array_equal(depth, depth.swapaxes(1, 2))
    assert not depth[:, [0, 1], [0, 1]].any()
    between = depth[:, 0, 1]
    assert between[0] == 0.0
    assert between[-1] > 0.05
    rows = [0, 14, 18, 22, len(TIME) - 1]
    for row, nearest in zip(rows, nearest_by_brute_force(one, other, first, second, rows), strict=True):
        assert between[row] == pytest.approx(max(0.0, -nearest), abs=2e-4)


def test_contact_of_a_stretched_arm_is_detected():
    """The pelvises are more than a metre apart, and only a hand penetrates the other body."""
    one, other = performer(0), performer(1)
    pose = {"right_shoulder_flexion": 90.0}
    side = float(one.arms["right"].end[1])
    depth = penetration([one, other], [gliding([0, 0], [0, 0], pose=pose), gliding([1.4, side], [0.4, side])], TIME)
    first = np.flatnonzero(depth[:, 0, 1] > 0)[0]
    reach = abs(one.arms["right"].end[2] - one.arms["right"].anchors[0][2])
    assert 1.4 - TIME[first] / TIME[-1] > 0.75 * reach  # long before the trunks meet


def test_bounding_rectangles_miss_no_contact():
    """Depths are the same for all frames and for those in which the bounding rectangles overlap."""
    cast = [performer(0), performer(1)]
    motions = [
        gesture(name, mover, Spot(np.array(place), bearing), TIME, rng=stream(k, "contact"))
        for k, (name, mover, place, bearing) in enumerate(
            zip(("point", "wave"), cast, ([0.0, 0.0], [0.45, 0.1]), (0.0, 2.0), strict=True)
        )
    ]
    crowd = ContactModel(cast)
    one, other = (crowd.sample(k, motion, TIME) for k, motion in enumerate(motions))
    everywhere = crowd._pair(0, 1).depths(one.motion, other.motion, np.arange(len(TIME)))
    assert everywhere.max() > 0
    np.testing.assert_array_equal(crowd.penetration(one, other), everywhere)


def test_the_box_of_a_body_holds_all_its_skin():
    mover = performer(2)
    motion = gesture("point", mover, Spot(np.ones(2), 1.0), TIME, rng=stream(0, "box"))
    here = ContactModel([mover]).sample(0, motion, TIME)
    for k in (0, 9, 18, 27):
        skin = mover.body.skin(mover.transforms(here.motion)[k])[:, :2]
        assert (skin >= here.low[k]).all()
        assert (skin <= here.high[k]).all()
