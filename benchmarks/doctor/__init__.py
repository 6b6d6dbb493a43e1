"""Benchmark of the doctor: faults named, rigs repaired, intervals that hold, and what is refused."""
