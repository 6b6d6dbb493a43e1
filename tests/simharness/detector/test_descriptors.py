"""Drawn descriptors against the distances of the network that they stand for."""

import json

import numpy as np
import pytest
from worlds import world

from mvpose.networks.reid import DEFAULT
from simharness.detector.describing import Looks
from simharness.detector.descriptors import DescriptorModel
from simharness.detector.detect import detect
from simharness.detector.viewing import bearings, hidden_shares
from simharness.rendering.visibility import Visibility
from simharness.scenario.detector import Detector

PEOPLE, VIEWS = 12, 5


@pytest.fixture(scope="module")
def card():
    return json.loads(DEFAULT.with_suffix(".json").read_text())["distances"]


@pytest.fixture(scope="module")
def model():
    return DescriptorModel.of_network(DEFAULT)


def groups(model, dial, hidden, *, seeds=60):
    """Distances of pairs of crops of one moment: of one person, and of two; everybody is seen in all views."""
    rng = np.random.default_rng(0)
    who = [("person", person) for person in range(PEOPLE) for _ in range(VIEWS)]
    same = np.arange(len(who))[:, None] // VIEWS == np.arange(len(who)) // VIEWS
    pair = np.triu(np.ones(same.shape, bool), 1)
    one, two = [], []
    for seed in range(seeds):
        drawn = model.draw(
            who,
            bearing=rng.uniform(-np.pi, np.pi, len(who)),
            hidden=hidden(rng, len(who)),
            noise=rng.standard_normal((len(who), model.dimensions)),
            unease=rng.standard_normal(len(who)),
            look_alike=dial,
            seed=seed,
        )
        distance = np.linalg.norm(drawn[:, None] - drawn, axis=-1)
        one.append(distance[pair & same])
        two.append(distance[pair & ~same])
    return {"same": np.concatenate(one), "other": np.concatenate(two)}


def as_measured(card, kind):
    """A draw of hidden shares such that the worse of two crops has the measured ones."""
    edges = np.array(card["hidden_share_of_the_joints_of_the_worse_crop"])
    pairs = np.array([[bin_["pairs"] for bin_ in row] for row in card["look_alike"]["0"][kind]["bins"]]).sum(axis=0)
    worse = np.cumsum(pairs) / pairs.sum()

    def draw(rng, count):
        bin_ = np.searchsorted(np.sqrt(worse), rng.random(count)).clip(max=len(pairs) - 1)
        return edges[bin_] + rng.random(count) * (edges[bin_ + 1] - edges[bin_])

    return draw


@pytest.mark.parametrize("dial", ["0", "0.25", "0.5", "0.75", "1"])
def test_distances_are_distributed_as_the_networks(model, card, dial):
    drawn = groups(model, float(dial), as_measured(card, "same"))
    for kind in ("same", "other"):
        measured = card["look_alike"][dial][kind]["all"]
        assert drawn[kind].mean() == pytest.approx(measured["mean"], abs=0.03)
        assert drawn[kind].std() == pytest.approx(measured["deviation"], abs=0.025)
        ranks = [rank for rank in card["quantiles"] if 0.05 <= rank <= 0.95]
        asked = [value for rank, value in zip(card["quantiles"], measured["quantiles"], strict=True) if rank in ranks]
        np.testing.assert_allclose(np.quantile(drawn[kind], ranks), asked, atol=0.06)


def test_what_is_hidden_moves_one_person_apart_as_in_the_network(model, card):
    edges = card["hidden_share_of_the_joints_of_the_worse_crop"]
    for h in (0, len(edges) - 2):
        bins = [row[h] for row in card["look_alike"]["0"]["same"]["bins"] if row[h]["pairs"]]
        measured = np.average([bin_["mean"] for bin_ in bins], weights=[bin_["pairs"] for bin_ in bins])
        middle = (edges[h] + edges[h + 1]) / 2

        def hidden(rng, count, middle=middle):
            return np.where(np.arange(count) % VIEWS == 0, middle, edges[1] / 2)  # one crop of each person

        drawn = groups(model, 0.0, hidden, seeds=20)["same"].reshape(-1, VIEWS * (VIEWS - 1) // 2)
        assert drawn[:, : VIEWS - 1].mean() == pytest.approx(measured, abs=0.05)


def test_two_views_of_one_side_are_nearer_than_front_and_back(model):
    rng = np.random.default_rng(1)
    count = 4000
    who = [("person", k // 2) for k in range(count)]

    def apart(turn):
        drawn = model.draw(
            who,
            bearing=np.where(np.arange(count) % 2, turn, 0.0),
            hidden=np.zeros(count),
            noise=rng.standard_normal((count, model.dimensions)),
            unease=rng.standard_normal(count),
            look_alike=0.0,
            seed=2,
        )
        return np.linalg.norm(drawn[::2] - drawn[1::2], axis=1)

    one_side, front_and_back = apart(0.0), apart(np.pi)
    error = np.hypot(*(each.std() / np.sqrt(len(each)) for each in (one_side, front_and_back)))
    assert front_and_back.mean() - one_side.mean() > 5 * error
    assert front_and_back.mean() < 1.2  # and still nearer than strangers


def test_bearings_turn_with_the_body_and_the_camera():
    where = world(frames=3, views=3, people=1)
    standing = np.zeros((1, 1, 17, 3))
    standing[..., [5, 11], :] = [[0.0, 0.2, 1.4], [0.0, 0.1, 0.9]]
    standing[..., [6, 12], :] = [[0.0, -0.2, 1.4], [0.0, -0.1, 0.9]]  # looks along +x
    found = bearings(standing, where.rig)[0, :, 0]
    for view, camera in enumerate(where.rig):
        assert np.cos(found[view] - np.arctan2(*camera.center[1::-1])) == pytest.approx(1.0)
    seen = np.array([Visibility.VISIBLE, Visibility.SELF_OCCLUDED, Visibility.OCCLUDED_BY_CLUTTER, Visibility.OUTSIDE])
    assert hidden_shares(seen.astype(np.int8)) == 0.5


class TestInDetections:
    """Descriptors of a whole sequence."""

    @staticmethod
    def described(model, *, look_alike=0.0, alike=0, **sections):
        where = world(frames=40, people=4)
        config = Detector.model_validate(sections)
        looks = Looks(model, look_alike, alike)
        return detect(where.sequence, where.views, where.rig, config, seed=3, looks=looks)

    def test_people_are_like_themselves_and_phantoms_like_nobody(self, model):
        frames = self.described(model, phantoms={"rate": 1.0, "life": 1.0})
        near = {"one": [], "two": [], "phantom": []}
        for frame in frames:
            drawn, person, view = frame.detections.descriptors, frame.truth.person, frame.detections.view
            np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 1.0)
            distance = np.linalg.norm(drawn[:, None] - drawn, axis=-1)
            across = view[:, None] < view
            real = person >= 0
            same = person[:, None] == person
            near["one"] += distance[across & same & real].tolist()
            near["two"] += distance[across & ~same & real & real[:, None]].tolist()
            near["phantom"] += distance[across & ~real & ~real[:, None]].tolist()
        assert len(near["phantom"]) > 50
        assert np.mean(near["one"]) < np.mean(near["two"]) - 0.25
        assert np.mean(near["phantom"]) > np.mean(near["one"]) + 0.25

    def test_some_may_look_alike(self, model):
        frames = self.described(model, look_alike=1.0, alike=2)

        def apart(one, other):
            result = []
            for frame in frames:
                mine, theirs = (frame.detections.descriptors[frame.truth.person == person] for person in (one, other))
                result.append(np.linalg.norm(mine[:, None] - theirs, axis=-1).mean())
            return np.mean(result)

        assert apart(0, 1) < apart(2, 3) - 0.1

    def test_without_looks_there_are_none_and_nothing_else_changes(self, model):
        where = world(frames=40, people=4)
        sections = {"keypoints": {"scatter": 0.3}, "phantoms": {"rate": 0.5}}
        plain = detect(where.sequence, where.views, where.rig, Detector.model_validate(sections), seed=3)
        for one, other in zip(plain, self.described(model, **sections), strict=True):
            assert one.detections.descriptors is None
            np.testing.assert_array_equal(one.detections.keypoints, other.detections.keypoints)


def test_a_network_without_measured_distances_is_refused(tmp_path):
    (tmp_path / "other.onnx").write_bytes(b"x")
    with pytest.raises(ValueError, match=r"other\.json: no card with the distances of other\.onnx"):
        DescriptorModel.of_network(tmp_path / "other.onnx")
