import numpy as np
import pytest

from simharness.world.humans.anatomy import DOFS, PAIRED_SEGMENTS, RANGES, mass_fractions


def test_there_are_9_degrees_of_freedom_of_the_trunk_and_13_of_the_limbs_of_each_side():
    assert len(DOFS) == len(set(DOFS)) == 35
    left = [name.removeprefix("left_") for name in DOFS if name.startswith("left_")]
    right = [name.removeprefix("right_") for name in DOFS if name.startswith("right_")]
    assert left == right
    assert len(left) == 13


def test_ranges_include_the_neutral_pose_and_are_equal_on_both_sides():
    for name, (low, high) in RANGES.items():
        assert low < 0 < high, name
        assert high - low < 2 * np.pi, name
        assert RANGES[name.replace("left", "right")] == (low, high)


def test_spine_ranges_are_symmetric():
    for name, (low, high) in RANGES.items():
        if name.endswith("bending") or name in ("lumbar_rotation", "thorax_rotation", "neck_rotation"):
            assert low == -high


@pytest.mark.parametrize("gender", [0.0, 0.3, 1.0])
def test_masses_sum_to_the_whole_body(gender):
    shares = mass_fractions(gender)
    assert all(share > 0 for share in shares.values())
    assert sum(share * (2 if name in PAIRED_SEGMENTS else 1) for name, share in shares.items()) == pytest.approx(1)


def test_mass_fractions_are_those_of_de_leva():
    assert mass_fractions(0.0)["thigh"] == pytest.approx(0.1416, abs=1e-4)
    assert mass_fractions(1.0)["thigh"] == pytest.approx(0.1478, abs=1e-4)
    assert mass_fractions(0.0)["head"] == pytest.approx(0.0694, abs=1e-4)
