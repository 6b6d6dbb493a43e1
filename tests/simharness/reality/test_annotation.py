"""Errors of a truth that people made: drawn, and fitted to a recording."""

from dataclasses import replace

import numpy as np
import pytest

from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.viewing_conditions import SIDE, body_axes
from simharness.reality.annotation_errors import AnnotationModel, annotated_joints
from simharness.reality.detector_fit.annotation_fit import annotation_offsets, fit_annotation
from simharness.reality.detector_fit.fit import fit
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.sample import sample_of
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS, track_people
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS
from simharness.scenario.sections.scenario import AnnotationSection

LIMBS = slice(0, 12)  # of SHELF14
STEP = 0.04
SIDE_14 = np.empty(12)
SIDE_14[SHELF14_OF_LIMBS] = SIDE[LIMB_JOINTS]
NOISY = {
    "keypoints": {"scatter": 0.3, "jitter": 0.03, "miss": 0.02, "drop": {"self_occluded": 0.1, "occluded": 0.3}},
    "bias": {"hips": [0.0, 0.01, 0.04], "wrists": [0.01, 0.0, -0.01]},
    "boxes": {"missed": 0.05},
}


def model(actors=3, *, shift=0.03, deviation=0.02, life=0.1, noise=0.2, seed=0):
    """Return an annotation whose shifts are drawn."""
    drawn = shift * np.random.default_rng(seed).standard_normal((actors, 14, 3))
    return AnnotationModel(drawn, np.full((actors, 14), deviation), life, noise)


def errors(annotation, joints, time, *, seed=0):
    """Return the errors of an annotation of ``joints`` in the body's frame, (F, A, 14, 3)."""
    away = annotation.annotate(joints, time, seed=seed) - annotated_joints(joints)
    return np.einsum("fajc,fakc->fajk", away, body_axes(joints))


@pytest.fixture(scope="module")
def still(filmed):
    """Poses of one frame, held for 4000 frames."""
    return np.broadcast_to(filmed.sequence.joints[0], (4000, 3, 17, 3)), STEP * np.arange(4000)


@pytest.fixture(scope="module")
def known(filmed):
    """Recording whose detector and annotation both err in known ways, and the annotation."""
    annotation = model(deviation=0.02, life=0.2, noise=0.2)
    truth = annotation.annotate(filmed.sequence.joints, filmed.sequence.time, seed=0)
    return replace(filmed.recording(**NOISY), truth=truth), annotation


@pytest.fixture(scope="module")
def exact(filmed):
    """The same detector with other draws, and an exact truth."""
    return [filmed.recording(seed=2, **NOISY)]


@pytest.fixture(scope="module")
def fitted(known, exact):
    return fitted_annotation(known[0], exact)


BIAS = np.zeros((9, 3))
for _kind, _offset in NOISY["bias"].items():
    BIAS[KINDS.index(_kind)] = _offset


class TestDrawn:
    def test_without_errors_it_is_the_truth(self, filmed):
        joints, time = filmed.sequence.joints, filmed.sequence.time
        exact = model(shift=0.0, deviation=0.0).annotate(joints, time, seed=0)
        np.testing.assert_array_equal(exact, annotated_joints(joints))

    def test_annotated_heads_are_rigid(self, filmed):
        """Limbs, middles and directions of heads are those of the rule; the length of each actor is one, the usual."""
        joints = filmed.sequence.joints
        rule, marked = coco17_to_shelf14(joints), annotated_joints(joints)
        np.testing.assert_array_equal(marked[..., LIMBS, :], rule[..., LIMBS, :])
        np.testing.assert_allclose(marked[..., 12:, :].mean(axis=-2), rule[..., 12:, :].mean(axis=-2), atol=1e-12)
        before, after = (each[..., 13, :] - each[..., 12, :] for each in (rule, marked))
        np.testing.assert_allclose(np.cross(before, after), 0.0, atol=1e-12)
        lengths = [np.linalg.norm(each, axis=-1) for each in (before, after)]
        np.testing.assert_allclose(lengths[1], np.median(lengths[0], axis=0, keepdims=True) + 0 * lengths[0])
        assert lengths[0].std(axis=0).max() > 0.04

    def test_shifts_turn_with_the_body(self, filmed):
        annotation = model(deviation=0.0)
        away = errors(annotation, filmed.sequence.joints, filmed.sequence.time)
        np.testing.assert_allclose(away, np.broadcast_to(annotation.shift, away.shape), atol=1e-9)

    def test_mean_and_deviation(self, still):
        annotation = model(life=0.1)
        away = errors(annotation, *still)
        # 4000 frames with a memory of 0.1 s are about 800 independent ones: the mean is known to 0.7 mm.
        np.testing.assert_allclose(away.mean(axis=0), annotation.shift, atol=0.004)
        np.testing.assert_allclose(away.std(axis=0), 0.02, rtol=0.15)
        assert away.std(axis=0).mean() == pytest.approx(0.02, rel=0.02)
        rms = np.sqrt((annotation.shift**2).sum(axis=-1) + 3 * annotation.deviation**2)
        np.testing.assert_allclose(rms[0], np.sqrt((away[:, 0] ** 2).sum(axis=-1).mean(axis=0)), rtol=0.1)

    def test_memory(self, still):
        """The autocorrelation is (1 - noise) exp(-lag / life)."""
        rest = errors(model(shift=0.0, life=0.4, noise=0.3), *still) / 0.02
        for lag in (1, 5, 10, 25):
            correlation = (rest[:-lag] * rest[lag:]).mean()
            assert correlation == pytest.approx(0.7 * np.exp(-lag * STEP / 0.4), abs=0.02)

    @pytest.mark.slow
    def test_gaps_between_frames_count_as_they_last(self, still):
        joints = still[0][:1000]
        time = STEP * (np.arange(1000) + 100 * (np.arange(1000) // 2))  # pairs of frames, 4 s apart
        rest = errors(model(shift=0.0, life=0.4, noise=0.0), joints, time) / 0.02
        assert (rest[0::2] * rest[1::2]).mean() == pytest.approx(np.exp(-STEP / 0.4), abs=0.03)
        assert (rest[1:-1:2] * rest[2::2]).mean() == pytest.approx(0.0, abs=0.03)

    def test_errors_of_joints_that_a_bone_joins_are_correlated(self, still):
        """Of joints n bones apart the correlation is the n-th power; head and limbs are independent."""
        annotation = replace(model(shift=0.0, life=0.1), near=0.5, head=0.7)
        rest = errors(annotation, *still)
        np.testing.assert_allclose(rest.std(axis=(0, 1, 3)), 0.02, rtol=0.05)
        found = np.corrcoef(np.moveaxis(rest, 2, 0).reshape(14, -1))
        pairs = {(0, 1): 0.5, (7, 8): 0.5, (0, 2): 0.25, (2, 8): 0.5, (12, 13): 0.7, (8, 12): 0.0, (6, 11): 0.5**6}
        for pair, expected in pairs.items():
            assert found[pair] == pytest.approx(expected, abs=0.05), pair

    def test_seeds_and_missing_people(self, filmed):
        joints, time = filmed.sequence.joints.copy(), filmed.sequence.time
        whole = model().annotate(joints, time, seed=3)
        np.testing.assert_array_equal(model().annotate(joints, time, seed=3), whole)
        assert np.abs(model().annotate(joints, time, seed=4) - whole).mean() > 0.005
        joints[:50, 1] = np.nan
        partly = model().annotate(joints, time, seed=3)
        assert np.isnan(partly[:50, 1]).all()
        np.testing.assert_array_equal(np.delete(partly, 1, axis=1), np.delete(whole, 1, axis=1))
        np.testing.assert_array_equal(partly[50:, :, LIMBS], whole[50:, :, LIMBS])
        np.testing.assert_allclose(partly[50:], whole[50:], atol=0.001)  # the usual length of the head

    def test_the_section_of_a_scenario_has_drawn_shifts(self):
        config = AnnotationSection(shift=0.03, random=0.01, life=0.5, noise=0.1)
        drawn = AnnotationModel.drawn(config, 200, seed=1)
        assert drawn.shift.std() == pytest.approx(0.03, rel=0.05)
        assert (drawn.deviation == 0.01).all()
        assert (drawn.life, drawn.noise) == (0.5, 0.1)
        np.testing.assert_array_equal(AnnotationModel.drawn(config, 200, seed=1).shift, drawn.shift)
        assert (AnnotationModel.drawn(config, 200, seed=2).shift != drawn.shift).all()


def offsets(recording):
    """Return the offsets of the truth of a recording from its tracks."""
    people = track_people(recording)
    return annotation_offsets(recording.truth, people, label_joints(sample_of(recording, people)).consensus)


def fitted_annotation(recording, exact):
    """Return the annotation fitted to a recording, given recordings of the same detector with an exact truth."""
    return fit_annotation(offsets(recording), [offsets(each) for each in exact], recording.time)


def offset_in_body(annotation, bias):
    """Return the offset of the annotation from the detector's joints, (A, 12, 3): forward, left and up."""
    per_joint = bias[np.array(KIND_OF_JOINT)] * np.stack([np.ones(17), SIDE, np.ones(17)], axis=1)
    result = annotation.shift[:, LIMBS].copy()
    result[:, SHELF14_OF_LIMBS] -= per_joint[LIMB_JOINTS]
    return result


class TestFitted:
    def test_annotation_and_bias_together_are_recovered(self, known, fitted):
        """What annotators and detector share cannot be split: their difference is known."""
        _, annotation = known
        found = offset_in_body(fitted.annotation, fitted.bias)
        away = found - offset_in_body(annotation, BIAS)
        # The random part, of 20 mm and 0.2 s, averages to 4.5 mm over 8 s.
        assert np.sqrt((away**2).mean()) < 0.008
        assert np.abs(away).max() < 0.025

    def test_errors_relative_to_detected_joints_have_the_bias(self, fitted):
        expected = offset_in_body(fitted.annotation, fitted.bias)
        assert np.abs(expected - fitted.annotation.shift[:, LIMBS]).max() > 0.02
        np.testing.assert_allclose(fitted.of_detected.shift[:, LIMBS], expected, atol=1e-12)
        np.testing.assert_array_equal(fitted.of_detected.shift[:, 12:], fitted.annotation.shift[:, 12:])

    def test_shifts_of_actors_are_recovered_up_to_what_they_share(self, known, fitted):
        _, annotation = known
        found, true = (each.shift[:, LIMBS] for each in (fitted.annotation, annotation))
        apart, expected = (each[0] - each[1] for each in (found, true))
        assert np.sqrt(((apart - expected) ** 2).mean()) < 0.011
        # By definition nothing is left of a kind of joint in the mean over actors and sides.
        outward = found * np.stack([np.ones(12), SIDE_14, np.ones(12)], axis=-1)
        for kind in range(3, 9):
            of_kind = SHELF14_OF_LIMBS[np.array(KIND_OF_JOINT)[LIMB_JOINTS] == kind]
            np.testing.assert_allclose(outward[:, of_kind].mean(axis=(0, 1)), 0.0, atol=1e-9)

    def test_the_random_part_is_recovered(self, fitted):
        annotation = fitted.annotation
        assert annotation.deviation[:, LIMBS].mean() == pytest.approx(0.02, rel=0.12)
        np.testing.assert_allclose(annotation.deviation[:, LIMBS], 0.02, rtol=0.6)
        assert annotation.life == pytest.approx(0.2, abs=0.08)
        assert annotation.noise == pytest.approx(0.2, abs=0.15)

    @pytest.mark.slow
    def test_an_exact_truth_has_small_errors(self, filmed):
        recordings = [filmed.recording(seed=seed, keypoints={"scatter": 0.3}) for seed in (1, 2)]
        fitted = fitted_annotation(recordings[0], recordings[1:])
        assert np.abs(fitted.annotation.shift[:, LIMBS]).max() < 0.01
        assert fitted.annotation.deviation[:, LIMBS].mean() < 0.008

    @pytest.mark.slow
    def test_actors_who_are_never_annotated_have_the_usual_errors(self, known, exact):
        def with_another(recording):
            recording = recording.during(np.arange(80))
            truth = np.concatenate([recording.truth, np.full((80, 1, 14, 3), np.nan)], axis=1)
            return replace(recording, truth=truth)

        fitted = fitted_annotation(with_another(known[0]), [with_another(each) for each in exact])
        assert fitted.compared.shape == (4, 14)
        assert (fitted.compared[3] == 0).all()
        np.testing.assert_allclose(fitted.annotation.shift[3, 12:], 0.0)
        assert np.isfinite(fitted.annotation.shift).all()
        assert 0.01 < fitted.annotation.deviation[3].mean() < 0.03

    @pytest.mark.slow
    def test_an_unannotated_recording_has_an_exact_annotation(self, filmed):
        recording = filmed.recording().during(np.arange(60))
        recording = replace(recording, truth=np.full(recording.truth.shape, np.nan))
        fitted = fitted_annotation(recording, [recording])
        assert (fitted.annotation.shift == 0).all()
        assert (fitted.annotation.deviation == 0).all()
        assert (fitted.bias == 0).all()


@pytest.mark.slow
def test_the_detector_is_not_blamed_for_the_annotation(known):
    """A whole fit: scatter is that of the detector, although the truth is off by several centimetres."""
    recording, annotation = known
    fitted = fit(recording, name="fitted", resamples=20)
    scatter = np.mean([fitted.real[f"keypoints.scatter.{kind}"].value for kind in KINDS[3:]])
    assert scatter == pytest.approx(0.3, abs=0.03)
    miss = np.mean([fitted.real[f"keypoints.miss.{kind}"].value for kind in KINDS[3:]])
    assert miss == pytest.approx(0.02, abs=0.01)
    assert (fitted.profile.name, fitted.profile.kind) == ("fitted", recording.kind)
    away = offset_in_body(fitted.annotation.annotation, fitted.annotation.bias) - offset_in_body(annotation, BIAS)
    assert np.sqrt((away**2).mean()) < 0.008
    hips = fitted.annotation.bias[KINDS.index("hips")]
    assert fitted.profile.bias.hips == pytest.approx(hips, abs=1e-4)


class TestRandomPart:
    """Offsets whose variance is known: of the annotation, and of the tracks that it is compared with."""

    ACTORS, FRAMES = 3, 600

    def offsets(self, deviation, tracks, *, seed):
        """Draw offsets (F, A, 14, 3) of an annotation and of tracks, both independent in all frames."""
        rng = np.random.default_rng(seed)
        shape = (self.FRAMES, self.ACTORS, 14, 3)
        return deviation * rng.standard_normal(shape) + tracks * rng.standard_normal(shape)

    def fitted(self, deviation, tracks):
        exact = [self.offsets(0.0, tracks, seed=seed) for seed in (1, 2)]
        return fit_annotation(self.offsets(deviation, tracks, seed=0), exact, STEP * np.arange(self.FRAMES)).annotation

    @pytest.mark.parametrize("tracks", [0.005, 0.02])
    def test_the_variance_of_the_tracks_is_taken_away(self, tracks):
        deviation = np.array(self.fitted(0.02, tracks).deviation)
        np.testing.assert_allclose(deviation, 0.02, rtol=0.15)

    def test_no_joint_is_exact_by_chance(self):
        """Behind tracks that are three times as far off, a third of the joints have less variance than their tracks."""
        away, exact = (self.offsets(each, 0.03, seed=seed) for each, seed in ((0.005, 3), (0.0, 4)))
        less = (away**2).sum(axis=(0, 3)) < (exact**2).sum(axis=(0, 3))
        assert 0.1 < less.mean() < 0.5
        found = fit_annotation(away, [exact], STEP * np.arange(self.FRAMES)).annotation.deviation
        assert found.min() > 0.002
        assert np.median(found) == pytest.approx(0.005, rel=0.6)

    def test_joints_that_are_annotated_worse_stay_worse(self):
        deviation = np.full((14, 1), 0.01)
        deviation[5] = 0.04
        found = self.fitted(deviation, 0.005).deviation
        np.testing.assert_allclose(found[:, 5], 0.04, rtol=0.15)
        np.testing.assert_allclose(np.delete(found, 5, axis=1), 0.01, rtol=0.25)

    def test_an_error_that_lasts_is_gross_also_in_few_frames(self):
        """An actor in 40 frames, in 16 of which two joints are 15 cm off."""
        rng = np.random.default_rng(0)
        away, exact = (deviation * rng.standard_normal((self.FRAMES, self.ACTORS, 14, 3)) for deviation in (0.02, 0.01))
        away[40:, 0] = exact[40:, 0] = np.nan
        away[20:36, 0, 6:8] += [0.1, -0.1, 0.05]
        found = fit_annotation(away, [exact], STEP * np.arange(self.FRAMES)).annotation
        np.testing.assert_allclose(found.gross[0, 6:8], 16 / 40, atol=0.12)
        np.testing.assert_allclose(found.deviation[0, 6:8], 0.02, rtol=0.25)
        assert np.abs(found.shift[0, 6:8]).max() < 0.02
        assert found.gross[1:].max() < 0.01

    def test_errors_of_joints_together_are_told_from_those_of_tracks(self, filmed):
        """The joints of a track err together, too: 20 mm, all limbs alike."""
        known = replace(model(shift=0.0, deviation=0.02, life=0.05), near=0.3, head=0.7)
        still = np.broadcast_to(filmed.sequence.joints[0], (self.FRAMES, 3, 17, 3))
        tracks = [
            0.02 * np.random.default_rng(seed).standard_normal((self.FRAMES, self.ACTORS, 1, 3)) for seed in (1, 2, 3)
        ]
        away = errors(known, still, STEP * np.arange(self.FRAMES)) + tracks[0]
        exact = [np.broadcast_to(each, away.shape) for each in tracks[1:]]
        found = fit_annotation(away, exact, STEP * np.arange(self.FRAMES)).annotation
        assert found.near == pytest.approx(0.3, abs=0.06)
        assert found.head == pytest.approx(0.7, abs=0.1)

    def test_gross_errors_are_told_from_the_random_part(self, filmed):
        """One joint is off by 10 cm along each axis in a tenth of the frames."""
        gross, still = np.zeros((self.ACTORS, 14)), np.broadcast_to(filmed.sequence.joints[0], (self.FRAMES, 3, 17, 3))
        gross[:, 3] = 0.1
        known = replace(model(shift=0.0, deviation=0.01, life=0.05), gross=gross, gross_deviation=0.1)
        away = errors(known, still, STEP * np.arange(self.FRAMES))
        exact = self.offsets(0.0, 0.002, seed=5)
        found = fit_annotation(away, [exact], STEP * np.arange(self.FRAMES)).annotation
        np.testing.assert_allclose(found.deviation, 0.01, rtol=0.3)
        assert found.gross[:, 3].mean() == pytest.approx(0.1, abs=0.04)
        assert np.delete(found.gross, 3, axis=1).max() < 0.02
        assert found.gross_deviation[:, 3].mean() == pytest.approx(0.1, rel=0.35)
