"""Tables of pages: groups of joints of any skeleton, numbers that do not exist."""

import numpy as np
import pytest

from mvpose import COCO17, PANOPTIC19, SHELF14
from mvpose.report.palette import COCO17_LIMBS, limbs_of
from mvpose.report.tables import NOTHING, joint_groups, number, residual_table
from mvpose.wholebody import SKELETONS, skeleton_by_name

ALL = [COCO17, SHELF14, PANOPTIC19, *(skeleton_by_name(name) for name in SKELETONS)]


@pytest.mark.parametrize("skeleton", ALL, ids=lambda each: each.name)
class TestEverySkeleton:
    def test_its_joints_are_in_few_groups_that_both_sides_share(self, skeleton):
        names, index = joint_groups(skeleton)
        assert len(names) <= 16
        assert set(index) == set(range(len(names)))
        assert (index == index[list(skeleton.mirror)]).all()

    def test_its_limbs_touch_all_joints_but_those_of_the_midline(self, skeleton):
        limbs = limbs_of(skeleton)
        assert len(set(limbs)) == len(limbs)
        left_out = set(range(len(skeleton))) - {joint for limb in limbs for joint in limb}
        assert all(skeleton.mirror[joint] == joint for joint in left_out)
        sides = [(skeleton.joints[a][:5], skeleton.joints[b][:5]) for a, b in limbs]
        crossing = [limb for limb in sides if set(limb) == {"left_", "right"}]
        assert len(crossing) <= 3  # shoulders and hips; and the eyes of a tree


def test_the_limbs_of_coco_are_those_of_pictures():
    assert limbs_of(COCO17) == COCO17_LIMBS


def test_hands_and_faces_are_one_group_each():
    names, index = joint_groups(skeleton_by_name("wholebody133"))
    assert (index == names.index("face")).sum() == 68
    assert (index == names.index("hand")).sum() == 42


def test_a_ghost_does_not_bleach_the_shades_of_all_others():
    rng = np.random.default_rng(2)
    cells = rng.uniform(2.0, 9.0, (9, 5))
    cells[3, 2], plain = 20.0, cells.copy()
    plain[3, 2] = 4000.0
    shades = []
    for each in (cells, plain):
        totals = dict(by_row=each[:, 0], by_column=each[0], overall=5.0)
        table = residual_table(list("abcde"), each, rows=list("abcdefghi"), **totals)
        shades.append(np.array([[cell.share for cell in row[:5]] for _, row in table.rows[:9]]))
    np.testing.assert_allclose(*shades)
    assert shades[0][3, 2] == shades[0].max() == 1.0
    assert np.median(shades[0]) > 0.4


def test_what_does_not_exist_is_a_dash_without_shade():
    cells = np.array([[1.0, np.nan], [4.0, 2.0]])
    table = residual_table("ab", cells, rows=["x", "y"], by_row=cells[:, 0], by_column=cells[1], overall=np.nan)
    texts = [[cell.text for cell in row] for _, row in table.rows]
    assert texts == [["1.0", NOTHING, "1.0"], ["4.0", "2.0", "4.0"], ["4.0", "2.0", NOTHING]]
    assert [cell.share for cell in table.rows[0][1]] == [0.25, 0.0, 0.0]
    assert number(np.inf) == NOTHING
