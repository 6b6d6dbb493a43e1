"""Benchmarks of running time and of figures that tests are too short for; never imported by the packages."""
