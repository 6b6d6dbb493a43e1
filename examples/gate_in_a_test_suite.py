"""For CI: limits that a method must keep under conditions of your choice, as a test of your test suite.

``pytest examples/gate_in_a_test_suite.py`` runs the test of this file. As a program it shows what a broken limit says.
To compare a change of the method with the version before it, use ``simharness check`` (docs/guide/gate.md).
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from simharness import assert_robust

SUITE = """
extends = "quickstart"
name = "our-hall"
duration = 0.8
seeds = 3
rendering.renderer = "rays"

[cases.as_built]

[cases.camera_bumped]
faults.rotation = 0.5        # degrees about each axis

[cases.two_cameras_left]
cameras.count = 2
"""


def require(*, pcp: float) -> None:
    """Assert limits of mean scores over all conditions and seeds: PCP and recall in percent, false people per frame."""
    with TemporaryDirectory() as folder:
        suite = Path(folder) / "our-hall.toml"
        suite.write_text(SUITE)
        assert_robust(suite, variant="full", pcp=pcp, recall=80, ghosts=1.0)


def test_people_are_found_in_our_hall() -> None:
    """As built, after a camera was bumped, and with two cameras left."""
    require(pcp=75)


def main() -> None:
    """Keep a limit, then break one."""
    test_people_are_found_in_our_hall()
    print("the limits hold")
    try:
        require(pcp=99.9)
    except AssertionError as error:
        print(f"a broken limit:\n{error}")


if __name__ == "__main__":
    main()
