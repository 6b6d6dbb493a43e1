"""Mutation testing: which small changes of the code the tests near it notice; ``python -m benchmarks.mutation FOLDER``.

A mutant is the code with one small change: another comparison, another sign, a statement left out
(:mod:`~benchmarks.mutation.operators`). Kernels are compiled again for each, so a seeded sample of the mutants of every
package is run, each in a copy of the checkout, with the tests that import the changed module and those of its folder
(:mod:`~benchmarks.mutation.near`). FOLDER keeps the copy and the mutants that tests killed: an interrupted run goes on,
a later one with a larger ``--sample`` adds to it, and survivors are run again, because there may be new tests.

- ``--packages mvpose/tracking ...`` some packages only; ``--sample N`` mutants of each (default: 20);
- ``--list`` prints the sample and runs nothing.

``equivalent.toml`` lists survivors that change no correct result, each with the reason; the score leaves them out.
"""
