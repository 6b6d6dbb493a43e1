"""Scheduler of trials: order, retries, dead workers and clusters."""

from dataclasses import replace

import pytest
from fakes import ALWAYS, Fake, called, made_up, study_of, times

from simharness.study import scheduler as scheduling
from simharness.study.scheduler import TrialFailure, TrialSuccess, Unit, run_units
from simharness.study.study_folder import plan


def units_of(folder, seeds):
    return [Unit(each.trial, each.scenario, ("full", "fast")) for each in plan(study_of(folder, seeds=seeds))]


def by_seed(results):
    return {result.unit.scenario.seed: result for result in results}


class TestInProcess:
    def test_results_come_in_order(self, tmp_path):
        units = units_of(tmp_path, 4)
        results = list(run_units(units, Fake(tmp_path / "calls")))
        assert [result.unit for result in results] == units
        for result in results:
            assert isinstance(result, TrialSuccess)
            assert set(result.output.results) == {"full", "fast"}
            assert result.output.results["fast"].scores == made_up(result.unit.scenario, "fast").scores

    @pytest.mark.parametrize(("times_raised", "calls"), [(1, 2), (2, 3)])
    def test_a_trial_that_fails_sometimes_succeeds(self, tmp_path, times_raised, calls):
        fake = Fake(tmp_path / "calls", {1: ("raise", times_raised)})
        assert all(isinstance(result, TrialSuccess) for result in run_units(units_of(tmp_path, 3), fake))
        assert times(fake.calls) == {0: 1, 1: calls, 2: 1}

    def test_a_trial_that_always_fails_is_given_up(self, tmp_path):
        fake = Fake(tmp_path / "calls", {1: ("raise", ALWAYS), 2: ("refuse", ALWAYS)})
        results = by_seed(run_units(units_of(tmp_path, 4), fake))
        assert {seed for seed, result in results.items() if isinstance(result, TrialFailure)} == {1, 2}
        assert results[1].error == "ZeroDivisionError: by zero"
        assert "ZeroDivisionError" in results[1].traceback
        assert results[2].error == "no room"
        assert times(fake.calls) == {0: 1, 1: 3 + 2, 2: 1, 3: 1}  # three times together, then each variant once

    def test_work_begins_with_the_first_iteration(self, tmp_path):
        fake = Fake(tmp_path / "calls")
        results = run_units(units_of(tmp_path, 4), fake)
        assert called(fake.calls) == []
        next(results)
        results.close()
        assert len(called(fake.calls)) == 1

    def test_fewer_than_one_worker_is_refused(self, tmp_path):
        with pytest.raises(ValueError, match="at least 1, got 0"):
            next(run_units([], Fake(tmp_path / "calls"), workers=0))


@pytest.mark.slow
def test_workers_that_die_cost_a_retry(tmp_path):
    harm = {1: ("kill", 1), 3: ("raise", ALWAYS), 4: ("raise", 1), 5: ("refuse", ALWAYS)}
    fake = Fake(tmp_path / "calls", harm, seconds=0.05)
    results = by_seed(run_units(units_of(tmp_path, 10), fake, workers=2))
    assert set(results) == set(range(10))
    failed = {seed: result for seed, result in results.items() if isinstance(result, TrialFailure)}
    assert set(failed) == {3, 5}
    assert failed[3].error == "ZeroDivisionError: by zero"
    assert "fakes.py" in failed[3].traceback
    calls = times(fake.calls)
    for seed, least in {0: 1, 1: 2, 3: 3, 4: 2, 5: 1}.items():
        assert least <= calls[seed] <= least + 3  # a result that was not yet delivered is lost with its worker
    for seed in set(results) - set(failed):
        assert results[seed].output.results["full"].scores == made_up(results[seed].unit.scenario, "full").scores


class TestClusters:
    @pytest.mark.slow
    def test_a_trial_that_is_killed_by_another_is_not_blamed(self, tmp_path):
        import dask
        from distributed import LocalCluster

        # One process of two threads: the trial that kills it takes along what runs beside, once both have begun.
        units = [replace(unit, variants=("full",)) for unit in units_of(tmp_path, 2)]
        fake = Fake(tmp_path / "calls", {0: ("kill", ALWAYS)}, together=2)
        with (
            dask.config.set({"distributed.scheduler.allowed-failures": 0}),
            LocalCluster(n_workers=1, threads_per_worker=2, host="127.0.0.1", dashboard_address=":0") as cluster,
        ):
            results = by_seed(run_units(units, fake, scheduler=cluster.scheduler_address))
        assert isinstance(results[0], TrialFailure)
        assert "worker process died" in results[0].error
        assert isinstance(results[1], TrialSuccess)
        calls = times(fake.calls)
        assert calls[0] == 3
        assert calls[1] == 2

    @pytest.mark.slow
    def test_one_that_is_there_does_the_same(self, tmp_path):
        from distributed import LocalCluster

        units, fake = units_of(tmp_path, 5), Fake(tmp_path / "calls", {1: ("raise", 1), 2: ("raise", ALWAYS)})
        with LocalCluster(n_workers=1, threads_per_worker=2, host="127.0.0.1", dashboard_address=":0") as cluster:
            results = by_seed(run_units(units, fake, scheduler=cluster.scheduler_address))
            assert {seed for seed, result in results.items() if isinstance(result, TrialFailure)} == {2}
            again = list(run_units(units[:1], fake, scheduler=cluster.scheduler_address))
        assert len(again) == 1
        assert times(fake.calls) == {0: 2, 1: 2, 2: 3 + 2, 3: 1, 4: 1}

    @pytest.mark.slow
    @pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x"])
    def test_a_missing_scheduler_is_reported(self, tmp_path, monkeypatch, address):
        monkeypatch.setattr(scheduling, "_PATIENCE", 0.5)
        with pytest.raises(ValueError, match=f"--scheduler {address}: no Dask scheduler"):
            next(run_units(units_of(tmp_path, 1), Fake(tmp_path / "calls"), scheduler=address))

    @pytest.mark.slow
    def test_a_scheduler_without_workers_or_with_other_code_is_refused(self, tmp_path, monkeypatch):
        from distributed import LocalCluster

        monkeypatch.setattr(scheduling, "_FIRST_WORKER", 0.5)
        unit, fake = units_of(tmp_path, 1), Fake(tmp_path / "calls")
        with LocalCluster(n_workers=0, processes=False, dashboard_address=":0") as cluster:
            with pytest.raises(ValueError, match="it has no workers"):
                next(run_units(unit, fake, scheduler=cluster.scheduler_address))
            cluster.scale(1)
            monkeypatch.setattr(scheduling, "_FIRST_WORKER", 60)
            monkeypatch.setattr(scheduling, "code", object)  # no two objects are equal
            with pytest.raises(ValueError, match="another version of simharness"):
                next(run_units(unit, fake, scheduler=cluster.scheduler_address))
        assert called(fake.calls) == []
