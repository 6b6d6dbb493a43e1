"""Mutated files: every reader returns a value or refuses them in one line; none crashes, hangs or takes all memory."""

import pytest
from file_mutations import KINDS
from reader_fuzzing import Worker, fuzz


def refusals(tallies):
    return {reader: tally.problems for reader, tally in tallies.items() if tally.problems}


def run(numbers, folder):
    tallies = dict(fuzz(numbers, folder))
    assert len(tallies) > 30
    assert not refusals(tallies)
    stores = {reader for reader in tallies if reader.startswith("store ")}  # what is damaged there counts as missing
    assert all(tally.counts["refused"] for reader, tally in tallies.items() if reader not in stores)
    assert all(tally.counts["accepted"] for tally in tallies.values())


def test_no_mutated_file_gets_past_a_reader(tmp_path):
    run(range(3 * len(KINDS)), tmp_path)


@pytest.mark.slow
def test_no_file_of_many_mutations_gets_past_a_reader(tmp_path):
    run(range(3 * len(KINDS), 20 * len(KINDS)), tmp_path)


@pytest.mark.slow
def test_a_dead_worker_counts_as_a_failure_and_the_next_one_answers(tmp_path):
    worker = Worker(tmp_path)
    try:
        worker._process.kill()
        assert worker.attempt("store", 0)["outcome"] == "failed"
        assert worker.attempt("store", 0)["outcome"] in ("accepted", "refused")
    finally:
        worker.close()


def test_an_unknown_reader_is_refused_with_the_names_of_all(tmp_path, monkeypatch):
    class Idle:
        readers = ("TRC markers", "study")

        def __init__(self, folder):
            self.closed = False

        def close(self):
            self.closed = True

    monkeypatch.setattr("reader_fuzzing.Worker", Idle)
    with pytest.raises(ValueError, match="no reader is called trc; the readers are TRC markers, study"):
        next(fuzz(range(2), tmp_path, ["study", "trc"]))
