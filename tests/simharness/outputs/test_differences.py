"""Differences between variants: pairing of trials."""

import numpy as np
import polars as pl
from hypothesis import given
from hypothesis import strategies as st

from simharness.outputs.study.tables import COLUMNS, differences

KEYS = [info.key for info in COLUMNS]
AT = KEYS.index("mpjpe_mm")


def trials_of(rows):
    """Return a table of trials with ``variant``, ``seed``, a factor and MPJPE; all other scores are null."""
    empty = dict.fromkeys(KEYS)
    table = [
        {"trial": f"{factor} {seed}", "case": "", "varied": "", "seed": seed, "variant": variant, "factor": factor}
        | empty
        | {"mpjpe_mm": error, "seconds": 1.0 + len(variant), "scenario": "{}"}
        for variant, seed, factor, error in rows
    ]
    return pl.DataFrame(table, schema_overrides=dict.fromkeys(KEYS, pl.Float64))


def difference(rows):
    return differences(trials_of(rows), ["A", "B"])["B"][AT]


def written(cell):
    return float(cell.text.replace("−", "-"))


def test_settings_that_one_variant_lacks_are_not_compared():
    """A has results at both settings, B only at the easy one, where it is 10 mm worse: it is not better by 215 mm."""
    rows = [
        row
        for seed in range(6)
        for row in (("A", seed, 1, 50.0), ("A", seed, 2, 500.0 + seed), ("B", seed, 1, 60.0), ("B", seed, 2, None))
    ]
    assert written(difference(rows)) == 10.0
    lost = [row for row in rows if row[3] is not None]  # nor where the trial itself is missing
    assert difference(lost) == difference(rows)
    other = [("B" if variant == "A" else "A", *rest) for variant, *rest in rows]
    assert written(difference(other)) == -10.0


@given(
    known=st.lists(st.lists(st.sampled_from("AB2"), min_size=3, max_size=3), min_size=2, max_size=5),
    shift=st.integers(-40, 40),
)
def test_a_constant_difference_is_found_whichever_settings_have_the_score(known, shift):
    """Settings have very different scores, and either variant may lack the score of some."""
    rows = []
    for seed, settings in enumerate(known):
        for factor, who in enumerate(settings):
            error = 100.0 * 3**factor + seed
            rows += [("A", seed, factor, error if who in "A2" else None)]
            rows += [("B", seed, factor, error + shift if who in "B2" else None)]
    cell = difference(rows)
    if any("2" in settings for settings in known):
        assert written(cell) == shift
    else:
        assert cell.text == "–"


def test_seeds_weigh_alike_however_many_settings_they_have():
    rows = [("A", 0, factor, 50.0) for factor in range(3)] + [("B", 0, factor, 60.0) for factor in range(3)]
    rows += [("A", 1, 0, 50.0), ("B", 1, 0, 80.0)]
    assert written(difference(rows)) == np.mean([10.0, 30.0])


def test_a_factor_without_a_value_is_a_setting_like_any_other():
    rows = [row for seed in range(3) for row in (("A", seed, None, 50.0), ("B", seed, None, 55.0))]
    assert written(difference(rows)) == 5.0
