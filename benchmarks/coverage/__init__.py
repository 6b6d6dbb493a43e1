"""Coverage of intervals and levels of tests in simulations with known truth; ``python -m benchmarks.coverage``.

Populations are like scores of scenes: rare ghosts, percentages at their bound, skewed errors, curves with a plateau
near their threshold. The same ones are asserted on with fewer repetitions in ``tests/simharness/statistics``.
"""
