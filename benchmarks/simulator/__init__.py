"""Benchmark of the running time of the simulator: ``python -m benchmarks.simulator``.

Each section is a module with ``measure(quick=...)``, which returns plain data, and ``table_of(rows)``, which formats
it as text:

- ``rendering``: time per picture of the rasteriser, pictures per second on two processes, time of posing and skinning;
- ``simulation``: scene frames per second without pictures, and time against the number of people and cameras.

``python -m benchmarks.simulator.plot`` plots the results of ``python -m benchmarks.method``; it is here because it uses
the figures of simharness.

The scenes are in :mod:`benchmarks.simulator.scenes`; the functions for timing are those of :mod:`benchmarks.method`.
"""
