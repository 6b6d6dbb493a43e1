"""Whole detector: all steps together, frame by frame."""

from dataclasses import replace

import numpy as np
import pytest
from worlds import within, world

from mvpose import preset
from simharness.detector.detect import detect
from simharness.detector.viewing_conditions import Conditions
from simharness.scenario.layers import PROFILES
from simharness.scenario.load import load
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import CaptureFrames
from simharness.types.truth import MISS_FROM, KeypointError
from simharness.types.views import Visibility
from simharness.world.scene.playback import simulate


def run(where, *, seed=3, **sections):
    return detect(where.sequence, where.views, where.rig, DetectorSection.model_validate(sections), seed=seed)


def by_person(frames, views, people):
    """Return the keypoints of everyone's first detection, (T, V, P, 17, 2); NaN where absent."""
    result = np.full((len(frames), views, people, 17, 2), np.nan)
    for t, frame in enumerate(frames):
        for view, person, keypoints in zip(
            frame.detections.view, frame.truth.person, frame.detections.keypoints, strict=True
        ):
            if person >= 0 and np.isnan(result[t, view, person]).all():
                result[t, view, person] = keypoints
    return result


def test_a_perfect_detector_sees_the_exact_projections():
    where = world()
    frames = run(where)
    np.testing.assert_array_equal(by_person(frames, 3, 2), where.views.pixels)
    for frame in frames:
        assert len(frame.detections) == 6
        assert (frame.truth.error == KeypointError.GOOD).all()
        assert (frame.detections.scores == 1).all()
        assert frame.peaks is None
        boxes = frame.truth.boxes[frame.detections.view, frame.truth.person]
        np.testing.assert_allclose(frame.detections.boxes, boxes)


def test_perfect_detections_are_reconstructed_to_under_a_millimetre():
    scenario = load(
        "scenarios/quickstart.toml", overrides=["detector.profile=perfect", "duration=1.0", "rendering.renderer=rays"]
    )
    trial = build_trial(scenario)
    sequence = simulate(trial.scene)
    views = CaptureFrames(scenario, trial.scene, trial.exposures, frozenset())(range(scenario.frames))
    frames = detect(sequence, views, trial.exposures.believed_rig, scenario.detector, seed=scenario.seed)
    # The prior of 3DPS on bone lengths moves joints even with perfect detections.
    for variant, worst, usual in (("fast", 1e-3, 1e-3), ("no-3dps", 1e-3, 1e-3), ("full", 3e-3, 1e-3)):
        errors = []
        for t, frame in enumerate(frames):
            estimate = preset(variant).estimate(trial.exposures.believed_rig, frame.detections)
            away = np.linalg.norm(estimate.joints[:, None] - sequence.joints[t], axis=-1)
            nearest = np.nanmean(away, axis=-1).argmin(axis=1)
            assert sorted(nearest) == [0, 1, 2, 3]
            errors.append(away[np.arange(4), nearest])
            # Joints that at most one camera has in its picture cannot be placed.
            twice = (views.visibility[t] != Visibility.OUTSIDE).sum(axis=0) >= 2
            assert np.isfinite(errors[-1][twice[nearest]]).all()
        assert np.nanmax(errors) < worst
        assert np.nanmean(errors) < usual


@pytest.mark.parametrize("name", sorted(file.stem for file in PROFILES.shipped.glob("*.toml")))
def test_every_profile_gives_valid_detections(name):
    profile = read_profile(name)
    assert profile.name == name
    seen = np.random.default_rng(1).choice([0, 0, 0, 0, 1, 2, 3, 4], size=(40, 3, 4, 17))
    where = world(frames=40, people=4, visibility=seen, together=True)
    frames = detect(where.sequence, where.views, where.rig, profile, seed=0)
    people = np.concatenate([frame.truth.person for frame in frames])
    assert np.isin(np.arange(4), people).all()
    for frame in frames:
        view = frame.detections.view
        assert (np.diff(view) >= 0).all()
        for v in range(3):
            assert (np.diff(frame.detections.box_scores[view == v]) <= 0).all()
        absent = frame.detections.scores == 0
        np.testing.assert_array_equal(absent[frame.truth.person >= 0], (frame.truth.error == KeypointError.ABSENT)[
            frame.truth.person >= 0])  # fmt: skip


def test_better_profiles_err_less():
    where = world(frames=300, people=3)
    share = {}
    for name in ("perfect", "excellent", "typical", "posefix", "poor"):
        frames = detect(where.sequence, where.views, where.rig, read_profile(name), seed=0)
        error = np.concatenate([frame.truth.error[frame.truth.person >= 0] for frame in frames])
        share[name] = (error != KeypointError.GOOD).mean()
    assert list(share) == sorted(share, key=share.__getitem__)


PUBLISHED = {  # shares of all joints published by the authors of PoseFix, for people with more than 10 joints
    KeypointError.JITTER: {"nose": 0.10, "elbow": 0.15, "hip": 0.20, "ankle": 0.10},
    KeypointError.MISS: {"nose": 0.02, "elbow": 0.10, "hip": 0.10, "ankle": 0.05},
    KeypointError.INVERSION: {"elbow": 0.03, "hip": 0.06, "ankle": 0.06},
    KeypointError.SWAP: {"nose": 0.01, "elbow": 0.06, "hip": 0.03, "ankle": 0.03},
}
JOINTS = {"nose": [0], "elbow": [7, 8], "hip": [11, 12], "ankle": [15, 16]}


def test_the_posefix_profile_has_the_published_rates():
    where = world(frames=4000, views=2, people=2, together=True)
    frames = detect(where.sequence, where.views, where.rig, read_profile("posefix"), seed=0)
    error = np.stack([frame.truth.error[np.lexsort((frame.truth.person, frame.detections.view))] for frame in frames])
    error = error.reshape(4000, 2, 2, 17)
    true, conditions = where.views.pixels, Conditions.of_views(where.views)
    reach = MISS_FROM * conditions.unit
    mirror = np.array([0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15])
    for name, joints in JOINTS.items():
        apart = np.linalg.norm(true - true[:, :, ::-1], axis=-1) >= reach
        apart &= (conditions.neighbour >= 0)[..., None]
        if name != "nose":
            apart &= np.linalg.norm(true - true[..., mirror, :], axis=-1) >= reach
        errors = error[..., joints][apart[..., joints]]
        assert len(errors) > 5000
        for kind, rates in PUBLISHED.items():
            assert within((errors == kind).sum(), len(errors), rates.get(name, 0.0))


SECTIONS = {
    "keypoints": {"scatter": 0.4, "miss": 0.05},
    "boxes": {"missed": 0.1, "jitter": 0.05},
    "phantoms": {"rate": 0.3},
}


@pytest.mark.parametrize(
    ("section", "parameter", "value"),
    [
        ("phantoms", "rate", 1.0),
        ("phantoms", "life", 1.0),
        ("boxes", "missed", 0.4),
        ("boxes", "jitter", 0.2),
        ("boxes", "duplicates", 0.3),
        ("boxes", "split", 0.2),
        ("scores", "deviation", 0.5),
        ("heatmaps", "size", "64x48"),
    ],
)
def test_a_parameter_changes_no_other_draw(section, parameter, value):
    where = world(frames=30)
    before = by_person(run(where, **SECTIONS), 3, 2)
    after = run(where, **{**SECTIONS, section: {**SECTIONS.get(section, {}), parameter: value}})
    after = by_person(after, 3, 2)
    both = np.isfinite(after) & np.isfinite(before)
    assert both.mean() > 0.4
    np.testing.assert_array_equal(after[both], before[both])


NOTHING = [
    {"kind": "bottom-up"},
    {"keypoints": {"face": {"nose": [0.0] * 12, "eyes": [0.0] * 12, "ears": [0.0] * 12}}},
    {"keypoints": {"guess": {"scatter": 2.0}}},
    {"keypoints": {"guess": {"outside": 1.0}}},
    {"keypoints": {"scatter_hidden": 3.0}},
    {"correlation": {"gross_views": 1.0, "scatter_near": 0.5, "scatter_noise": 0.5, "scatter_life": 1.0}},
    {"scores": {"hidden": 0.1, "guess": 0.1, "outside": 0.1}},
]


@pytest.mark.parametrize("settings", NOTHING, ids=str)
def test_settings_of_errors_that_do_not_occur_leave_the_detector_perfect(settings):
    where = world()
    for got, expected in zip(run(where, **settings), run(where), strict=True):
        for key in ("keypoints", "scores", "boxes", "box_scores", "view"):
            assert getattr(got.detections, key).tobytes() == getattr(expected.detections, key).tobytes()
        np.testing.assert_array_equal(got.truth.error, expected.truth.error)


@pytest.mark.parametrize(
    ("dial", "kinds"),
    [
        ({"correlation": {"gross_views": 0.7}}, {KeypointError.MISS}),
        ({"keypoints": {"guess": {"visible": 0.2}}}, set(KeypointError)),
        ({"keypoints": {"face": {"ears": [0.5] * 12}}}, {KeypointError.ABSENT}),
    ],
    ids=["gross_views", "guess", "face"],
)
def test_a_new_error_takes_joints_and_leaves_all_others_to_the_bit(dial, kinds):
    where = world(frames=40)
    errors = {"keypoints": {"scatter": 0.4, "jitter": 0.2, "miss": 0.2, "drop": {"visible": 0.1}}}
    changed = {**errors, **{section: {**errors.get(section, {}), **keys} for section, keys in dial.items()}}
    before, after = run(where, **errors), run(where, **changed)
    untouched = 0
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one.truth.person, other.truth.person)
        same = one.truth.error == other.truth.error
        same &= np.isclose(one.detections.keypoints, other.detections.keypoints, equal_nan=True).all(axis=-1)
        classes = zip(one.truth.error[~same].tolist(), other.truth.error[~same].tolist(), strict=True)
        assert all(a in kinds or b in kinds for a, b in classes)
        untouched += same.sum()
        np.testing.assert_array_equal(one.detections.keypoints[same], other.detections.keypoints[same])
    assert 0.5 < untouched / (40 * 6 * 17) < 0.99


def test_equal_seeds_give_equal_results():
    where = world(frames=5)
    first, again, other = (run(where, seed=seed, **SECTIONS) for seed in (0, 0, 1))
    for a, b in zip(first, again, strict=True):
        assert a.detections.keypoints.tobytes() == b.detections.keypoints.tobytes()
        assert a.detections.boxes.tobytes() == b.detections.boxes.tobytes()
    assert any(
        a.detections.keypoints.tobytes() != c.detections.keypoints.tobytes() for a, c in zip(first, other, strict=True)
    )


def test_the_order_of_detections_does_not_reveal_the_people():
    orders = {
        tuple(frame.truth.person[frame.detections.view == 0].tolist())
        for frame in run(world(), boxes={"deviation": 0.5, "score": 0.9})
    }
    assert orders == {(0, 1), (1, 0)}


def test_heat_maps_give_the_keypoints_of_the_detections():
    # A head does not see misses far outside its crop.
    far = {"scatter": 0.4, "miss": 0.3, "reach": 20.0}
    frames = run(world(frames=3), **{**SECTIONS, "keypoints": far}, heatmaps={"size": "64x48"})
    for frame in frames:
        maps = frame.peaks.heatmaps()
        assert maps.values.shape == (len(frame.detections), 17, 64, 48)
        pixels, _ = maps.modes(1)
        found = np.isfinite(frame.detections.keypoints[..., 0])
        assert found.any()
        np.testing.assert_array_equal(np.isfinite(pixels[:, :, 0, 0]), found)
        away = (np.abs(pixels[:, :, 0] - frame.detections.keypoints) / maps.stride[:, None])[found]
        assert away.max() < 0.51  # at the border of a map there is no interpolation between cells
        assert np.median(away) < 1e-3


def test_phantoms_without_people():
    frames = run(world(people=0), phantoms={"rate": 2.0})
    assert all((frame.truth.person == -1).all() and frame.truth.joints.shape == (0, 17, 3) for frame in frames)
    assert sum(len(frame.detections) for frame in frames) > 100


LOSSY = {
    "keypoints": {"scatter": 0.5, "drop": {"visible": 0.2}},
    "boxes": {"missed": 0.3, "jitter": 0.1},
    "phantoms": {"rate": 1.5},
}


class TestDelivery:
    """Detections by the pictures that arrive."""

    @staticmethod
    def late(source):
        where = world(frames=6, views=2)
        return replace(where, views=replace(where.views, source=np.array(source)))

    def test_a_repeated_picture_gives_the_same_detections(self):
        source = [[0, 0], [0, 1], [2, 2], [2, 3], [2, 4], [5, 5]]
        frozen, live = run(self.late(source), **LOSSY), run(world(frames=6, views=2), **LOSSY)
        for t, row in enumerate(source):
            for v, frame in enumerate(row):
                got, expected = frozen[t], live[frame]
                rows, old = got.detections.view == v, expected.detections.view == v
                np.testing.assert_array_equal(got.detections.keypoints[rows], expected.detections.keypoints[old])
                np.testing.assert_array_equal(got.detections.boxes[rows], expected.detections.boxes[old])
                np.testing.assert_array_equal(got.truth.person[rows], expected.truth.person[old])
                np.testing.assert_array_equal(got.truth.error[rows], expected.truth.error[old])
        assert any((got.detections.view == 0).any() for got in frozen)

    def test_a_picture_that_never_arrives_gives_no_detections(self):
        source = [[0, -1], [-1, 1], [-1, -1], [3, 3], [4, -1], [5, -1]]
        found = run(self.late(source), phantoms={"rate": 3.0})
        for frame, row in zip(found, source, strict=True):
            assert set(frame.detections.view.tolist()) == {v for v, picture in enumerate(row) if picture >= 0}
