"""A study that was run, small and without pictures; everything else here is made."""

import pytest

STUDY = """
extends = "{quickstart}"
name = "tiny"
duration = 0.6
rate = 5.0
seeds = [3, 4]
variants = ["full", "fast"]
[people]
count = 2
[rendering]
renderer = "rays"
[cameras]
size = [240, 180]
[sweep]
cameras.count = [2, 3]
"""


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """Two settings at two seeds by two variants."""
    from simharness.scenario.profiles import SHIPPED
    from simharness.scenario.study_definition import load_study
    from simharness.study.runner import run_study

    folder = tmp_path_factory.mktemp("ran")
    file = folder / "tiny.toml"
    file.write_text(STUDY.format(quickstart=SHIPPED.parent / "quickstart.toml"))
    return run_study(load_study(file), out=folder / "out", command="simharness study tiny.toml")


@pytest.fixture(scope="session")
def shown(ran):
    """The worst frames of that study, with the trials that they are from."""
    from simharness.report.study.worst_frames import show, worst_frames

    return list(show(ran, worst_frames(ran)))
