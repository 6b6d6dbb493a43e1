"""A method in another program as a user-defined estimator: ``foreign = "wrapped.py:foreign"``."""

import sys
from pathlib import Path

from simharness import ForeignProgram

foreign = ForeignProgram([sys.executable, Path(__file__).with_name("program.py")], seconds=20)
