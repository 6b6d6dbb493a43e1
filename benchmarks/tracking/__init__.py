"""Benchmark of the tracker: its time, its memory over hours, lost pictures: ``python -m benchmarks.tracking``."""
