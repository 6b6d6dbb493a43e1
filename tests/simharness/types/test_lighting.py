from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from simharness.types.lighting import Lighting, facing

NUMBER = st.floats(-1, 1)


def test_the_direction_is_kept_as_a_unit_vector():
    light = Lighting(direction=(0, 3, 4))
    assert light.direction == pytest.approx((0, 0.6, 0.8))
    assert light == Lighting(direction=np.array([0, 0.6, 0.8]))
    assert hash(light) == hash(Lighting(direction=(0, 3, 4)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"direction": (0, 0, 0)}, "direction must point to a light above the floor"),
        ({"direction": (1, 0, -0.1)}, "must point to a light above the floor"),
        ({"direction": (1, 0)}, r"lighting direction must be finite, \(3,\)"),
        ({"direction": (1, 0, float("nan"))}, "lighting direction must be finite"),
        ({"key": -1}, "must not be negative, got key -1"),
        ({"sky": float("inf")}, "lighting sky must be finite, a number, got inf"),
        ({"tint": (1, 2, 1)}, r"lighting tint must lie in 0..1"),
        ({"background": (1, 255, 1)}, r"lighting background must lie in 0..1"),
    ],
)
def test_bad_light_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Lighting(**change)


@given(NUMBER, NUMBER, NUMBER)
def test_axes_that_face_a_direction(x, y, z):
    direction = np.array([x, y, z])
    assume(np.linalg.norm(direction) > 0.1)
    direction /= np.linalg.norm(direction)
    R = facing(direction)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[2], -direction, atol=1e-12)
