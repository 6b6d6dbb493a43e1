import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mvpose import COCO17, Camera, Rig
from simharness.detector.viewing_conditions import body_axes, pixel_offsets, world_offsets
from simharness.scenario.sections.detector_section import BiasSection
from simharness.world.humans.body import make_body
from simharness.world.humans.shape import Shape


@pytest.fixture(scope="module")
def standing():
    """Joints of a person at rest who faces +x, with the left side towards +y, (17, 3) metres."""
    body = make_body(Shape(gender=0.5, muscle=0.5, weight=0.5, height=0.4, proportions=0.0))
    return body.joints(np.broadcast_to(np.eye(3, 4), (len(body.bones), 3, 4)))


def test_axes_of_a_standing_person(standing):
    axes = body_axes(standing)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes, np.eye(3), atol=0.1)  # no body is exactly upright
    assert (standing[1] - standing[3]) @ axes[0] > 0.03  # eyes are in front of ears


def test_offsets_turn_with_the_body_and_are_mirrored(standing):
    bias = BiasSection(hips=(0.01, 0.02, 0.03), nose=(0.0, 0.01, 0.0))
    turn = Rotation.from_rotvec([0.3, -0.5, 1.1]).as_matrix()
    at_rest = world_offsets(standing, bias)
    np.testing.assert_allclose(world_offsets(standing @ turn.T + [3, 1, 0], bias), at_rest @ turn.T, atol=1e-12)
    left, right = (at_rest[COCO17.index(f"{side}_hip")] @ body_axes(standing).T for side in ("left", "right"))
    np.testing.assert_allclose(left, [0.01, 0.02, 0.03], atol=1e-12)
    np.testing.assert_allclose(right, [0.01, -0.02, 0.03], atol=1e-12)
    moved = np.linalg.norm(at_rest, axis=-1) > 0
    assert {COCO17.joints[joint] for joint in np.flatnonzero(moved)} == {"nose", "left_hip", "right_hip"}


def test_pixel_offsets_are_those_of_the_moved_joints(standing):
    rig = Rig([
        Camera(np.diag([700.0, 700, 1]), Rotation.from_euler("x", angle, degrees=True).as_matrix(), [0.1, 0.2, 4.0],
               size=(800, 600))
        for angle in (0.0, 25.0)
    ])  # fmt: skip
    joints = np.stack([standing, standing + [0.2, 0.1, 0.0]])[None]
    bias = BiasSection(knees=(0.0, 0.0, 0.05))
    pixels = pixel_offsets(joints, bias, rig)
    assert pixels.shape == (1, 2, 2, 17, 2)
    for view, camera in enumerate(rig):
        expected = camera.project(joints[0, 1] + world_offsets(joints[0, 1], bias)) - camera.project(joints[0, 1])
        np.testing.assert_allclose(pixels[0, view, 1], expected)
    assert (np.abs(pixels).max(axis=(0, 1, 2, 4)) > 1).nonzero()[0].tolist() == [13, 14]
