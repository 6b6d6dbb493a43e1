import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from instances import filmed, instance, sort_by_view
from scipy.optimize import linear_sum_assignment
from test_projection import in_c

from mvpose.matching import admm, objective
from mvpose.matching.clustering import cluster
from mvpose.matching.projection import project


def reference(affinity, view, *, alpha, weight, rho=1.0, iterations=20_000):
    """Objective after a long run of Algorithm 1 as the paper prints it: random start, Y = 0, a fixed step."""
    gain = np.where(view[:, None] == view, 0.0, affinity - alpha)
    P, Y = np.random.default_rng(0).random(gain.shape), np.zeros(gain.shape)
    P = 0.5 * (P + P.T)
    for _ in range(iterations):
        u, s, vt = np.linalg.svd(P + Y / rho)
        Q = (u * np.maximum(s - weight / rho, 0)) @ vt
        step = Q - (Y - gain) / rho
        P = project(0.5 * (step + step.T), view)
        Y = Y + rho * (P - Q)
    assert np.abs(P - Q).max() < 1e-5  # the reference itself has converged
    return -(gain * P).sum() + weight * np.linalg.svd(P, compute_uv=False).sum()


def lower_bound(result, view):
    """Lagrange dual at Y, a lower bound for all P of C; minimised over C block by block, by assignment."""
    Y = result.Y * min(1.0, result.weight / np.linalg.norm(result.Y, 2))
    saved = np.where(view[:, None] == view, 0.0, np.maximum(result.gain - Y, 0.0))
    total = np.trace(Y)
    for one in np.unique(view):
        for other in np.unique(view[view > one]):
            block = saved[np.ix_(view == one, view == other)]
            total -= 2 * block[linear_sum_assignment(block, maximize=True)].sum()
    return total


@pytest.mark.parametrize("seed", range(6))
def test_the_solution_is_feasible_and_converged(seed):
    affinity, view, _ = instance(seed)
    result = admm.solve(affinity, view)
    assert in_c(result.P, view)
    assert result.converged
    assert max(result.residuals) < 5e-4
    cut = admm.solve(affinity, view, most_iterations=3)
    assert cut.iterations == 3
    assert not cut.converged


@pytest.mark.parametrize("iterations", [1, 2, 5, 11, 40])
@pytest.mark.parametrize("start", ["cold", "warm"])
def test_residuals_bound_the_errors_after_any_number_of_iterations(iterations, start):
    """Bounds on the distances from the nearest matrices that meet the constraints exactly.

    The primal residual bounds the distance of P from the nearest positive semidefinite matrix, the dual residual that
    of Y from the nearest matrix of spectral norm lambda.
    """
    affinity, view = sort_by_view(*filmed(1, views=10, people=6)[:2])
    parts = cluster(affinity, view) if start == "warm" else None
    result = admm.solve(affinity, view, parts=parts, most_iterations=iterations)
    primal, dual = (residual * len(view) for residual in result.residuals)
    negative = np.minimum(np.linalg.eigvalsh(result.P), 0.0)
    beyond = np.maximum(np.abs(np.linalg.eigvalsh(result.Y)) - result.weight, 0.0)
    assert 1e-3 < np.linalg.norm(negative) <= primal + 1e-3  # 1e-3: the spectral step is in single precision
    assert 1e-3 < np.linalg.norm(beyond) <= dual + 1e-3


@given(
    m=st.integers(1, 90), positive=st.floats(0, 1), expected=st.integers(0, 9), single=st.booleans(),
    seed=st.integers(0, 1000),
)  # fmt: skip
def test_the_spectral_step_keeps_all_positive_eigenvalues(m, positive, expected, single, seed):
    """However many were expected; only the upper triangle is read."""
    rng = np.random.default_rng(seed)
    vectors = np.linalg.qr(rng.standard_normal((m, m)))[0]
    values = np.where(np.arange(m) < positive * m, 1.0, -1.0) * rng.uniform(0.1, 10.0, m)
    kept, count = admm._positive_part(np.triu((vectors * values) @ vectors.T), expected, single=single)
    assert count == (values > 0).sum()
    np.testing.assert_allclose(kept, (vectors * np.maximum(values, 0)) @ vectors.T, atol=1e-4 if single else 1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "weight"), [(0, 5.0), (1, 5.0), (2, 5.0), (0, 0.3)])
def test_objective_is_that_of_a_long_fixed_step_run(seed, weight):
    """A weight of 0.3 lets the optimum have negative eigenvalues."""
    affinity, view, _ = instance(seed, views=4, people=3, noise=0.4)
    expected = reference(affinity, view, alpha=0.5, weight=weight)
    result = admm.solve(affinity, view, alpha=0.5, weight=weight, tolerance=1e-7, most_iterations=50_000)
    assert (np.linalg.eigvalsh(result.P)[0] < -0.1) == (weight < 1)
    assert result.converged
    assert result.objective == pytest.approx(expected, abs=5e-4)  # of about 40; Q still differs from P by 1e-5


@pytest.mark.parametrize(("views", "people", "noise"), [(5, 4, 12.0), (10, 10, 4.0), (10, 10, 12.0)])
def test_the_dual_variable_proves_the_optimum(views, people, noise):
    """A missed part of the spectrum, an inexact projection or an early stop would leave a duality gap."""
    affinity, view = sort_by_view(*filmed(0, views=views, people=people, noise=noise)[:2])
    single = 2e-5  # the least tolerance at which the spectrum is computed in single precision
    result = admm.solve(affinity, view, parts=cluster(affinity, view), tolerance=single, most_iterations=5000)
    assert result.converged
    low = lower_bound(result, view)
    worth = result.weight * len(view) - low  # in units of gain: the nuclear norm of every grouping is m
    assert -1e-6 * worth < result.objective - low < 0.005 * worth


@pytest.mark.parametrize("seed", range(3))
def test_the_default_lambda_makes_inconsistency_too_dear(seed):
    """The optimum has no negative eigenvalue, hence is cycle-consistent, although the affinities are not."""
    affinity, view, _ = instance(seed, views=6, people=6, noise=0.6)
    result = admm.solve(affinity, view)
    assert np.linalg.eigvalsh(np.where(view[:, None] == view, np.eye(len(view)), affinity))[0] < -1.0
    assert np.linalg.eigvalsh(result.P)[0] > -0.05


@pytest.mark.parametrize("seed", range(4))
def test_the_optimum_does_not_depend_on_the_start(seed):
    affinity, view = sort_by_view(*filmed(seed, views=5, people=4)[:2])
    wrong = np.concatenate([np.arange(count) for count in np.bincount(view)])  # the k-th of every view are one person
    cold, *warm = (
        admm.solve(affinity, view, parts=parts, tolerance=1e-6, most_iterations=20_000)
        for parts in (None, wrong, cluster(affinity, view))
    )
    assert cold.converged
    for result in warm:
        assert result.converged
        assert result.objective == pytest.approx(cold.objective, abs=2e-3)  # of which about 15 is gain


def test_a_start_at_the_optimum_converges_in_one_iteration():
    """No gain within a person is negative and none between people is positive, so the start is optimal."""
    affinity, view, person = instance(0, noise=0.05)
    result = admm.solve(affinity, view, parts=person)
    assert result.iterations == 1
    assert result.converged
    np.testing.assert_allclose(result.P, person[:, None] == person, atol=1e-6)
    assert result.objective == pytest.approx(2 * objective(person, affinity) + result.weight * len(view))


def test_the_relaxation_bounds_every_grouping_from_below():
    """A consistent P of any grouping lies in C, so its objective cannot be below the optimum."""
    affinity, view, person = instance(3)
    optimum = admm.solve(affinity, view, tolerance=1e-6, most_iterations=20_000).objective
    truth = (person[:, None] == person).astype(float)
    gain = np.where(view[:, None] == view, 0.0, affinity - 0.5)
    assert optimum <= -(gain * truth).sum() + 50 * len(view) + 1e-3


def test_unambiguous_affinities_give_the_true_permutation():
    affinity, view, person = instance(0, noise=0.05)
    np.testing.assert_allclose(admm.solve(affinity, view).P, person[:, None] == person, atol=0.02)


def test_cycle_consistency_overrules_a_pair():
    """Detections 0, 1, 2 in three views: the affinity of 0-2 is low (0.3), but 0-1 and 1-2 support it."""
    affinity = np.array([[0, 0.9, 0.3], [0.9, 0, 0.9], [0.3, 0.9, 0]])
    assert admm.solve(affinity, np.arange(3)).P[0, 2] > 0.9


def test_problems_with_one_detection_or_none():
    assert admm.solve(np.zeros((0, 0)), np.zeros(0, int)).P.shape == (0, 0)
    np.testing.assert_allclose(admm.solve(np.zeros((1, 1)), np.zeros(1, int)).P, 1)
