"""What the simulator costs: ``python -m simharness.bench``.

Sections, each a module with ``measure(quick=...)``, whose result is plain data, and ``table_of(result)``, its text:

- ``rendering``: milliseconds a picture of the rasteriser, pictures a second on two processes, posing and skinning;
- ``simulation``: scene frames a second without pictures, and cost against people and cameras.

``python -m simharness.bench.plot`` shows what ``python -m mvpose.bench`` measured of the method.

The scenes come from :mod:`simharness.bench.scenes`; how they are timed from :mod:`mvpose.bench`.
"""
