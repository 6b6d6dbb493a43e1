"""Viewing rays of detections, against OpenCV and against the cameras."""

import cv2
import numpy as np
import pytest
from people import look_at

from mvpose import Camera, Detections, Rig
from mvpose.rays import viewing_rays

LENSES = [np.zeros(5), [0.115, -0.219, 0.0012, 0.0086, 0.113], [-0.2, 0.05, -0.004, 0.003, 0.0]]


def with_skew(camera):
    """The camera with different focal lengths, a skew, and a principal point off the centre."""
    K = np.array([[820.0, 3.0, 600.0], [0.0, 790.0, 500.0], [0.0, 0.0, 1.0]])
    return Camera(K, camera.R, camera.t, camera.distortion, camera.size)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("skewed", [False, True])
def test_opencv_images_a_viewing_ray_at_its_keypoint(lens, skewed):
    rng = np.random.default_rng(4)
    rig = Rig([look_at(center, [0, 0, 1], distortion=lens) for center in ([3, -2, 2.5], [-1, 4, 1.5])])
    if skewed:
        rig = Rig([with_skew(camera) for camera in rig])
    pixels = rng.uniform([100, 80], [1180, 880], (2, 17, 2))
    rays = viewing_rays(rig, Detections.from_keypoints([0, 1], pixels, np.full((2, 17), 0.7)))
    for view, camera in enumerate(rig):
        points = rays.origins[view] + rng.uniform(1, 8, (17, 1)) * rays.directions[view]
        bent, _ = cv2.projectPoints(points, cv2.Rodrigues(camera.R)[0], camera.t, np.eye(3), camera.distortion)
        imaged = np.column_stack([bent[:, 0], np.ones(17)]) @ camera.K.T  # OpenCV itself ignores a skew
        np.testing.assert_allclose(imaged[:, :2], pixels[view], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=2), 1.0)
    np.testing.assert_array_equal(rays.weights, np.full((2, 17), 0.7))
    np.testing.assert_allclose(rays.pixel, [1 / np.sqrt(camera.K[0, 0] * camera.K[1, 1]) for camera in rig])
