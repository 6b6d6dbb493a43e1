"""What the method costs, and how well its matching solves hard instances: ``python -m benchmarks.method``.

Sections, each a module with ``measure(quick=...)``, whose result is plain data, and ``table(result)``, its text:

- ``stages``: milliseconds of every stage at three sizes, beside the targets and the released code;
- ``published``: both presets at the sizes at which others were timed, beside those figures;
- ``reid``: the re-identification network, a crop and a frame;
- ``hard``: the three ways of matching on noisy scenes with misses and phantoms;
- ``curve``: cost against views and people, with the exponent;
- ``memory``: the most memory that a process holds;
- ``start``: import and compilation.

The scenes are made here (:mod:`benchmarks.method.scenes`), so the benchmark needs no data and no simulator.
"""
