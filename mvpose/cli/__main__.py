"""``python -m mvpose.cli``."""

from mvpose.cli import main

main()
