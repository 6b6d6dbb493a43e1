import subprocess
import sys

import pytest

import simharness


def test_every_public_name_can_be_imported():
    for name in simharness.__all__:
        assert getattr(simharness, name).__name__ == name
    with pytest.raises(AttributeError, match="it has Blame, ForeignProgram, KeypointError, Recording"):
        _ = simharness.Nothing


def test_public_names_are_listed_before_their_first_use():
    code = "import simharness, mvpose; print({*simharness.__all__, *mvpose.__all__} - {*dir(simharness), *dir(mvpose)})"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"


def test_importing_the_package_and_its_command_line_is_light():
    heavy = ("numba", "mujoco", "polars", "matplotlib", "scipy", "cv2", "OpenGL")
    code = f"import sys, simharness, simharness.cli; print(*(m for m in {heavy} if m in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split() == []
