import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit

from simharness.types.random_streams import stream
from tools.reid.metrics import (
    HIDDEN_EDGES,
    QUANTILES,
    VIEW_EDGES,
    Pairs,
    distributions,
    euclidean_distances,
    fit_sigmoid,
    pairs_in_shots,
    retrieve,
)
from tools.reid.scores import histogram_descriptors


def test_average_precision_of_a_gallery_by_hand():
    # The two crops of the query's person have ranks 1 and 3 of 4: (1/1 + 2/3) / 2.
    distances = np.full((5, 5), 9.0)
    distances[0] = [0.0, 0.1, 0.2, 0.3, 0.4]
    identity, camera = np.array([0, 0, 1, 0, 1]), np.array([0, 1, 1, 2, 2])
    only = np.array([0, 0, 0, 0, 0])
    whole = retrieve(distances, identity, camera)
    assert whole.queries == 5
    alone = retrieve(distances[:, :], identity, camera, within=only)
    assert alone.rank1 == whole.rank1
    # All other rows are ties, which keep their order.
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
        with pytest.raises(ValueError, match="at least one person in two cameras"):
            retrieve(distances, identity, camera, within=group)
        return
    retrieval = retrieve(distances, identity, camera, within=group)
    assert retrieval.queries == len(first)
    assert retrieval.rank1 == pytest.approx(np.mean(first))
    assert retrieval.mean_average_precision == pytest.approx(np.mean(precision))
    assert retrieval.ranks[1] <= retrieval.ranks[5] <= retrieval.ranks[10]


def test_crops_of_the_same_camera_are_not_in_the_gallery():
    identity, camera = np.array([0, 0, 1, 1]), np.array([0, 0, 0, 0])
    with pytest.raises(ValueError, match="at least one person in two cameras"):
        retrieve(np.zeros((4, 4)), identity, camera)


def test_distances_of_unit_vectors():
    distances = euclidean_distances(np.array([[1, 0], [0, 1], [-1, 0]]))
    np.testing.assert_allclose(distances, [[0, 2**0.5, 2], [2**0.5, 0, 2**0.5], [2, 2**0.5, 0]], atol=1e-6)


def test_pairs_are_crops_of_one_shot_in_two_views():
    identity, shot, view = np.array([4, 4, 7, 4]), np.array([0, 0, 0, 1]), np.array([0, 1, 1, 0])
    azimuth, hidden = np.radians([170.0, -170.0, 0.0, 0.0]), np.array([0.0, 0.3, 0.1, 0.0])
    pairs = pairs_in_shots(np.arange(16.0).reshape(4, 4), identity, shot, view, azimuth, hidden)
    np.testing.assert_array_equal(pairs.people, [[4, 4], [4, 7]])
    np.testing.assert_array_equal(pairs.same, [True, False])
    np.testing.assert_allclose(pairs.angle, [20.0, 170.0])
    np.testing.assert_allclose(pairs.hidden, [0.3, 0.1])
    np.testing.assert_allclose(pairs.distance, [1.0, 2.0])


def drawn(seed, midpoint, slope, count=40000):
    rng = stream(seed, "pairs")
    distance = rng.uniform(midpoint - 0.5, midpoint + 0.5, count)  # symmetric about the midpoint: both kinds balance
    same = rng.random(count) < expit((midpoint - distance) / slope)
    people = np.where(same[:, None], [0, 0], [0, 1])
    return Pairs(distance, same, rng.uniform(0, 180, count), rng.uniform(0, 0.6, count), people)


def subset(pairs, rows):
    return Pairs(*(getattr(pairs, key)[rows] for key in ("distance", "same", "angle", "hidden", "people")))


@pytest.mark.parametrize(("midpoint", "slope"), [(0.9, 0.1), (1.1, 0.05)])
def test_the_fit_recovers_the_sigmoid_that_the_pairs_were_drawn_from(midpoint, slope):
    fitted = fit_sigmoid(drawn(1, midpoint, slope))
    assert fitted == (pytest.approx(midpoint, abs=0.01), pytest.approx(slope, rel=0.1))


def test_the_sigmoid_does_not_depend_on_the_frequency_of_a_kind_of_pairs():
    even = drawn(2, 1.0, 0.1)
    rows = even.same | (np.arange(len(even.same)) % 4 == 0)
    assert fit_sigmoid(subset(even, rows))[0] == pytest.approx(fit_sigmoid(even)[0], abs=0.01)
    with pytest.raises(ValueError, match=r"pairs of the same person and pairs of two people, got \d+ and 0"):
        fit_sigmoid(subset(even, even.same))


def test_distributions_count_every_pair_once_and_quantiles_reproduce_the_distances():
    pairs = drawn(3, 1.0, 0.1)
    result = distributions(pairs)
    for name, kind in (("same", pairs.same), ("other", ~pairs.same)):
        cells = [cell for row in result[name]["bins"] for cell in row]
        assert len(cells) == (len(VIEW_EDGES) - 1) * (len(HIDDEN_EDGES) - 1)
        assert sum(cell["pairs"] for cell in cells) == kind.sum() == result[name]["all"]["pairs"]
        levels = result[name]["all"]["quantiles"]
        assert (np.diff(levels) >= 0).all()
        redrawn = np.interp(stream(4, "u").random(40000), QUANTILES, levels)
        assert redrawn.mean() == pytest.approx(pairs.distance[kind].mean(), abs=0.01)
        assert redrawn.std() == pytest.approx(pairs.distance[kind].std(), rel=0.05)
        assert result[name]["all"]["cosine"] == pytest.approx(np.mean(1 - pairs.distance[kind] ** 2 / 2), abs=1e-3)


def test_deviation_between_and_within_pairs_of_people():
    people = np.array([[0, 1]] * 2 + [[0, 2]] * 2)
    pairs = Pairs(np.array([0.9, 1.1, 1.2, 1.4]), np.zeros(4, bool), np.zeros(4), np.zeros(4), people)
    other = distributions(pairs)["other"]
    assert other["between"] == pytest.approx(0.15)
    assert other["within"] == pytest.approx(0.1)


def test_people_of_joined_pairs_get_separate_indices():
    pairs = drawn(5, 1.0, 0.1, 200)
    both = Pairs.joined([pairs, pairs])
    np.testing.assert_array_equal(both.distance, np.tile(pairs.distance, 2))
    assert len(np.unique(both.people[both.same], axis=0)) == 2 * len(np.unique(pairs.people[pairs.same], axis=0))
    assert distributions(both)["other"]["all"]["quantiles"] == pytest.approx(
        distributions(pairs)["other"]["all"]["quantiles"], abs=0.02
    )


def test_empty_bins_have_no_values():
    result = distributions(Pairs(np.array([1.0]), np.array([True]), np.zeros(1), np.zeros(1), np.zeros((1, 2), int)))
    assert result["same"]["bins"][0][0]["pairs"] == 1
    assert result["same"]["bins"][5][4] == {
        "pairs": 0,
        "mean": None,
        "deviation": None,
        "cosine": None,
        "quantiles": None,
    }
    assert result["other"]["all"]["pairs"] == 0


def test_histograms_are_unit_vectors_and_depend_on_the_height_of_a_colour():
    image = np.zeros((3, 128, 64, 3), np.uint8)
    image[0, :64], image[0, 64:] = (200, 40, 40), (40, 40, 200)
    image[1] = image[0, ::-1]
    image[2] = image[0, :, ::-1]
    descriptors = histogram_descriptors(image)
    np.testing.assert_allclose(np.linalg.norm(descriptors, axis=1), 1.0, atol=1e-6)
    distances = euclidean_distances(descriptors)
    assert distances[0, 1] == pytest.approx(2**0.5, abs=1e-3)
    assert distances[0, 2] == pytest.approx(0.0, abs=1e-3)


def test_white_balance_removes_a_colour_cast():
    rng = np.random.default_rng(0)
    blocks = np.kron(rng.integers(40, 160, (8, 4, 3)), np.ones((16, 16, 1))).astype(float)
    cast = blocks * [1.3, 1.0, 0.8]
    pair = np.stack([blocks, cast]).astype(np.uint8)
    with_balance, without = (
        euclidean_distances(histogram_descriptors(pair, balanced=balanced))[0, 1] for balanced in (True, False)
    )
    assert with_balance < 0.5 * without
