import cv2
import numpy as np
import pytest

from mvpose.camera import Camera
from simharness.world.rigs.projection import check_lens, intrinsics

SIZE = (800, 600)


def camera(*terms, fov=75.0):
    return Camera(K=intrinsics(fov, SIZE), R=np.eye(3), t=np.zeros(3), distortion=np.array(terms), size=SIZE, name="a")


@pytest.mark.parametrize(
    "terms",
    [
        (-0.37, 0.15, 0.0, 0.0, 0.0),  # barrel
        (0.115, -0.219, 0.0012, 0.0086, 0.113),  # a webcam
        (-0.2862, 0.1831, 0.0, 0.0006, -0.048),  # a Panoptic camera
    ],
)
def test_real_lenses_image_one_direction_at_every_pixel(terms):
    """To the corners of the picture, and as OpenCV projects it."""
    lens = camera(*terms)
    check_lens(lens)
    u, v = np.meshgrid(np.arange(0, 800, 7.0), np.arange(0, 600, 7.0))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = lens.rays(pixels)
    np.testing.assert_allclose(lens.project(5 * rays), pixels, atol=1e-6)
    zero = np.zeros(3)
    np.testing.assert_allclose(cv2.projectPoints(rays, zero, zero, lens.K, lens.distortion)[0][:, 0], pixels, atol=1e-6)


def test_a_lens_that_folds_within_the_picture_is_refused():
    """The radius r (1 - 0.37 r²) turns back at r = 1 / sqrt(1.11), which it images at two thirds of that."""
    fold = 2 / 3 / np.sqrt(3 * 0.37)
    narrow = np.degrees(2 * np.arctan(fold * 0.99 * 800 / 1000))  # the corner is 5/4 as far out as the side
    check_lens(camera(-0.37, 0.0, 0.0, 0.0, 0.0, fov=narrow))
    wide = np.degrees(2 * np.arctan(fold * 1.05 * 800 / 1000))
    with pytest.raises(
        ValueError, match=r"camera 'a': its lens, .*, folds over .* which extends to 500 pixels; expected"
    ):
        check_lens(camera(-0.37, 0.0, 0.0, 0.0, 0.0, fov=wide))
