"""Mutated files: every reader returns a value or refuses them in one line; none crashes, hangs or takes all memory."""

import os

import pytest
from file_mutations import KINDS
from reader_fuzzing import Worker, fuzz

ROUNDS = 9 if os.environ.get("SIMHARNESS_HYPOTHESIS") == "nightly" else 4
"""Mutations of every kind for each reader: 72 together, 162 at night. A mistake that a reader makes in 4 % of the
mutations stays unseen with a probability of 5 %, one of 2 % at night with 4 %; ``reader_fuzzing.py 2000`` looks for
rarer ones."""


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
    assert all(tally.counts["refused"] for reader, tally in tallies.items() if reader not in stores)
    assert all(tally.counts["accepted"] for tally in tallies.values())


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
