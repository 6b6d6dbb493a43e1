"""The faces that expressions and beards colour can be found again."""

import numpy as np

from simharness.world.humans.face_colors import _marks
from tools.body.faces import marked_faces


def test_the_shipped_marks_are_those_that_the_tool_finds():
    found, shipped = marked_faces(), _marks()
    assert found.keys() == shipped.keys()
    for name, values in found.items():
        np.testing.assert_allclose(values, shipped[name], rtol=1e-6, err_msg=name)
