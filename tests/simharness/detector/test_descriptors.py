"""Drawn descriptors against the distances of the network that they simulate."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from worlds import world

from mvpose.networks.reid import DEFAULT
from simharness.detector.descriptors import DescriptorModel, DescriptorSettings
from simharness.detector.detect import detect
from simharness.detector.viewing_conditions import bearings, hidden_shares
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.views import LookalikeViews, Visibility

PEOPLE, VIEWS = 12, 5


@pytest.fixture(scope="module")
def card():
    return json.loads(DEFAULT.with_suffix(".json").read_text())["distances"]


@pytest.fixture(scope="module")
def model():
    return DescriptorModel.of_network(DEFAULT)


def groups(model, level, hidden, *, seeds=60):
    """Return distances of pairs of crops of one moment, of one person and of two; all views see all people."""
    rng = np.random.default_rng(0)
    identity = [("person", person) for person in range(PEOPLE) for _ in range(VIEWS)]
    same = np.arange(len(identity))[:, None] // VIEWS == np.arange(len(identity)) // VIEWS
    pair = np.triu(np.ones(same.shape, bool), 1)
    one, two = [], []
    for seed in range(seeds):
        drawn = model.draw(
            identity,
            bearing=rng.uniform(-np.pi, np.pi, len(identity)),
            hidden=hidden(rng, len(identity)),
            noise=rng.standard_normal((len(identity), model.dimensions)),
            noise_level=rng.standard_normal(len(identity)),
            look_alike=level,
            seed=seed,
        )
        distance = np.linalg.norm(drawn[:, None] - drawn, axis=-1)
        one.append(distance[pair & same])
        two.append(distance[pair & ~same])
    return {"same": np.concatenate(one), "other": np.concatenate(two)}


def as_measured(card, kind):
    """Return a draw of hidden shares for which the worse of two crops has the measured distribution."""
    edges = np.array(card["hidden_share_of_the_joints_of_the_worse_crop"])
    pairs = np.array([[bin_["pairs"] for bin_ in row] for row in card["look_alike"]["0"][kind]["bins"]]).sum(axis=0)
    worse = np.cumsum(pairs) / pairs.sum()

    def draw(rng, count):
        bin_ = np.searchsorted(np.sqrt(worse), rng.random(count)).clip(max=len(pairs) - 1)
        return edges[bin_] + rng.random(count) * (edges[bin_ + 1] - edges[bin_])

    return draw


MISSED = pytest.mark.xfail(strict=True, reason="two harmonics of the bearing are too smooth between 0 and 60 degrees")


def levels(*missed):
    """Return the measured values of look_alike; where the model misses, tests are expected to fail."""
    return [pytest.param(each, marks=MISSED if each in missed else ()) for each in ("0", "0.25", "0.5", "0.75", "1")]


@pytest.mark.parametrize("level", levels())
def test_distances_have_the_mean_and_spread_of_the_network(model, card, level):
    drawn = groups(model, float(level), as_measured(card, "same"))
    for kind in ("same", "other"):
        measured = card["look_alike"][level][kind]["all"]
        assert drawn[kind].mean() == pytest.approx(measured["mean"], abs=0.03)
        assert drawn[kind].std() == pytest.approx(measured["deviation"], abs=0.025)


@pytest.mark.parametrize("level", levels())
def test_distances_have_the_quantiles_of_the_network(model, card, level):
    drawn = groups(model, float(level), as_measured(card, "same"))
    for kind in ("same", "other"):
        rows = zip(card["quantiles"], card["look_alike"][level][kind]["all"]["quantiles"], strict=True)
        ranks, expected = zip(*((rank, value) for rank, value in rows if 0.05 <= rank <= 0.95), strict=True)
        np.testing.assert_allclose(np.quantile(drawn[kind], ranks), expected, atol=0.06)


def test_occlusion_raises_distances_of_one_person_as_in_the_network(model, card):
    edges = card["hidden_share_of_the_joints_of_the_worse_crop"]
    for h in (0, len(edges) - 2):
        bins = [row[h] for row in card["look_alike"]["0"]["same"]["bins"] if row[h]["pairs"]]
        measured = np.average([bin_["mean"] for bin_ in bins], weights=[bin_["pairs"] for bin_ in bins])
        middle = (edges[h] + edges[h + 1]) / 2

        def hidden(rng, count, middle=middle):
            return np.where(np.arange(count) % VIEWS == 0, middle, edges[1] / 2)  # one crop of each person

        drawn = groups(model, 0.0, hidden, seeds=20)["same"].reshape(-1, VIEWS * (VIEWS - 1) // 2)
        assert drawn[:, : VIEWS - 1].mean() == pytest.approx(measured, abs=0.05)


@pytest.mark.parametrize("level", levels("0.75", "1"))
def test_distances_by_view_and_occlusion_are_those_of_the_network(model, card, level):
    """In every bin with enough measured pairs: within 0.05 and the standard error of the measurement."""
    turns, covers = card["view_difference_degrees"], card["hidden_share_of_the_joints_of_the_worse_crop"]
    hidden, rng = as_measured(card, "same"), np.random.default_rng(0)
    identity = [("person", person) for person in range(PEOPLE) for _ in range(VIEWS)]
    same = np.arange(len(identity))[:, None] // VIEWS == np.arange(len(identity)) // VIEWS
    once = np.triu(np.ones(same.shape, bool), 1)
    total, count = np.zeros((2, 2, len(turns) - 1, len(covers) - 1))
    for seed in range(200):
        bearing, cover = rng.uniform(-np.pi, np.pi, len(identity)), hidden(rng, len(identity))
        noise, noise_level = rng.standard_normal((len(identity), model.dimensions)), rng.standard_normal(len(identity))
        drawn = model.draw(
            identity,
            bearing=bearing,
            hidden=cover,
            noise=noise,
            noise_level=noise_level,
            look_alike=float(level),
            seed=seed,
        )
        distance = np.linalg.norm(drawn[:, None] - drawn, axis=-1)
        turn = np.degrees(np.arccos(np.cos(bearing[:, None] - bearing)))
        worse = np.maximum(cover[:, None], cover)
        for k, pair in enumerate((once & same, once & ~same)):
            total[k] += np.histogram2d(turn[pair], worse[pair], [turns, covers], weights=distance[pair])[0]
            count[k] += np.histogram2d(turn[pair], worse[pair], [turns, covers])[0]
    for k, kind in enumerate(("same", "other")):
        bins = card["look_alike"][level][kind]["bins"]
        filled = [(v, h, bin_) for v, row in enumerate(bins) for h, bin_ in enumerate(row) if bin_["pairs"] >= 100]
        assert len(filled) > 15
        for v, h, bin_ in filled:
            error = bin_["deviation"] / np.sqrt(bin_["pairs"])
            assert total[k, v, h] / count[k, v, h] == pytest.approx(bin_["mean"], abs=0.05 + error), (kind, v, h)


def apart(model, turn, *, pairs):
    """Return distances of two clear crops of one person at bearings ``turn`` apart, (pairs,), with the same draws."""
    rng, count = np.random.default_rng(1), 2 * pairs
    drawn = model.draw(
        [("person", k // 2) for k in range(count)],
        bearing=np.where(np.arange(count) % 2, turn, 0.0),
        hidden=np.zeros(count),
        noise=rng.standard_normal((count, model.dimensions)),
        noise_level=rng.standard_normal(count),
        look_alike=0.0,
        seed=2,
    )
    return np.linalg.norm(drawn[::2] - drawn[1::2], axis=1)


def test_front_and_back_are_nearer_than_front_and_side(model, card):
    """The outline is the same from behind; the network behaves so, too."""
    clear = [row[0]["mean"] for row in card["look_alike"]["0"]["same"]["bins"]]
    assert clear[-1] < max(clear[2:4])
    side, back = apart(model, np.pi / 2, pairs=3000), apart(model, np.pi, pairs=3000)
    assert side.mean() - back.mean() > 5 * np.hypot(side.std(), back.std()) / np.sqrt(3000)


def test_two_views_of_one_side_are_nearer_than_front_and_back(model):
    one_side, front_and_back = apart(model, 0.0, pairs=2000), apart(model, np.pi, pairs=2000)
    error = np.hypot(*(each.std() / np.sqrt(len(each)) for each in (one_side, front_and_back)))
    assert front_and_back.mean() - one_side.mean() > 5 * error
    assert front_and_back.mean() < 1.2  # and still nearer than different people


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


def with_decoys(where):
    """The world with a poster and the mirror image of its first person."""
    names = ("poster0", "mirror0/person0")
    pixels = where.views.boxes[:, :, :1, None, :2] if where.views.boxes.shape[2] else np.full((1, 1, 1, 1, 2), 100.0)
    shape = (*where.views.source.shape, len(names), 17)
    spread = np.random.default_rng(7).random((*shape[1:], 2)) * [80, 200]
    seen = LookalikeViews(names, np.broadcast_to(pixels, (*shape, 2)) + spread, np.ones(shape, bool))
    return replace(where, views=replace(where.views, lookalikes=seen))


def joined(base, change):
    """Return sections with some parameters changed."""
    merged = {key: {**base.get(key, {}), **value} for key, value in change.items() if isinstance(value, dict)}
    return {**base, **change, **merged}


class TestDetections:
    """Descriptors of a whole sequence."""

    @staticmethod
    def described(model, *, look_alike=0.0, alike=0, people=4, frames=40, **sections):
        where = with_decoys(world(frames=frames, people=people))
        config = DetectorSection.model_validate(sections)
        settings = DescriptorSettings(model, look_alike, alike)
        return detect(where.sequence, where.views, where.rig, config, seed=3, descriptors=settings)

    def test_people_are_near_themselves_and_phantoms_far_from_all(self, model):
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

    @pytest.mark.parametrize(
        "change",
        [
            {"boxes": {"duplicates": 0.3}},
            {"boxes": {"split": 0.3}},
            {"boxes": {"missed": 0.3}},
            {"phantoms": {"rate": 1.6}},
            {"decoys": {"share": 0.5}},
            {"people": 5},
        ],
        ids=str,
    )
    def test_a_parameter_changes_no_other_descriptor(self, model, change):
        base = {"phantoms": {"rate": 1.0, "life": 0.4, "views": 0.4}, "people": 4}
        before, after = (
            self.by_detection(self.described(model, **sections)) for sections in (base, joined(base, change))
        )
        # In this world more people change the bearings of the others.
        for real in (False,) if "people" in change else (False, True):
            both = [key for key in before[real] if key in after[real]]
            assert len(both) > 0.35 * len(before[real]) > 30
            for key in both:
                np.testing.assert_allclose(before[real][key], after[real][key])

    @staticmethod
    def by_detection(frames):
        """Return descriptors of false positives (False) and people (True) by frame, view, keypoints and scores."""
        result = {False: {}, True: {}}
        for t, frame in enumerate(frames):
            found = frame.detections
            for d, person in enumerate(frame.truth.person):
                key = (t, int(found.view[d]), found.keypoints[d].tobytes(), found.scores[d].tobytes())
                result[bool(person >= 0)][key] = found.descriptors[d]
        return result

    @pytest.mark.parametrize("key", ["duplicates", "split"])
    def test_duplicates_have_the_same_identity_and_other_noise(self, model, key):
        apart = []
        for frame in self.described(model, boxes={key: 0.3}):
            drawn, found = frame.detections.descriptors, np.column_stack([frame.detections.view, frame.truth.person])
            same = (found[:, None] == found).all(axis=-1) & np.triu(np.ones((len(found),) * 2, bool), 1)
            apart += np.linalg.norm(drawn[:, None] - drawn, axis=-1)[same].tolist()
        assert len(apart) > 50
        assert min(apart) > 0.2
        assert np.mean(apart) < 1.0

    def test_a_figure_in_the_room_has_one_identity_in_all_views(self, model):
        def apart(views):
            """Distances of phantoms in two views, in moments in which no view has more than one."""
            result = []
            for frame in self.described(model, phantoms={"rate": 0.3, "life": 0.4, "views": views}, frames=1000):
                ghost = frame.truth.person < 0
                drawn, view = frame.detections.descriptors[ghost], frame.detections.view[ghost]
                if len(np.unique(view)) == len(view) > 1:
                    result.append(np.linalg.norm(drawn[0] - drawn[-1]))
            assert len(result) > 30
            return np.array(result)

        room, alone = apart(1.0), apart(0.0)
        assert np.median(room) < 0.9  # as of one person seen from one side
        assert np.mean(alone) > 1.2

    def test_two_figures_have_two_identities(self, model):
        drawn = []
        for frame in self.described(model, phantoms={"rate": 2.0, "life": 0.4, "views": 1.0}):
            last = (frame.truth.person < 0) & (frame.detections.view == 2)
            drawn.append(frame.detections.descriptors[last])
        apart = [np.linalg.norm(each[0] - each[1]) for each in drawn if len(each) > 1]
        assert len(apart) > 5
        assert np.mean(apart) > 1.2

    def test_phantoms_have_descriptors_without_people(self, model):
        frames = self.described(model, people=0, phantoms={"rate": 1.0})
        assert sum(len(frame.detections.descriptors) for frame in frames) > 50

    def test_some_people_may_look_alike(self, model):
        frames = self.described(model, look_alike=1.0, alike=2)

        def apart(one, other):
            result = []
            for frame in frames:
                first, second = (frame.detections.descriptors[frame.truth.person == person] for person in (one, other))
                result.append(np.linalg.norm(first[:, None] - second, axis=-1).mean())
            return np.mean(result)

        assert apart(0, 1) < apart(2, 3) - 0.1

    def test_without_settings_there_are_no_descriptors_and_nothing_else_changes(self, model):
        where = with_decoys(world(frames=40, people=4))
        sections = {"keypoints": {"scatter": 0.3}, "phantoms": {"rate": 0.5}}
        plain = detect(where.sequence, where.views, where.rig, DetectorSection.model_validate(sections), seed=3)
        for one, other in zip(plain, self.described(model, **sections), strict=True):
            assert one.detections.descriptors is None
            np.testing.assert_array_equal(one.detections.keypoints, other.detections.keypoints)


def test_a_network_without_measured_distances_is_refused(tmp_path):
    (tmp_path / "other.onnx").write_bytes(b"x")
    with pytest.raises(ValueError, match=r"other\.json: expected a card with the distances of other\.onnx"):
        DescriptorModel.of_network(tmp_path / "other.onnx")


@pytest.mark.parametrize("content", ["[1]", "{}", '{"distances": 3}', "no JSON"])
def test_a_card_without_distances_is_refused(tmp_path, content):
    (tmp_path / "other.json").write_text(content)
    with pytest.raises(ValueError, match=r"other\.json: .*the (distances|card) of other\.onnx"):
        DescriptorModel.of_network(tmp_path / "other.onnx")


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("quantiles", 3), 1.5, "quantiles must increase from 0 to 1"),
        (("look_alike", "0", "same", "all", "quantiles", 0), 3.0, "distances must increase"),
        (("look_alike", "0", "other", "all", "cosine"), -1.2, "cosines must be between"),
    ],
)
def test_distances_that_no_measurement_gives_are_refused(card, keys, value, message):
    distances = json.loads(json.dumps(card))
    inner = distances
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    with pytest.raises(ValueError, match=message):
        DescriptorModel.fitted(distances)


def test_the_card_of_another_network_is_refused(tmp_path):
    shutil.copy(DEFAULT.with_suffix(".json"), tmp_path / "other.json")
    DescriptorModel.of_network(tmp_path / "other.onnx")  # the network file itself is not needed
    (tmp_path / "other.onnx").write_bytes(DEFAULT.read_bytes()[:-1])
    with pytest.raises(ValueError, match="is not the file of"):
        DescriptorModel.of_network(tmp_path / "other.onnx")
