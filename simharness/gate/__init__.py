"""The gate before a merge: a suite of scenarios beside its committed baseline."""
