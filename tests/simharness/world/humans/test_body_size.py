"""Bodies of recorded sizes."""

from dataclasses import fields, replace

import numpy as np
import pytest

from mvpose.skeleton import COCO17
from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.humans.shape import LIMITS, STRETCHED, Shape
from simharness.world.motion.mocap.recorded_people import body_lengths, resize
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematics import Kinematics


def standing(shape: Shape) -> dict[str, float]:
    """Return the lengths of a body with hanging arms; its arms are up to 3 % longer than at rest."""
    root = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
    return body_lengths(Kinematics(make_body(shape)).joints(Motion(np.zeros(1), root, np.zeros((1, len(DOFS))))))


def test_lengths_are_medians_of_both_sides():
    joints = stream(3, "lengths").normal(scale=5.0, size=(3, 17, 3))
    for side, lengths in (("left", (0.3, 0.3, 9.0)), ("right", (0.1, 0.3, 0.3))):
        elbow, wrist = COCO17.index(f"{side}_elbow"), COCO17.index(f"{side}_wrist")
        joints[:, wrist] = joints[:, elbow] + np.outer(lengths, [0.6, 0.0, -0.8])
    assert body_lengths(joints)["forearm"] == pytest.approx(0.3)
    joints[:, [COCO17.index(name) for name in ("left_hip", "right_hip")]] = [[[0.0, 0.2, 1.0], [0.0, -0.2, 1.0]]]
    joints[:, [COCO17.index(name) for name in ("left_shoulder", "right_shoulder")]] = [[[0.3, 0, 1.4], [0.3, 0, 1.4]]]
    assert body_lengths(joints)["trunk"] == pytest.approx(0.5)
    assert body_lengths(joints)["hips"] == pytest.approx(0.4)


@pytest.mark.parametrize("seed", range(6))
def test_a_resized_body_has_the_lengths_and_keeps_its_appearance(seed):
    wide, narrow = stream(seed, "widths").uniform(0.8, 1.25, 2).tolist()
    wanted = standing(replace(draw_shape(stream(seed, "recorded")), shoulders=wide, hips=narrow))
    drawn = draw_shape(stream(seed, "drawn"))
    resized = resize(drawn, wanted)
    assert standing(resized) == pytest.approx(wanted, rel=0.04)
    for entry in fields(Shape):
        if entry.name not in ("height", *STRETCHED):
            assert getattr(resized, entry.name) == getattr(drawn, entry.name)


def test_lengths_that_nobody_has_give_the_nearest_body():
    lengths = {"trunk": 0.5, "upper_arm": 0.3, "forearm": 0.26, "thigh": 0.4, "shank": 0.42}
    lengths |= {"shoulders": 0.4, "hips": 0.2}
    giant, dwarf = (resize(Shape(), {name: factor * each for name, each in lengths.items()}) for factor in (3.0, 0.2))
    for k, shape in enumerate((dwarf, giant)):
        for name in ("height", *STRETCHED):
            assert getattr(shape, name) == LIMITS[name][k]
