"""Benchmark of the tracker, what it costs and its memory over hours: ``python -m benchmarks.tracking``."""
