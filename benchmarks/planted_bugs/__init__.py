"""Planted bugs: what the gate and the tests notice; ``python -m benchmarks.planted_bugs FOLDER``.

A gate or a test that has never failed proves nothing. This benchmark plants known bugs (``catalogue.toml``), one at a
time, in a copy of the checkout, runs the gate and the tests near the bug, and prints which of them noticed. FOLDER
keeps a copy, simulations and the results of finished bugs, so an interrupted run goes on.

- ``--list`` checks that each bug still applies to the code;
- ``--by tests`` or ``--by gate`` runs one of the two only, ``--only ID ...`` some bugs only;
- ``--by hunt`` hunts for failures with ten bugs of the method planted, and with two changes that change no result;
- ``--effects`` measures the effects of the bugs on the scores of the suite with fresh seeds;
- ``--clean-runs N`` counts false alarms: the gate runs N times on the unchanged code with another detector noise.

Modules: :mod:`~benchmarks.planted_bugs.catalogue` (the bugs), :mod:`~benchmarks.planted_bugs.checkout` (copies of the
checkout), :mod:`~benchmarks.planted_bugs.simulations` (simulations that a bug cannot change are run once),
:mod:`~benchmarks.planted_bugs.gate`, :mod:`~benchmarks.planted_bugs.near_tests`,
:mod:`~benchmarks.planted_bugs.hunting`,
:mod:`~benchmarks.planted_bugs.effects`, :mod:`~benchmarks.planted_bugs.records` (finished results) and
:mod:`~benchmarks.planted_bugs.report`.
"""
