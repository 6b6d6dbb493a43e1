"""Benchmarks of the running time of the method and the simulator; never imported by the packages."""
