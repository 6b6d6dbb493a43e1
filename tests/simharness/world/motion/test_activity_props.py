"""Activities with props: the seat supports the sitter, the box is in both hands, the block is under both feet."""

import numpy as np
import pytest
from casting import palm_pose

from mvpose.skeleton import COCO17
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activity_registry import activities
from simharness.world.motion.motion import motion_clock
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.kinematics import Kinematics

TIME = motion_clock(12.0)
SPOT = Spot(np.array([-0.5, 0.8]), -2.2)


@pytest.fixture(scope="module", params=range(4))
def seed(request):
    return request.param


@pytest.fixture(scope="module")
def kinematics(seed):
    return Kinematics(make_body(draw_shape(stream(seed, "props"))))


def perform(name, kinematics, seed):
    performance = activities()[name].perform([kinematics], SPOT, TIME, rng=stream(seed, name), pace=1.1)
    (prop,) = performance.props
    return performance.motions[0], prop


def of_bones(body, *bones):
    """Return the mask of the skin vertices of some bones, (n,)."""
    most = body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(axis=1)]
    return np.isin(most, [body.index(name) for name in bones])


def in_prop(prop, points, time):
    """Transform world points (T, ..., 3) to the frame of the prop at each time."""
    pose = prop.trajectory.at(time)
    yaw = 2 * np.arctan2(pose[:, 6], pose[:, 3])
    offset = points - pose[:, :3].reshape(len(time), *[1] * (points.ndim - 2), 3)
    c, s = (f(yaw).reshape(len(time), *[1] * (points.ndim - 2)) for f in (np.cos, np.sin))
    return np.stack(
        [c * offset[..., 0] + s * offset[..., 1], c * offset[..., 1] - s * offset[..., 0], offset[..., 2]], axis=-1
    )


def test_the_skin_touches_the_seat_without_penetration(kinematics, seed):
    motion, chair = perform("sit", kinematics, seed)
    assert chair.kind == "chair"
    assert 0.3 < chair.size[2] < 0.55
    some = slice(None, None, 12)
    skins = np.array([kinematics.body.skin(pose) for pose in kinematics.transforms(motion)[some]], float)
    local = in_prop(chair, skins, TIME[some])
    depth, width, height = chair.size
    over = (np.abs(local[..., 0]) < depth / 2) & (np.abs(local[..., 1]) < width / 2)
    # Calves are beside the seat's front edge, or a little under it; nothing else is lower than the seat.
    calf = of_bones(kinematics.body, "LeftLeg", "RightLeg", "LeftFoot", "RightFoot", "LeftToeBase", "RightToeBase")
    gap = np.where(over & ~calf, local[..., 2] - height, np.inf).min(axis=1)
    board = over & calf & (local[..., 2] > height - 0.04) & (local[..., 2] < height)
    assert (depth / 2 - local[board][:, 0]).max(initial=0.0) < 0.03
    assert gap.min() > -0.03
    pelvis = motion.root[some, 2]
    seated = pelvis < pelvis.min() + 0.03
    assert 0.2 < seated.mean() < 0.85
    assert np.abs(gap[seated]).max() < 0.02
    # The trunk does not penetrate the backrest, whose front is 4 cm ahead of the back edge.
    trunk = (local[..., 2] > height + 0.1) & (local[..., 2] < height + 0.45) & (np.abs(local[..., 1]) < 0.15)
    assert local[trunk][:, 0].min() > -depth / 2 + 0.02


def test_the_sitter_faces_away_from_the_backrest(kinematics, seed):
    motion, chair = perform("sit", kinematics, seed)
    joints = in_prop(chair, kinematics.joints(motion), TIME)
    knees = joints[:, [COCO17.index("left_knee"), COCO17.index("right_knee")], 0]
    hips = joints[:, [COCO17.index("left_hip"), COCO17.index("right_hip")], 0]
    seated = motion.root[:, 2] < motion.root[:, 2].min() + 0.02
    assert (knees[seated] > hips[seated] + 0.25).all()


def test_the_box_stays_in_both_hands_while_it_is_off_the_floor(kinematics, seed):
    motion, box = perform("carry", kinematics, seed)
    pose = box.trajectory.at(TIME)
    lifted = pose[:, 2] > 0.002
    assert 0.2 < lifted.mean() < 0.8
    assert pose[:, 2].max() > 0.35 * kinematics.body.stature
    for side, sign in (("left", 1.0), ("right", -1.0)):
        _, place = palm_pose(kinematics, motion, side)
        local = in_prop(box, place, TIME)[lifted]
        assert np.ptp(local, axis=0).max() < 0.006  # a hand does not slip
        assert np.abs(sign * local[:, 1] - box.size[1] / 2).max() < 0.005  # and is on the side of the box
        assert (np.abs(local[:, 0]) < box.size[0] / 2).all()
    moved = np.linalg.norm(pose[-1, :2] - pose[:, :2], axis=1).max()
    assert moved > 0.15  # it is carried somewhere


def test_the_box_does_not_go_through_the_body(kinematics, seed):
    motion, box = perform("carry", kinematics, seed)
    some = slice(None, None, 15)
    body = kinematics.body
    trunk = of_bones(body, "Hips", "LowerBack", "Spine", "Spine1", "LeftUpLeg", "LeftLeg")
    skins = np.array([body.skin(pose)[trunk] for pose in kinematics.transforms(motion)[some]], float)
    local = in_prop(box, skins, TIME[some])
    depth = np.minimum(box.size[0] / 2 - np.abs(local[..., 0]), box.size[1] / 2 - np.abs(local[..., 1]))
    depth = np.minimum(depth, np.minimum(local[..., 2], box.size[2] - local[..., 2]))
    assert depth.max() < 0.04


def test_both_feet_stand_on_the_block(kinematics, seed):
    motion, block = perform("step", kinematics, seed)
    height = block.size[2]
    assert 0.08 < height < 0.25
    body = kinematics.body
    lowest = {}
    for side in ("Left", "Right"):
        on_foot = of_bones(body, f"{side}Foot", f"{side}ToeBase")
        feet = np.array([body.skin(pose)[on_foot] for pose in kinematics.transforms(motion)[::6]], float)
        local = in_prop(block, feet, TIME[::6])
        inside = (np.abs(local[..., 0]) < block.size[0] / 2) & (np.abs(local[..., 1]) < block.size[1] / 2)
        assert (local[..., 2][inside] > height - 0.01).all()  # never inside the block
        lowest[side] = local[..., 2].min(axis=1)
    both = np.minimum(lowest["Left"], lowest["Right"])
    assert both.max() == pytest.approx(height, abs=0.01)
    assert both.min() == pytest.approx(0.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sit", "carry", "step"])
def test_props_fit_the_body(name):
    sizes = {perform(name, Kinematics(make_body(draw_shape(stream(seed, "props")))), seed)[1].size for seed in range(3)}
    assert len(sizes) == 3
