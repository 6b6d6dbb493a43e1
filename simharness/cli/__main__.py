"""Command line as a module: ``python -m simharness.cli``."""

from simharness.cli import main

main()
