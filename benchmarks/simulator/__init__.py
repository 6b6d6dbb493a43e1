"""What the simulator costs: ``python -m benchmarks.simulator``.

Sections, each a module with ``measure(quick=...)``, whose result is plain data, and ``table_of(result)``, its text:

- ``rendering``: milliseconds a picture of the rasteriser, pictures a second on two processes, posing and skinning;
- ``simulation``: scene frames a second without pictures, and cost against people and cameras.

``python -m benchmarks.simulator.plot`` shows what ``python -m benchmarks.method`` measured of the method.

The scenes come from :mod:`benchmarks.simulator.scenes`; how they are timed from :mod:`benchmarks.method`.
"""
