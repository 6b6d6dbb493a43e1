"""Verdicts of a blame: withheld where its intervals say nothing."""

import numpy as np
import pytest

from simharness.study.causes.blame_text import conclusion, surest
from simharness.study.causes.cause_shares import Blame, Mending, Share, difference_interval


def blamed(gains):
    """Return a blame in which mending the boxes gains so many points of PCP at each seed, and the noise nothing."""
    gains = np.array(gains, float)
    gain, none = (difference_interval(each, "%") for each in (gains, 0 * gains))
    before, after = (difference_interval(each, "%") for each in (90 - gains, 90 + 0 * gains))
    shares = (Share("boxes", gain, gain, gain), Share("noise", none, none, none))
    mending = Mending(("boxes",), after, gain, 1.0) if gain.mean > 0 else None
    seeds = tuple(range(len(gains)))
    return Blame("lab", "", "full", "pcp", seeds, before, after, none, shares, mending, ())


@pytest.mark.parametrize("gains", [[0.0, 0.0, 6.3], [9.0, -3.0, 5.0], [4.0]])
def test_no_verdict_where_the_interval_reaches_zero(gains):
    text = f"{conclusion(blamed(gains))} {surest(blamed(gains))}"
    assert "Mend first" not in text
    assert "largest cause" not in text
    assert text.startswith("No cause is certain: mending missed and merged boxes gains")
    assert "more seeds" in text


def test_a_gain_of_three_seeds_has_an_interval_of_the_size_of_the_gain():
    gain = difference_interval(np.array([0.0, 0.0, 6.3]), "%")
    assert -15 < gain.low < 0
    assert 2.1 < gain.high < 20


def test_a_certain_gain_has_a_verdict():
    found = blamed([4.0, 5.0, 6.0, 5.5])
    assert conclusion(found).startswith("Mend first: missed and merged boxes. PCP is then 90.0")
    assert surest(found).startswith("The largest cause is missed and merged boxes, 5.1 (")


def test_the_advised_number_of_seeds_is_about_enough():
    rng = np.random.default_rng(0)
    few = blamed([2.0, 9.0, -4.0, 3.0])
    advised = int(conclusion(few).split("about ")[1].rstrip("."))
    assert 10 <= advised <= 60
    gains = rng.choice([2.0, 9.0, -4.0, 3.0], (40, advised))
    assert np.mean([blamed(each).mending.gain.low > 0 for each in gains]) > 0.5


def test_nothing_to_gain():
    assert conclusion(blamed([0.0, -1.0])).endswith("nothing is to be gained.")
    assert surest(blamed([0.0, -1.0])) == ""
