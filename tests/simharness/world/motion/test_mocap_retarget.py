"""Retargeting of small skeletons with known angles."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import ARM, DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.mocap.bvh import read_bvh
from simharness.world.motion.mocap.clip import Clip, back_and_forth
from simharness.world.motion.mocap.limb_angles import arm_angles
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematics import Kinematics

FRAMES = 60
# By style the names of: pelvis, chest, head; of each side collar, upper arm, forearm, hand, thigh, shank, foot, toes.
STYLES = {
    "motionbuilder": (
        "Hips Spine Head",
        "{0}Shoulder {0}Arm {0}ForeArm {0}Hand {0}UpLeg {0}Leg {0}Foot {0}ToeBase",
        ("Left", "Right"),
    ),
    "mixamo": (
        "mixamorig:Hips mixamorig:Spine2 mixamorig:Head",
        "mixamorig:{0}Shoulder mixamorig:{0}Arm mixamorig:{0}ForeArm mixamorig:{0}Hand "
        "mixamorig:{0}UpLeg mixamorig:{0}Leg mixamorig:{0}Foot mixamorig:{0}ToeBase",
        ("Left", "Right"),
    ),
    "biovision": (
        "Hips Chest2 Head",
        "{0}Collar {0}Shoulder {0}Elbow {0}Wrist {0}Hip {0}Knee {0}Ankle {0}Toe",
        ("Left", "Right"),
    ),
    "cmu": (
        "root thorax head",
        "{0}clavicle {0}humerus {0}radius {0}hand {0}femur {0}tibia {0}foot {0}toes",
        ("l", "r"),
    ),
    "poser": ("hip chest head", "{0}Collar {0}Shldr {0}ForeArm {0}Hand {0}Thigh {0}Shin {0}Foot {0}Toe", ("l", "r")),
    "blender": (
        "pelvis chest head",
        "clavicle.{0} upper_arm.{0} forearm.{0} hand.{0} thigh.{0} shin.{0} foot.{0} toe.{0}",
        ("L", "R"),
    ),
    "biped": (
        "Bip01 Spine Head",
        "{0}Clavicle {0}UpperArm {0}Forearm {0}Hand {0}Thigh {0}Calf {0}Foot {0}Toe0",
        ("Bip01_L_", "Bip01_R_"),
    ),
}
_ROLES = ("collar", "arm", "forearm", "hand", "thigh", "shank", "foot", "toes")
# From the parent, in the zero pose (T pose, y up, facing z), for the left side.
_OFFSETS = {
    "collar": (3, 20, 0),
    "arm": (12, 0, 0),
    "forearm": (28, 0, 0),
    "hand": (25, 0, 0),
    "thigh": (9, -5, 0),
    "shank": (0, -42, 0),
    "foot": (0, -40, 0),
    "toes": (0, -7, 14),
}


def bvh(style: str = "motionbuilder", **turns: np.ndarray) -> str:
    """Return a BVH file of a person in T pose; ``turns`` are degrees (FRAMES, 3) about z, x, y by role: "left_arm"."""
    middle, limbs, sides = STYLES[style]
    pelvis, chest, head = middle.split()
    names = {f"{side}_{role}": limb for side, word in zip(("left", "right"), sides, strict=True)
             for role, limb in zip(_ROLES, limbs.format(word).split(), strict=True)}  # fmt: skip
    order: list[str] = []

    def joint(role: str, name: str, offset, children: list[str], depth: int = 1) -> str:
        order.append(role)
        pad = "  " * depth
        tip = {"left_hand": "8 0 0", "right_hand": "-8 0 0"}.get(role, "0 0 5")
        inner = children or [f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET {tip}\n{pad}  }}\n"]
        return (
            f"{pad}JOINT {name}\n{pad}{{\n{pad}  OFFSET {offset[0]} {offset[1]} {offset[2]}\n"
            f"{pad}  CHANNELS 3 Zrotation Xrotation Yrotation\n{''.join(inner)}{pad}}}\n"
        )

    def limb(side: str, roles: tuple[str, ...], depth: int) -> str:
        text = ""
        for k in range(len(roles) - 1, -1, -1):
            x, y, z = _OFFSETS[roles[k]]
            name = f"{side}_{roles[k]}"
            offset = (x if side == "left" else -x, y, z)
            text = joint(name, names[name], offset, [text] if text else [], depth + k)
        order[-len(roles) :] = reversed(order[-len(roles) :])
        return text

    arms = [limb(side, ("collar", "arm", "forearm", "hand"), 2) for side in ("left", "right")]
    head_text = joint("head", head, (0, 35, 0), [], 2)
    upper = joint("chest", chest, (0, 20, 0), [*arms, head_text])
    order.insert(0, order.pop())  # the chest stands before its arms
    legs = [limb(side, ("thigh", "shank", "foot", "toes"), 1) for side in ("left", "right")]
    text = (
        f"HIERARCHY\nROOT {pelvis}\n{{\n  OFFSET 0 0 0\n"
        f"  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n{upper}{''.join(legs)}}}\n"
    )
    place = turns.pop("place", np.tile([0.0, 94.0, 0.0], (FRAMES, 1)))
    table = [place, *(turns.pop(role, np.zeros((FRAMES, 3))) for role in ["pelvis", *order])]
    assert not turns, f"no such joints: {turns}"
    rows = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in np.concatenate(table, axis=1))
    return text + f"MOTION\nFrames: {FRAMES}\nFrame Time: 0.0166667\n{rows}\n"


def slowly(z: float = 0.0, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    """Return rotations about z, x and y in degrees that grow from 0 and are constant in the last third."""
    share = np.clip(np.linspace(0, 1.5, FRAMES), 0, 1)
    return (share * share * (3 - 2 * share))[:, None] * np.array([z, x, y])


HANG = {"left_arm": slowly(z=-80), "right_arm": slowly(z=80)}


@dataclass(frozen=True)
class Performer:
    kinematics: Kinematics
    folder: object

    def __call__(self, text: str) -> Motion:
        path = self.folder / "clip.bvh"
        path.write_text(text)
        clip = Clip(read_bvh(path))
        return clip.perform(self.kinematics, clip.time[:-1], place=(0.0, 0.0), bearing=0.0)


@pytest.fixture(scope="module")
def kinematics():
    return Kinematics(make_body(Shape(gender=0.2, height=0.4)))


@pytest.fixture(scope="module")
def perform(kinematics, tmp_path_factory):
    return Performer(kinematics, tmp_path_factory.mktemp("clips"))


def last(motion: Motion) -> dict[str, float]:
    """Return the angles of the last frame, degrees."""
    return dict(zip(DOFS, np.degrees(motion.angles[-5]), strict=True))


def test_a_zero_pose_stands_with_the_arms_out(perform, kinematics):
    motion = perform(bvh())
    angles = last(motion)
    for side in ("left", "right"):
        assert angles[f"{side}_shoulder_abduction"] + angles[f"{side}_clavicle_elevation"] == pytest.approx(90, abs=3)
        assert abs(angles[f"{side}_elbow_flexion"]) < 8
        assert abs(angles[f"{side}_hip_flexion"]) < 6
        assert 0 <= angles[f"{side}_knee_flexion"] < 10
    assert motion.root[-1, 2] == pytest.approx(kinematics.standing_height, abs=0.01)


@pytest.mark.parametrize(
    ("turns", "dof", "degrees"),
    [
        ({"pelvis": slowly(), "chest": slowly(x=30)}, "lumbar_flexion+thorax_flexion", 30),
        ({"chest": slowly(y=25)}, "lumbar_rotation+thorax_rotation", 25),
        ({"chest": slowly(z=-20)}, "lumbar_bending+thorax_bending", 20),
        ({"head": slowly(y=50)}, "neck_rotation", 50),
        ({"head": slowly(x=-25)}, "neck_flexion", -25),
        ({"left_thigh": slowly(x=-70), "left_shank": slowly(x=70)}, "left_knee_flexion", 70),
        ({"left_thigh": slowly(x=-70), "left_shank": slowly(x=70)}, "left_hip_flexion", 70),
        ({"right_thigh": slowly(z=-25)}, "right_hip_abduction", 25),
        ({"right_arm": slowly(z=80), "right_forearm": slowly(y=-90)}, "right_elbow_flexion", 90),
        ({"left_arm": slowly(y=-90)}, "left_shoulder_flexion", 90),
        (HANG, "right_shoulder_abduction", 10),
    ],
)
def test_a_known_rotation_is_retargeted(perform, turns, dof, degrees):
    angles = last(perform(bvh(**(HANG | turns))))
    assert sum(angles[name] for name in dof.split("+")) == pytest.approx(degrees, abs=8)


def test_a_mirrored_recording_gives_the_mirrored_motion(perform):
    bent = {"left_forearm": slowly(y=-60), "left_thigh": slowly(x=-50), "left_shank": slowly(x=40)}
    mirrored = {"right_forearm": slowly(y=60), "right_thigh": slowly(x=-50), "right_shank": slowly(x=40)}
    one, two = last(perform(bvh(**HANG, **bent))), last(perform(bvh(**HANG, **mirrored)))
    for name in DOFS:
        if name.startswith("left_"):
            assert one[name] == pytest.approx(two[name.replace("left_", "right_")], abs=2)


@pytest.mark.parametrize("style", sorted(STYLES))
def test_names_of_all_styles_mean_the_same(perform, style):
    turns = {**HANG, "left_forearm": slowly(y=-70), "right_thigh": slowly(x=-40), "right_shank": slowly(x=60)}
    same, other = perform(bvh(**turns)), perform(bvh(style, **turns))
    np.testing.assert_allclose(other.angles, same.angles, atol=1e-9)
    np.testing.assert_allclose(other.root, same.root, atol=1e-9)


def test_the_unit_of_length_does_not_matter(perform):
    place = np.tile([0.0, 94.0, 0.0], (FRAMES, 1)) + slowly(z=0, x=0, y=60)
    one = perform(bvh(**HANG, place=place))
    text = bvh(**HANG, place=place * 0.3937)
    for offset in {*_OFFSETS.values(), (0, 35, 0), (0, 20, 0), (0, 0, 5), (8, 0, 0)}:
        for sign in (1, -1):
            old = f"OFFSET {sign * offset[0]} {offset[1]} {offset[2]}\n"
            text = text.replace(old, "OFFSEt " + " ".join(f"{0.3937 * float(v):.9f}" for v in old.split()[1:]) + "\n")
    two = perform(text.replace("OFFSEt", "OFFSET"))
    np.testing.assert_allclose(two.root, one.root, atol=1e-4)
    np.testing.assert_allclose(two.angles, one.angles, atol=2e-3)
    way = np.linalg.norm(one.root[-1, :2] - one.root[0, :2])
    leg = perform.kinematics.leg_parts
    assert way == pytest.approx(60 * sum(leg) / 82, abs=0.01)


@pytest.mark.parametrize("height", [-60.0, 40.0])
def test_the_floor_height_of_the_recording_does_not_matter(perform, height):
    bent = {"left_thigh": slowly(x=-20), "left_shank": slowly(x=40), "left_foot": slowly(x=-20)}
    bent |= {name.replace("left", "right"): turn for name, turn in bent.items()}
    sinking = np.tile([0.0, 94.0, 0.0], (FRAMES, 1)) - slowly(x=82 * (1 - np.cos(np.radians(20))))
    one = perform(bvh(**HANG, **bent, place=sinking))
    two = perform(bvh(**HANG, **bent, place=sinking + [0.0, height, 0.0]))
    np.testing.assert_allclose(two.root, one.root, atol=1e-6)
    np.testing.assert_allclose(two.angles, one.angles, atol=1e-5)
    assert last(one)["left_knee_flexion"] == pytest.approx(40, abs=4)


def test_missing_joints_are_named_with_the_existing_ones(perform):
    with pytest.raises(
        ValueError, match=r"clip.bvh: this skeleton has no left shank \(leg, tibia.*joints are Hips, .*"
    ):
        perform(bvh().replace("LeftLeg", "LeftWheel"))
    with pytest.raises(
        ValueError, match=r"clip.bvh: the zero pose of this skeleton \(all angles 0\) does not stand upright"
    ):
        perform(bvh().replace("OFFSET 0 -42 0", "OFFSET 0 0 -42"))
    swapped = bvh().replace("LeftArm", "X").replace("LeftForeArm", "LeftArm").replace("JOINT X", "JOINT LeftForeArm")
    with pytest.raises(ValueError, match=r"'LeftForeArm' was mapped to the left forearm and 'LeftArm' to the left arm"):
        perform(swapped)


@given(seed=st.integers(0, 10_000))
def test_arms_meet_their_directions_smoothly(kinematics, seed):
    """Directions made from angles agree with those of the solved angles."""
    rng = stream(seed, "arms")
    time = np.arange(50) / 60
    low, high = np.array([kinematics.ranges[DOFS.index(f"left_{name}")] for name in ARM]).T
    inner = 0.8 * (high - low)
    waves = np.sin(2 * np.pi * (rng.uniform(0.1, 0.5, len(ARM)) * time[:, None] + rng.uniform(size=len(ARM))))
    angles = (low + high) / 2 + 0.5 * inner * rng.uniform(0.3, 1.0, len(ARM)) * waves
    found = arm_angles(*directions(kinematics, angles))
    assert (found >= low - 1e-9).all()
    assert (found <= high + 1e-9).all()
    for got, wanted, most in zip(
        directions(kinematics, found), directions(kinematics, angles), (6, 6, 12, 12), strict=True
    ):
        off = np.degrees(np.arccos(np.clip((got * wanted).sum(axis=1), -1, 1)))
        assert np.median(off) < most
    assert np.abs(np.diff(found, axis=0)).max() < 0.5


def directions(kinematics, angles):
    """Return directions of upper arm, forearm, hand and thumb in the clavicle frame, from the chain of the body."""
    chain = kinematics.arms["left"]
    full = [chain.forward(np.where(np.arange(len(ARM)) < count, angles, 0.0))[0] for count in (3, 4, 6)]
    return (-full[0][:, :, 2], -full[1][:, :, 2], -full[2][:, :, 2], full[2][:, :, 0])


@given(start=st.floats(0, 1), end=st.floats(0.31, 20), time=st.floats(-30, 60), step=st.floats(1e-4, 0.05))
def test_back_and_forth_stays_in_range_without_jumps(start, end, time, step):
    moments = back_and_forth(time + step * np.arange(-1, 2), start=start * end, end=end)
    assert (moments >= 0).all()
    assert (moments <= end).all()
    speed = np.diff(moments) / step
    assert np.abs(speed).max() <= 1 + 1e-6
    assert abs(speed[1] - speed[0]) <= 2 * step * 2 / 0.3 + 1e-6  # from 1 to -1 in TURN seconds
    assert back_and_forth(np.zeros(1), start=start * end, end=end)[0] == pytest.approx(start * end, abs=1e-9)


def test_back_and_forth_has_speed_one_and_reverses_at_the_ends():
    moments = back_and_forth(np.linspace(0, 20, 20001), start=2.0, end=5.0)
    np.testing.assert_allclose(moments[:2800], 2.0 + np.linspace(0, 20, 20001)[:2800], atol=1e-9)
    assert moments.max() == pytest.approx(5.0, abs=1e-6)
    assert moments.min() == pytest.approx(0.0, abs=1e-6)
