import numpy as np
import pytest
from test_admm import instance

from mvpose.matching import match, objective


def partitions(view):
    """Every grouping of the detections with at most one of a view in a group, as labels."""
    if len(view) == 0:
        yield []
        return
    for rest in partitions(view[:-1]):
        groups = range(max(rest, default=-1) + 1)
        for group in groups:
            if all(view[k] != view[-1] for k in range(len(rest)) if rest[k] == group):
                yield [*rest, group]
        yield [*rest, len(groups)]


def optimum(affinity, view):
    return min(objective(np.array(labels), affinity) for labels in partitions(view))


def test_small_instances_are_solved_nearly_always_exactly():
    exact = {"clustering": 0, "admm": 0}
    for seed in range(60):
        affinity, view, _ = instance(seed, views=3, people=3, noise=0.4)
        best = optimum(affinity, view)
        for method in exact:
            found = match(affinity, view, method=method).objective
            assert found >= best - 1e-9
            exact[method] += found < best + 1e-9
    assert exact["clustering"] >= 57
    assert exact["admm"] >= 48


@pytest.mark.parametrize(("views", "people"), [(5, 4), (10, 6)])
def test_clustering_and_admm_agree_on_hard_instances(views, people):
    """On these both err: each within 15 % of the other's objective, and clustering the better on average."""
    ratios = []
    for seed in range(16):
        affinity, view, _ = instance(seed, views=views, people=people, noise=0.4, miss=0.3)
        ratios.append(
            match(affinity, view, method="clustering").objective / match(affinity, view, method="admm").objective
        )
    assert min(ratios) > 0.85  # objectives are negative: above 1, clustering found more
    assert np.mean(ratios) > 0.99


def test_cycle_consistency_beats_pairs_of_views():
    """Noise that single pairs cannot see through, all views together can."""

    def f1(labels, person, view):
        across = view[:, None] != view
        said = (labels[:, None] == labels) & (labels[:, None] >= 0) & across
        true = (person[:, None] == person) & across
        return 2 * (said & true).sum() / (said.sum() + true.sum())

    scores = {method: [] for method in ("admm", "clustering", "hungarian")}
    for seed in range(6):
        affinity, view, person = instance(seed, views=6, people=5, noise=0.35)
        for method, values in scores.items():
            values.append(f1(match(affinity, view, method=method).labels, person, view))
    assert np.mean(scores["admm"]) > np.mean(scores["hungarian"]) + 0.05
    assert np.mean(scores["clustering"]) > np.mean(scores["hungarian"]) + 0.05
