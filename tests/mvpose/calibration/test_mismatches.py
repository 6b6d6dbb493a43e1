"""People taken for somebody else in one view are left out, and those that a moved camera misplaces are not."""

import numpy as np

from mvpose.calibration.normal_equations import _much_farther


def test_one_person_far_off_is_wrong_and_all_people_far_off_are_not():
    off = np.array([[0.9, 12.0, np.nan], [1.1, 10.0, 20.0], [9.0, 14.0, np.nan]])
    expected = np.zeros((3, 3), bool)
    expected[2, 0] = True
    np.testing.assert_array_equal(_much_farther(off), expected)


def test_noise_is_not_wrong():
    assert not _much_farther(np.array([[0.5], [3.9]])).any()
