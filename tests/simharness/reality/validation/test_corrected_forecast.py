"""Corrected forecasts of scores with a known relation to the simulated ones."""

import numpy as np
import pytest

from simharness.reality.validation.corrected_forecast import LABELLED, best_weight, correct_forecast, study_corrections
from simharness.reality.validation.passes import CameraSubset, ScoreSums


def scores(rng, *, share, conditions=30, frames=100, bias=0.0):
    """Real and simulated scores (C, N) whose correlation over frames is the root of ``share``."""
    common = rng.normal(size=(conditions, frames))
    real = 80 + 10 * (np.sqrt(share) * common + np.sqrt(1 - share) * rng.normal(size=common.shape))
    return real, 80 + bias + 10 * common


@pytest.mark.parametrize("bias", [0.0, 15.0])
def test_wrong_twins_do_not_bias_the_corrected_forecast(bias):
    rng, away = np.random.default_rng(0), []
    for _ in range(200):
        real, simulated = scores(rng, share=0.5, bias=bias)
        labelled = rng.choice(100, 20, replace=False)
        away.append((correct_forecast(simulated, real[:, labelled], labelled).value - real.mean(axis=1)).mean())
    assert np.mean(away) == pytest.approx(0.0, abs=4 * np.std(away) / np.sqrt(len(away)))


@pytest.mark.parametrize("share", [0.0, 0.6, 0.95])
def test_intervals_cover_and_are_narrower_by_what_is_shared(share):
    """The variance of the labelled frames falls to 1 minus the squared correlation."""
    rng, inside, widths = np.random.default_rng(1), [], []
    for _ in range(60):
        real, simulated = scores(rng, share=share)
        labelled = rng.choice(100, 20, replace=False)
        both, alone = (
            correct_forecast(simulated, real[:, labelled], labelled, weight=weight) for weight in (None, 0.0)
        )
        inside.append(np.abs(both.value - real.mean(axis=1)) <= both.half)
        widths.append(both.half.sum() / alone.half.sum())
    assert np.mean(inside) == pytest.approx(0.9, abs=0.02)
    assert np.mean(widths) == pytest.approx(np.sqrt(1 - share), abs=0.03)


def test_twins_that_go_the_other_way_have_no_weight():
    real, simulated = scores(np.random.default_rng(0), share=0.9)
    assert best_weight(-simulated, real) == 0.0
    assert best_weight(np.ones((3, 5)), real[:3, :5]) == 0.0


def test_a_study_hides_frames_and_reports_the_error_of_each_estimate():
    rng = np.random.default_rng(2)

    def tallies(shares):
        zero = np.zeros(shares.shape[1])
        made = {}
        for views, of in zip([(0, 1), (0, 2), (1, 2)], shares, strict=True):
            parts = np.repeat(np.round(of)[:, None, None], 4, axis=1)
            made[CameraSubset(views)] = {
                "full": ScoreSums(parts, np.full_like(parts, 100.0), parts[..., 0], parts[..., 0], zero, zero, zero)
            }
        return made

    real, simulated = scores(rng, share=0.9, conditions=3, bias=-8.0)
    found = study_corrections(tallies(real), [tallies(simulated)], range(100))
    assert (found.conditions, found.frames, found.labelled) == (3, 100, LABELLED)
    assert found.errors["simulated"] == pytest.approx(np.abs(simulated.mean(1) - real.mean(1)).mean(), abs=0.2)
    assert found.errors["corrected"] < found.errors["labelled"] < found.errors["simulated"]
    assert 0.2 < found.width < 0.5
    assert study_corrections(tallies(real[:, :30]), [tallies(simulated[:, :30])], range(30)) is None
