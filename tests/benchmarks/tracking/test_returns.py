"""Benchmark of returns: whose identities count as kept."""

import numpy as np
import pytest

from benchmarks.tracking.reappearance import main, returns


def test_a_return_counts_by_the_most_frequent_identities_and_not_where_nobody_is_found():
    ids = np.full((60, 4), 7)
    ids[:, 1:] = [5, 6, 8]
    hidden = np.zeros(ids.shape, bool)
    hidden[20:40] = True
    ids[20:40] = -1
    ids[44:47, 0] = 3  # before the second that counts, and for a short time in it
    ids[40:, 1] = 9
    ids[40:, 2] = -1
    ids[12:14, 3] = -1
    assert list(returns(ids, hidden, 0.1)) == [True, False, True]


@pytest.mark.slow
def test_most_people_of_a_scene_return_under_their_identities(capsys):
    main(["--count", "2"])
    share, _, returned = capsys.readouterr().out.splitlines()[-1].partition(" % of ")
    assert int(returned.split()[0]) >= 10
    assert float(share) >= 70.0
