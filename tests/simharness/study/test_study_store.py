"""Store of finished trials."""

import dataclasses
import json
import multiprocessing
import os
import time

import pytest
from fakes import made_up, study_of
from hypothesis import given
from hypothesis import strategies as st

from simharness.study.study_folder import plan
from simharness.study.trial_store import Entry, EntryState, Store, StoreError, merge

ID, OTHER = "ab" * 16, "ac" * 16


@pytest.fixture(scope="module")
def entry(tmp_path_factory):
    (planned,) = plan(study_of(tmp_path_factory.mktemp("study"), seeds=1))
    return Entry(planned.trial, "full", made_up(planned.scenario, "full"), 1.5)


def same(one, other):
    assert (one.trial, one.variant, one.seconds) == (other.trial, other.variant, other.seconds)
    assert one.result.scores == other.result.scores
    for table in ("frames", "people", "failures"):
        assert getattr(one.result, table).equals(getattr(other.result, table))


def files(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def test_an_entry_is_read_as_it_was_written(tmp_path, entry):
    store = Store(tmp_path)
    assert store.read(ID) is None
    assert not store.has(ID)
    store.write(ID, entry)
    assert list(Store(tmp_path)) == [ID]
    assert Store(tmp_path).has(ID)
    same(Store(tmp_path).read(ID), entry)
    assert not Store(tmp_path).damaged


def test_a_score_that_does_not_apply_stays_none(tmp_path, entry):
    scores = {**entry.result.scores, "pcp": None}
    store = Store(tmp_path)
    store.write(ID, dataclasses.replace(entry, result=dataclasses.replace(entry.result, scores=scores)))
    assert store.read(ID).result.scores == scores


@pytest.fixture(scope="module")
def content(tmp_path_factory, entry):
    store = Store(tmp_path_factory.mktemp("store"))
    store.write(ID, entry)
    return store.file_of(ID).read_bytes()


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """Write bytes in place of an entry and open the store."""
    folder = tmp_path_factory.mktemp("broken")

    def put(content, identity=ID):
        store = Store(folder)
        store.file_of(identity).parent.mkdir(exist_ok=True)
        store.file_of(identity).write_bytes(content)
        return store

    return put


class TestDamage:
    @given(data=st.data())
    def test_no_flipped_bit_ever_changes_a_result(self, content, broken, entry, data):
        place = data.draw(st.integers(0, 8 * len(content) - 1))
        flipped = bytearray(content)
        flipped[place // 8] ^= 1 << place % 8
        store = broken(bytes(flipped))
        result = store.read(ID)
        if result is None:
            assert store.damaged == {ID}
            assert not store.has(ID)
        else:  # a bit without effect, such as the date of a file in the archive
            same(result, entry)

    def test_a_flipped_bit_in_the_tables_is_noticed(self, content, broken):
        at = content.index(b"PAR1") + 100
        store = broken(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
        assert not store.has(ID)
        assert store.damaged == {ID}

    @given(share=st.floats(0, 1, exclude_max=True))
    def test_a_cut_file_is_noticed(self, content, broken, share):
        store = broken(content[: int(share * len(content))])
        assert store.read(ID) is None
        assert store.damaged == {ID}

    def test_an_entry_under_the_name_of_another_is_noticed(self, content, broken):
        store = broken(content, OTHER)
        assert not store.has(OTHER)
        assert store.damaged == {OTHER}

    @pytest.mark.parametrize("lost", ["pcp", "hota"])
    def test_an_entry_that_lacks_a_score_is_noticed(self, tmp_path, entry, lost):
        """The same of another code is whole: it has the scores that this code gave."""
        scores = {key: score for key, score in entry.result.scores.items() if key != lost}
        lacking = dataclasses.replace(entry, result=dataclasses.replace(entry.result, scores=scores))
        store = Store(tmp_path / "store")
        store.write(ID, lacking)
        store.write(OTHER, dataclasses.replace(lacking, scores_code="other"))
        assert (store.read(ID), store.damaged) == (None, {ID})
        assert (store.state(ID), store.state(OTHER)) == (EntryState.MISSING, EntryState.OUTDATED)
        merged = merge([tmp_path / "store"], tmp_path / "merged")
        assert (merged.copied, merged.damaged) == (1, (store.file_of(ID),))

    def test_a_damaged_entry_can_be_written_again(self, content, broken, entry):
        store = broken(content[:-1])
        assert not store.has(ID)
        store.write(ID, entry)
        same(store.read(ID), entry)
        assert not store.damaged


class TestFolders:
    def test_another_format_is_refused(self, tmp_path):
        Store(tmp_path)
        content = json.loads((tmp_path / "store.json").read_text())
        (tmp_path / "store.json").write_text(json.dumps({**content, "format": content["format"] + 1}))
        with pytest.raises(ValueError, match=rf"format {content['format'] + 1}.*--store.*delete"):
            Store(tmp_path)

    @pytest.mark.parametrize("text", ["", "[1]", "{}", "\xff"])
    def test_a_store_without_a_format_is_refused(self, tmp_path, text):
        (tmp_path / "store.json").write_text(text)
        with pytest.raises(ValueError, match=r"store\.json cannot be read.*delete"):
            Store(tmp_path)

    def test_a_folder_with_other_files_is_refused(self, tmp_path):
        (tmp_path / "thesis.tex").touch()
        with pytest.raises(ValueError, match=r"not a store.*thesis\.tex"):
            Store(tmp_path)
        assert files(tmp_path) == [tmp_path / "thesis.tex"]

    def test_a_file_is_refused(self, tmp_path):
        (tmp_path / "file").touch()
        with pytest.raises(ValueError, match="cannot be used"):
            Store(tmp_path / "file" / "store")

    def test_temporary_files_of_killed_processes_are_removed_after_a_day(self, tmp_path, entry):
        store = Store(tmp_path)
        store.write(ID, entry)
        old, new = (store.file_of(ID).with_name(f".{name}.trial.1.2.partial") for name in ("old", "new"))
        old.touch()
        new.touch()
        os.utime(old, (time.time() - 25 * 3600,) * 2)
        assert set(Store(tmp_path)) == {ID}
        assert not old.exists()
        assert new.exists()


def test_an_entry_that_cannot_be_written_leaves_no_file(tmp_path, entry):
    store = Store(tmp_path)
    store.file_of(ID).mkdir(parents=True)  # no file can be renamed to it
    with pytest.raises(StoreError, match=r"cannot be written.*the same command again"):
        store.write(ID, entry)
    assert files(tmp_path) == [tmp_path / "store.json"]


def test_a_failure_is_stored_until_the_entry_is_written(tmp_path, entry):
    store = Store(tmp_path)
    store.write_failure(ID, {"error": "by zero"})
    assert store.failure(ID) == {"error": "by zero"}
    assert list(store) == []
    store.write(ID, entry)
    assert store.failure(ID) is None


def hammer(folder, entry, start, results):
    """Write and read a few entries many times."""
    start.wait()
    seen = set()
    for turn in range(20):
        store, identity = Store(folder), f"{turn % 4:02x}" * 16
        store.write(identity, entry)
        result = store.read(identity)
        seen.add(result is not None and result.result.scores == entry.result.scores)
        seen.add(not store.damaged)
    results.put(seen)


@pytest.mark.slow
def test_two_processes_can_use_one_store(tmp_path, entry):
    spawn = multiprocessing.get_context("spawn")
    start, results = spawn.Event(), spawn.Queue()
    arguments = tmp_path / "new", entry, start, results
    processes = [spawn.Process(target=hammer, args=arguments, daemon=True) for _ in range(2)]
    for process in processes:
        process.start()
    start.set()
    assert [results.get(timeout=300) for _ in processes] == [{True}, {True}]
    for process in processes:
        process.join()
    assert len(list(Store(tmp_path / "new"))) == 4
    assert len(files(tmp_path)) == 5
