"""Runs of a study: trials that run, trials that are kept, and the result folder."""

import json

import numpy as np
import polars as pl
import pytest
from fakes import ALWAYS, Fake, called, made_up, study_of, times
from trials import Recorder

from simharness.scenario.load import load_study
from simharness.scoring.catalogue import SCORES
from simharness.study.study_folder import TABLES, read_study
from simharness.study.study_run import FailedTrial, Interrupted, run_shard, run_study
from simharness.study.trial_store import Store
from simharness.trial.identity import entry_identity, trial_identity


@pytest.fixture
def run(tmp_path):
    """Run a made-up study; the calls of its trials are in ``run.calls``."""

    def run(study, harm=None, **options):
        return run_study(study, out=tmp_path / "out", measure=Fake(run.calls, harm or {}), **options)

    run.calls = tmp_path / "calls"
    run.store = tmp_path / "out" / "store"
    return run


def counts(results):
    return tuple(results.info[key] for key in ("trials", "kept", "run")) + (len(results.info["failed"]),)


class TestTables:
    def test_every_trial_and_variant_has_a_row_with_its_factors_and_scores(self, tmp_path, run):
        study = study_of(tmp_path, cameras=(3, 5), seeds=3)
        results = run(study)
        rows = [
            (setting, seed, variant) for setting in study.settings for seed in study.seeds for variant in study.variants
        ]
        assert len(results.trials) == len(rows) == 12
        for row, (setting, seed, variant) in zip(results.trials.iter_rows(named=True), rows, strict=True):
            scenario = study.at(setting, seed)
            assert row["trial"] == trial_identity(scenario)
            assert (row["cameras.count"], row["seed"], row["variant"]) == (scenario.cameras.count, seed, variant)
            expected = made_up(scenario, variant)
            assert {key: row[key] for key in SCORES} == expected.scores
            row_filter = (pl.col("trial") == row["trial"]) & (pl.col("variant") == variant)
            for table in ("frames", "people", "failures"):
                part = getattr(results, table).filter(row_filter).drop("trial", "variant")
                assert part.equals(getattr(expected, table))

    def test_a_trial_can_be_made_again_from_its_row(self, tmp_path, run):
        study = study_of(tmp_path, cameras=(3, 5), more="people.count = 2")
        results = run(study)
        assert results.scenario_of(results.trials["trial"][-1]) == study.at(study.settings[-1], study.seeds[-1])
        with pytest.raises(ValueError, match="no trial ff"):
            results.scenario_of("ff")

    def test_the_read_results_equal_the_returned_ones(self, tmp_path, run):
        results = run(study_of(tmp_path))
        again = read_study(results.folder)
        assert again.info == results.info
        for table in ("trials", "frames", "people", "failures"):
            assert getattr(again, table).equals(getattr(results, table))

    @pytest.mark.parametrize("table", TABLES)
    def test_arrow_reads_them(self, tmp_path, run, table):
        """The page of a study states that Arrow reads its Parquet files."""
        results = run(study_of(tmp_path, cameras=(3, 5)))
        rows, file = getattr(results, table).rows(), str(results.folder / f"{table}.parquet")
        arrow = pytest.importorskip("pyarrow.parquet").read_table(file)
        assert [tuple(row.values()) for row in arrow.to_pylist()] == rows
        assert arrow.column_names == getattr(results, table).columns

    @pytest.mark.parametrize("table", TABLES)
    def test_pandas_reads_them(self, tmp_path, run, table):
        pytest.importorskip("pyarrow")
        frame = pytest.importorskip("pandas").read_parquet(
            run(study_of(tmp_path, cameras=(3, 5))).folder / f"{table}.parquet", engine="pyarrow"
        )
        expected = getattr(read_study(tmp_path / "out" / "views"), table)
        assert list(frame.columns) == expected.columns
        for column in expected.columns:
            values = [list(each) if isinstance(each, np.ndarray) else each for each in frame[column]]
            assert values == expected[column].to_list()

    @pytest.mark.parametrize("table", TABLES)
    def test_duckdb_reads_them(self, tmp_path, run, table):
        duckdb = pytest.importorskip("duckdb")
        results = run(study_of(tmp_path, cameras=(3, 5)))
        read = duckdb.sql(f"SELECT * FROM '{results.folder / f'{table}.parquet'}'")
        assert read.columns == getattr(results, table).columns
        assert read.fetchall() == getattr(results, table).rows()

    def test_settings_that_share_a_trial_run_once_and_have_two_rows(self, tmp_path, run):
        more = "[cases.one]\npeople.count = 2\n[cases.same]\npeople.count = 2\n[cases.other]\npeople.count = 3\n"
        path = tmp_path / "cases.toml"
        path.write_text(f'name = "cases"\nvariants = ["fast"]\n{more}')
        results = run(load_study(path))
        assert len(called(run.calls)) == 2
        assert results.trials["case"].to_list() == ["one", "same", "other"]
        assert results.trials["trial"].n_unique() == results.frames["trial"].n_unique() == 2
        assert len(results.frames) == 2 * 3
        assert counts(results) == (2, 0, 2, 0)


class TestResuming:
    def test_seeds_come_before_settings(self, tmp_path, run):
        run(study_of(tmp_path, cameras=(3, 4), seeds=2))
        assert called(run.calls) == ["0 3 full+fast", "0 4 full+fast", "1 3 full+fast", "1 4 full+fast"]

    def test_nothing_is_run_twice(self, tmp_path, run):
        study = study_of(tmp_path, cameras=(3, 4))
        assert counts(run(study)) == (4, 0, 4, 0)
        results = run(study)
        assert counts(results) == (4, 4, 0, 0)
        assert len(called(run.calls)) == 4
        assert len(results.trials) == 8

    def test_a_changed_factor_runs_the_new_settings(self, tmp_path, run):
        run(study_of(tmp_path, cameras=(3, 4)))
        assert counts(run(study_of(tmp_path, cameras=(4, 5)))) == (4, 2, 2, 0)
        assert called(run.calls)[4:] == ["0 5 full+fast", "1 5 full+fast"]

    def test_more_seeds_run_the_new_ones(self, tmp_path, run):
        run(study_of(tmp_path, seeds=2))
        assert counts(run(study_of(tmp_path, seeds=3))) == (3, 2, 1, 0)
        assert called(run.calls)[2:] == ["2 3 full+fast"]

    def test_another_variant_runs_that_variant(self, tmp_path, run):
        run(study_of(tmp_path, variants=("fast",)))
        results = run(study_of(tmp_path, variants=("full", "fast")))
        assert called(run.calls)[2:] == ["0 3 full", "1 3 full"]
        assert results.trials["variant"].to_list() == ["full", "fast"] * 2

    @pytest.mark.parametrize("entries", range(1, 7))
    def test_an_interruption_after_any_entry_reports_the_finished_trials(self, tmp_path, run, monkeypatch, entries):
        study, write, written = study_of(tmp_path, seeds=3), Store.write, []

        def interrupted(store, identity, entry):
            write(store, identity, entry)
            written.append(identity)
            if len(written) == entries:
                raise KeyboardInterrupt

        with monkeypatch.context() as context:
            context.setattr(Store, "write", interrupted)
            with pytest.raises(Interrupted) as stopped:
                run(study)
        finished, half = divmod(entries, 2)
        assert str(stopped.value).startswith(f"interrupted: {finished} of 3 trials are stored")
        before = len(called(run.calls))
        assert counts(run(study)) == (3, finished, 3 - finished, 0)
        if half:
            assert called(run.calls)[before] == f"{finished} 3 fast"  # the other variant is there
        assert len(called(run.calls)) == before + 3 - finished

    def test_a_new_name_runs_nothing(self, tmp_path, run):
        run(study_of(tmp_path))
        results = run(study_of(tmp_path, name="renamed"))
        assert counts(results) == (2, 2, 0, 0)
        assert results.folder.name == "renamed"
        assert results.scenario_of(results.trials["trial"][0]).name == "renamed"

    def test_a_damaged_entry_is_run_again_and_reported(self, tmp_path, run):
        study = study_of(tmp_path)
        before = run(study)
        identity = entry_identity(before.trials["trial"][0], "fast")
        file = Store(run.store).file_of(identity)
        file.write_bytes(file.read_bytes()[:-30])
        results = run(study)
        assert called(run.calls)[2:] == ["0 3 fast"]
        assert results.info["damaged"] == [identity]
        assert results.trials.drop("seconds").equals(before.trials.drop("seconds"))
        assert run(study).info["damaged"] == []


class TestFailures:
    def test_other_trials_go_on_and_failed_ones_are_listed(self, tmp_path, run):
        study = study_of(tmp_path, cameras=(3, 4), seeds=3)
        results = run(study, harm={1: ("raise", ALWAYS)})
        assert counts(results) == (6, 0, 4, 2)
        assert results.info["failed"][0] == vars(
            FailedTrial(
                trial=trial_identity(study.at(study.settings[0], 1)),
                case="",
                factors={"cameras.count": 3},
                seed=1,
                variants=["full", "fast"],
                error="ZeroDivisionError: by zero",
            )
        )
        assert sorted(results.trials["seed"].unique()) == [0, 2]
        assert times(run.calls)[1] == 2 * (3 + 2)  # three times together, then each variant once

    def test_failures_are_stored_with_traceback_and_tried_again_next_time(self, tmp_path, run):
        study = study_of(tmp_path)
        failed = run(study, harm={1: ("raise", 3 + 2)}).info["failed"]
        identity = entry_identity(failed[0]["trial"], "full")
        failure = Store(run.store).failure(identity)
        assert failure["error"] == "ZeroDivisionError: by zero"
        assert failure["traceback"].startswith("Traceback")
        assert "fakes.py" in failure["traceback"]
        results = run(study, harm={1: ("raise", 3 + 2)})
        assert counts(results) == (2, 1, 1, 0)
        assert Store(run.store).failure(identity) is None

    def test_an_error_of_the_scenario_is_tried_once(self, tmp_path, run):
        results = run(study_of(tmp_path), harm={1: ("refuse", ALWAYS)})
        assert [each["error"] for each in results.info["failed"]] == ["no room"]
        assert times(run.calls) == {0: 1, 1: 1}

    def test_a_study_may_fail_altogether(self, tmp_path, run):
        results = run(study_of(tmp_path), harm={0: ("refuse", ALWAYS), 1: ("refuse", ALWAYS)})
        assert counts(results) == (2, 0, 0, 2)
        assert results.trials.is_empty()
        assert read_study(results.folder).frames.is_empty()


class TestInfo:
    def test_the_study_is_in_the_folder_and_makes_the_same_trials(self, tmp_path, run):
        more = (
            'description = "a \\"quoted\\" one"\ndetector.profile = "typical"\n'
            "[cases.crowd]\npeople.count = 5\n[cases.duo.people]\ncount = 2\n"
            "[sweep]\none_at_a_time = true\nfaults.rotation = { from = 0.0, to = 1.0, steps = 3 }\n"
            '[[sweep.paired]]\npeople.area = [1.5, 2.0]\npeople.activities = [["walk"], ["wave", "walk"]]\n'
            "[gate]\nlevel = 0.01\n"
        )
        (tmp_path / "base.toml").write_text(f'name = "base"\nseeds = 7\n{more}')
        (tmp_path / "study.toml").write_text('extends = "base.toml"\nname = "own"\ncameras.count = 4\n')
        study = load_study(tmp_path / "study.toml", overrides=["duration=1.5"], seeds=2, variants=["fast"])
        assert len(study.settings) == 2 * (1 + 2 + 2)
        again = load_study(run(study).folder / "study.toml")
        for key in ("name", "description", "seeds", "variants", "factors", "one_at_a_time", "settings", "gate"):
            assert getattr(again, key) == getattr(study, key), key

    def test_the_info_describes_the_study_and_the_run(self, tmp_path, run):
        info = run(study_of(tmp_path, cameras=(3, 4)), command="simharness study x").info
        assert info == json.loads((tmp_path / "out" / "views" / "study.json").read_text())
        assert info["name"] == "views"
        assert info["seeds"] == [0, 1]
        assert info["variants"] == ["full", "fast"]
        assert info["factors"] == ["cameras.count"]
        assert (info["settings"], info["one_at_a_time"]) == (2, False)
        assert info["command"] == "simharness study x"
        assert set(info["versions"]) >= {"python", "mujoco", "numpy", "numba"}
        assert len(info["digests"]["method"]) == len(info["digests"]["simulation"]) == 32


class TestPlaces:
    def test_only_a_study_is_replaced(self, tmp_path, run):
        (tmp_path / "out" / "views").mkdir(parents=True)
        (tmp_path / "out" / "views" / "thesis.tex").touch()
        with pytest.raises(ValueError, match="has files, and is no result of simharness study"):
            run(study_of(tmp_path))
        assert (tmp_path / "out" / "views" / "thesis.tex").exists()
        assert not called(run.calls)

    def test_the_store_is_never_replaced(self, tmp_path, run):
        with pytest.raises(ValueError, match="would replace the store"):
            run(study_of(tmp_path, name="store"))
        with pytest.raises(ValueError, match="would replace the store"):
            run(study_of(tmp_path), store=tmp_path / "out" / "views" / "inside")
        assert not called(run.calls)

    def test_a_folder_that_cannot_be_created_is_refused_before_the_run(self, tmp_path):
        (tmp_path / "file").touch()
        fake = Fake(tmp_path / "calls")
        with pytest.raises(ValueError, match="cannot"):
            run_study(study_of(tmp_path), out=tmp_path / "file" / "out", store=tmp_path / "store", measure=fake)
        assert not called(fake.calls)

    @pytest.mark.parametrize("name", ["study.json", "trials.parquet", "people.parquet"])
    def test_a_folder_with_a_file_missing_is_no_study(self, tmp_path, run, name):
        folder = run(study_of(tmp_path)).folder
        (folder / name).unlink()
        with pytest.raises(ValueError, match=rf"not the result folder of a study.*{name}"):
            read_study(folder)

    @pytest.mark.parametrize("name", ["study.json", "frames.parquet"])
    def test_a_damaged_file_is_named(self, tmp_path, run, name):
        folder = run(study_of(tmp_path)).folder
        (folder / name).write_bytes((folder / name).read_bytes()[:40])
        with pytest.raises(ValueError, match="cannot be read"):
            read_study(folder)


class TestShards:
    @pytest.mark.parametrize("parts", [1, 2, 3, 5])
    def test_every_trial_is_in_one_shard(self, tmp_path, run, parts):
        study, fake = study_of(tmp_path, cameras=(3, 4), seeds=2), Fake(run.calls)
        outcomes = [run_shard(study, (i + 1, parts), store=run.store, measure=fake) for i in range(parts)]
        assert sum(each.trials for each in outcomes) == sum(each.run for each in outcomes) == 4
        assert sorted(called(run.calls)) == ["0 3 full+fast", "0 4 full+fast", "1 3 full+fast", "1 4 full+fast"]
        assert counts(run(study)) == (4, 4, 0, 0)

    @pytest.mark.parametrize("shard", [(0, 3), (4, 3), (1, 0)])
    def test_a_shard_that_does_not_exist_is_refused(self, tmp_path, run, shard):
        with pytest.raises(ValueError, match="from 1 to n"):
            run_shard(study_of(tmp_path), shard, store=run.store, measure=Fake(run.calls))


def test_the_reporter_receives_every_trial(tmp_path, run):
    run(study_of(tmp_path, seeds=1))
    recorder = Recorder()
    run(study_of(tmp_path, seeds=3), harm={2: ("refuse", ALWAYS)}, reporter=recorder)
    assert recorder.stages == [("trials", 3, 1)]
    assert recorder.steps == [(1, 0), (1, 1)]
