import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit

from simharness.types.random_streams import stream
from tools.reid import histogram
from tools.reid.metrics import (
    HIDDEN_EDGES,
    QUANTILES,
    VIEW_EDGES,
    Pairs,
    distributions,
    euclidean,
    fitted_sigmoid,
    pairs,
    retrieve,
)


def table(rows):
    return np.array(rows, float)


def test_average_precision_of_a_gallery_worked_by_hand():
    # The query's two answers come first and third of four: (1/1 + 2/3) / 2.
    distances = np.full((5, 5), 9.0)
    distances[0] = [0.0, 0.1, 0.2, 0.3, 0.4]
    identity, camera = np.array([0, 0, 1, 0, 1]), np.array([0, 1, 1, 2, 2])
    only = np.array([0, 0, 0, 0, 0])
    whole = retrieve(distances, identity, camera)
    assert whole.queries == 5
    alone = retrieve(distances[:, :], identity, camera, within=only)
    assert alone.rank1 == whole.rank1
    # Everyone else's row is all ties, which keep their order.
    precisions = [(1 + 2 / 3) / 2, (1 + 2 / 2) / 2, 1 / 3, (1 + 2 / 2) / 2, 1 / 3]
    assert whole.mean_average_precision == pytest.approx(np.mean(precisions))
    assert whole.ranks[1] == pytest.approx(3 / 5)
    assert whole.ranks[5] == 1.0


@given(st.integers(0, 10**6))
def test_retrieval_agrees_with_a_loop(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 14))
    identity, camera, group = (rng.integers(0, high, count) for high in (3, 3, 2))
    distances = rng.random((count, count))
    first, precision = [], []
    for q in range(count):
        gallery = [g for g in range(count) if camera[g] != camera[q] and group[g] == group[q]]
        gallery.sort(key=lambda g, q=q: distances[q, g])
        hits = [identity[g] == identity[q] for g in gallery]
        if any(hits):
            first.append(hits[0])
            precision.append(np.mean([sum(hits[: k + 1]) / (k + 1) for k in range(len(hits)) if hits[k]]))
    if not first:
        with pytest.raises(ValueError, match="nothing can be retrieved"):
            retrieve(distances, identity, camera, within=group)
        return
    found = retrieve(distances, identity, camera, within=group)
    assert found.queries == len(first)
    assert found.rank1 == pytest.approx(np.mean(first))
    assert found.mean_average_precision == pytest.approx(np.mean(precision))
    assert found.ranks[1] <= found.ranks[5] <= found.ranks[10]


def test_ones_own_camera_answers_nothing():
    identity, camera = np.array([0, 0, 1, 1]), np.array([0, 0, 0, 0])
    with pytest.raises(ValueError, match="nothing can be retrieved"):
        retrieve(np.zeros((4, 4)), identity, camera)


def test_distances_of_unit_vectors():
    found = euclidean(np.array([[1, 0], [0, 1], [-1, 0]]))
    np.testing.assert_allclose(found, [[0, 2**0.5, 2], [2**0.5, 0, 2**0.5], [2, 2**0.5, 0]], atol=1e-6)


def test_pairs_are_of_one_moment_and_two_views():
    identity, moment, view = np.array([4, 4, 7, 4]), np.array([0, 0, 0, 1]), np.array([0, 1, 1, 0])
    azimuth, hidden = np.radians([170.0, -170.0, 0.0, 0.0]), np.array([0.0, 0.3, 0.1, 0.0])
    found = pairs(np.arange(16.0).reshape(4, 4), identity, moment, view, azimuth, hidden)
    np.testing.assert_array_equal(found.people, [[4, 4], [4, 7]])
    np.testing.assert_array_equal(found.same, [True, False])
    np.testing.assert_allclose(found.turn, [20.0, 170.0])
    np.testing.assert_allclose(found.hidden, [0.3, 0.1])
    np.testing.assert_allclose(found.distance, [1.0, 2.0])


def drawn(seed, midpoint, slope, count=40000):
    rng = stream(seed, "pairs")
    distance = rng.uniform(midpoint - 0.5, midpoint + 0.5, count)  # even about the midpoint: so are both kinds
    same = rng.random(count) < expit((midpoint - distance) / slope)
    people = np.where(same[:, None], [0, 0], [0, 1])
    return Pairs(distance, same, rng.uniform(0, 180, count), rng.uniform(0, 0.6, count), people)


def chosen(met, rows):
    return Pairs(*(getattr(met, key)[rows] for key in ("distance", "same", "turn", "hidden", "people")))


@pytest.mark.parametrize(("midpoint", "slope"), [(0.9, 0.1), (1.1, 0.05)])
def test_the_sigmoid_that_drew_the_pairs_is_found_again(midpoint, slope):
    found = fitted_sigmoid(drawn(1, midpoint, slope))
    assert found == (pytest.approx(midpoint, abs=0.01), pytest.approx(slope, rel=0.1))


def test_how_common_a_kind_is_does_not_move_the_sigmoid():
    even = drawn(2, 1.0, 0.1)
    rows = even.same | (np.arange(len(even.same)) % 4 == 0)
    assert fitted_sigmoid(chosen(even, rows))[0] == pytest.approx(fitted_sigmoid(even)[0], abs=0.01)
    with pytest.raises(ValueError, match="pairs of one person and pairs of two"):
        fitted_sigmoid(
            Pairs(*(getattr(even, key)[even.same] for key in ("distance", "same", "turn", "hidden", "people")))
        )


def test_distributions_count_every_pair_once_and_draw_what_they_were_taken_from():
    met = drawn(3, 1.0, 0.1)
    found = distributions(met)
    for name, kind in (("same", met.same), ("other", ~met.same)):
        cells = [cell for row in found[name]["bins"] for cell in row]
        assert len(cells) == (len(VIEW_EDGES) - 1) * (len(HIDDEN_EDGES) - 1)
        assert sum(cell["pairs"] for cell in cells) == kind.sum() == found[name]["all"]["pairs"]
        levels = found[name]["all"]["quantiles"]
        assert (np.diff(levels) >= 0).all()
        redrawn = np.interp(stream(4, "u").random(40000), QUANTILES, levels)
        assert redrawn.mean() == pytest.approx(met.distance[kind].mean(), abs=0.01)
        assert redrawn.std() == pytest.approx(met.distance[kind].std(), rel=0.05)
        assert found[name]["all"]["cosine"] == pytest.approx(np.mean(1 - met.distance[kind] ** 2 / 2), abs=1e-3)


def test_spread_is_what_lasts_and_what_does_not():
    people = np.array([[0, 1]] * 2 + [[0, 2]] * 2)
    found = distributions(Pairs(np.array([0.9, 1.1, 1.2, 1.4]), np.zeros(4, bool), np.zeros(4), np.zeros(4), people))[
        "other"
    ]
    assert found["between"] == pytest.approx(0.15)
    assert found["within"] == pytest.approx(0.1)


def test_joined_pairs_keep_people_apart():
    met = drawn(5, 1.0, 0.1, 200)
    both = Pairs.joined([met, met])
    np.testing.assert_array_equal(both.distance, np.tile(met.distance, 2))
    assert len(np.unique(both.people[both.same], axis=0)) == 2 * len(np.unique(met.people[met.same], axis=0))
    assert distributions(both)["other"]["all"]["quantiles"] == pytest.approx(
        distributions(met)["other"]["all"]["quantiles"], abs=0.02
    )


def test_empty_bins_say_so():
    found = distributions(Pairs(np.array([1.0]), np.array([True]), np.zeros(1), np.zeros(1), np.zeros((1, 2), int)))
    assert found["same"]["bins"][0][0]["pairs"] == 1
    assert found["same"]["bins"][5][4] == {
        "pairs": 0,
        "mean": None,
        "deviation": None,
        "cosine": None,
        "quantiles": None,
    }
    assert found["other"]["all"]["pairs"] == 0


def test_histograms_are_unit_vectors_that_know_where_a_colour_is():
    image = np.zeros((3, 128, 64, 3), np.uint8)
    image[0, :64], image[0, 64:] = (200, 40, 40), (40, 40, 200)
    image[1] = image[0, ::-1]
    image[2] = image[0, :, ::-1]
    found = histogram.describe(image)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-6)
    distances = euclidean(found)
    assert distances[0, 1] == pytest.approx(2**0.5, abs=1e-3)
    assert distances[0, 2] == pytest.approx(0.0, abs=1e-3)


def test_balancing_takes_a_cast_off():
    rng = np.random.default_rng(0)
    blocks = np.kron(rng.integers(40, 160, (8, 4, 3)), np.ones((16, 16, 1))).astype(float)
    cast = blocks * [1.3, 1.0, 0.8]
    pair = np.stack([blocks, cast]).astype(np.uint8)
    assert euclidean(histogram.describe(pair))[0, 1] < 0.5 * euclidean(histogram.describe(pair, balanced=False))[0, 1]
