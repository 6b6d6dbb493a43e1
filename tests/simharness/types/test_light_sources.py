from __future__ import annotations

import numpy as np
import pytest

from simharness.types.lighting import AreaLight, LightSources, Sun

PANEL = AreaLight((0, 0, 3), (0, 0.3, 0), (0.6, 0, 0), (2, 2, 2))


def test_an_area_light_shines_to_the_side_of_its_normal():
    np.testing.assert_allclose(PANEL.normal, (0, 0, -1))
    np.testing.assert_allclose(
        np.cross(PANEL.corners[1] - PANEL.corners[0], PANEL.corners[2] - PANEL.corners[1]), (0, 0, -0.72)
    )
    assert hash(PANEL) == hash(AreaLight(np.array([0, 0, 3]), (0, 0.3, 0), (0.6, 0, 0), (2, 2, 2)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: AreaLight((0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 1)), "center of a light must be three finite numbers"),
        (lambda: AreaLight((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 1, 1)), "must be perpendicular"),
        (lambda: AreaLight((0, 0, 0), (0, 0, 0), (1, 1, 0), (1, 1, 1)), "longer than 0"),
        (lambda: AreaLight((0, 0, 0), (0, 1, 0), (1, 0, 0), (1, -1, 1)), "radiance and focus of at least 0"),
        (lambda: Sun((0, 0, -1), (1, 1, 1)), "above the horizon"),
        (LightSources, "without any light"),
        (lambda: LightSources((PANEL,), brightness=0), "brightness above 0"),
    ],
)
def test_bad_sources_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
