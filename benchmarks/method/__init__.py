"""Benchmark of the method: running time, memory, and quality of matching; ``python -m benchmarks.method``.

Each section is a module with ``measure(quick=...)``, which returns plain data, and ``table_of(rows)``, which formats
it as text:

- ``stages``: time of every stage at three sizes, compared with the targets and the released code;
- ``published``: time of both presets at the sizes for which times of other code are known, compared with those times;
- ``reid``: time of the re-ID network, per crop and per frame;
- ``hard``: the three matching methods on noisy scenes with missed people and phantoms;
- ``curve``: time against the number of views and people, with the exponent;
- ``memory``: peak memory of a process;
- ``start``: time of import and compilation.

The scenes are synthetic (:mod:`benchmarks.method.scenes`), so the benchmark needs no data and no simulator.
"""
