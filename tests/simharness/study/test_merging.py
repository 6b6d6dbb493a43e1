"""Merge of stores."""

import json

import pytest
from fakes import Fake, called, study_of

from simharness.study.study_run import run_shard, run_study
from simharness.study.trial_store import Store, merge


@pytest.fixture
def shards(tmp_path):
    """Return a study, and three stores with a third of its trials each."""
    study = study_of(tmp_path, cameras=(3, 4), seeds=3)
    stores = [tmp_path / f"shard{part}" for part in (1, 2, 3)]
    for part, store in enumerate(stores, start=1):
        run_shard(study, (part, 3), store=store, measure=Fake(tmp_path / "calls"))
    return study, stores


def test_the_parts_of_a_study_make_the_study(tmp_path, shards):
    study, stores = shards
    merged = merge(stores, tmp_path / "all")
    assert (merged.copied, merged.present, merged.damaged) == (12, 0, ())
    calls = called(tmp_path / "calls")
    together = run_study(study, out=tmp_path / "out", store=tmp_path / "all", measure=Fake(tmp_path / "calls"))
    assert called(tmp_path / "calls") == calls
    alone = run_study(study, out=tmp_path / "alone", measure=Fake(tmp_path / "calls2"))
    assert together.info["run"] == 0
    for table in ("trials", "frames", "people", "failures"):
        one, other = (getattr(each, table).drop("seconds", strict=False) for each in (together, alone))
        assert len(one) > 0
        assert one.equals(other)


def test_existing_entries_stay(tmp_path, shards):
    _, stores = shards
    merge(stores[:2], tmp_path / "all")
    merged = merge(stores, tmp_path / "all")
    assert (merged.copied, merged.present) == (4, 8)
    assert len(list(Store(tmp_path / "all"))) == 12


def test_damaged_entries_are_left_out_and_replaced_by_undamaged_ones(tmp_path, shards):
    _, stores = shards
    identity = next(iter(Store(stores[0])))
    file = Store(stores[0]).file_of(identity)
    whole = file.read_bytes()
    file.write_bytes(whole[:-5])
    merged = merge(stores, tmp_path / "all")
    assert (merged.copied, merged.damaged) == (11, (file,))
    assert not Store(tmp_path / "all").file_of(identity).exists()

    file.write_bytes(whole)
    target = Store(tmp_path / "all").file_of(identity)
    target.parent.mkdir(exist_ok=True)
    target.write_bytes(whole[:-5])
    assert merge(stores, tmp_path / "all").copied == 1
    assert target.read_bytes() == whole


def test_a_folder_that_is_no_store_is_refused(tmp_path, shards):
    _, stores = shards
    for name in ("nowhere", "empty"):
        if name == "empty":
            (tmp_path / name).mkdir()
        with pytest.raises(ValueError, match=f"{name}: not a store"):
            merge([*stores, tmp_path / name], tmp_path / "all")
        assert not (tmp_path / name / "store.json").exists()
    assert not (tmp_path / "all").exists()


def test_a_store_of_another_format_is_refused_before_anything_is_copied(tmp_path, shards):
    _, stores = shards
    (stores[2] / "store.json").write_text(json.dumps({"format": 0}))
    with pytest.raises(ValueError, match="format 0"):
        merge(stores, tmp_path / "all")
    assert list(tmp_path.glob("all/??")) == []


def test_a_store_is_not_merged_into_itself_or_within(tmp_path, shards):
    _, (one, other, _) = shards
    before = sorted(tmp_path.rglob("*"))
    (tmp_path / "link").symlink_to(one)
    for into in (one, one / "sub", one / "sub" / "deep", tmp_path / "link" / "sub", other / ".." / one.name):
        with pytest.raises(ValueError, match=r"--into .*(is the store .* itself|lies in .*)"):
            merge([other, one], into)
    with pytest.raises(ValueError, match=r"shard1: lies in --into"):
        merge([one], tmp_path)
    (tmp_path / "link").unlink()
    assert sorted(tmp_path.rglob("*")) == before
    assert merge([one, other], tmp_path / f"{one.name}b").copied  # a name that begins with that of a source
