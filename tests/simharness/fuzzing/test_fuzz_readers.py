"""Mutated files: every reader returns a value or refuses them in one line; none crashes, hangs or takes all memory."""

import pytest
from file_mutations import KINDS
from reader_fuzzing import Worker, fuzz

ROUNDS = 9
"""Mutations of every kind for each reader: 162 together. A mistake that a reader makes in 2 % of the mutations stays
unseen with a probability of 4 %, one of 3 % with .7 %; ``reader_fuzzing.py 2000`` looks for rarer ones."""


@pytest.fixture(scope="module")
def worker(tmp_path_factory):
    """A worker process for all tests: it takes seconds to start."""
    started = Worker(tmp_path_factory.mktemp("fuzzed"))
    yield started
    started.close()


def refusals(tallies):
    return {reader: tally.problems for reader, tally in tallies.items() if tally.problems}


@pytest.mark.slow
def test_no_mutated_file_gets_past_a_reader(worker):
    tallies = {reader: tally for reader, tally in fuzz(range(ROUNDS * len(KINDS)), worker)}
    assert len(tallies) > 30
    assert not refusals(tallies)
    stores = {reader for reader in tallies if reader.startswith("store ")}  # what is damaged there counts as missing
    assert [reader for reader, each in tallies.items() if not each.counts["refused"] and reader not in stores] == []
    assert [reader for reader, each in tallies.items() if not each.counts["accepted"]] == []


@pytest.mark.slow
def test_a_dead_worker_counts_as_a_failure_and_the_next_one_answers(worker):
    worker._process.kill()
    assert worker.attempt("store", 0)["outcome"] == "failed"
    assert worker.attempt("store", 0)["outcome"] in ("accepted", "refused")


def test_an_unknown_reader_is_refused_with_the_names_of_all():
    class Idle:
        readers = ("TRC markers", "study")

    with pytest.raises(ValueError, match="no reader is called trc; the readers are TRC markers, study"):
        next(fuzz(range(2), Idle(), ["study", "trc"]))
