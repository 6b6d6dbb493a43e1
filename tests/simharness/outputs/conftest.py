"""Small real study without pictures; all other studies of these tests are synthetic."""

import pytest

STUDY = """
extends = "{quickstart}"
name = "tiny"
duration = 0.6
rate = 5.0
seeds = [3, 4]
variants = ["full", "fast"]
room.walls = false  # the light of a room takes most of the time of a picture
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
    """Results of two settings at two seeds with two variants."""
    from simharness.scenario.load import load_study
    from simharness.scenario.shipped import shipped_folder
    from simharness.study.study_run import run_study

    folder = tmp_path_factory.mktemp("ran")
    file = folder / "tiny.toml"
    file.write_text(STUDY.format(quickstart=shipped_folder() / "quickstart.toml"))
    return run_study(load_study(file), out=folder / "out", command="simharness study tiny.toml")


@pytest.fixture(scope="session")
def shown(ran):
    """Worst frames of that study, with their trials."""
    from simharness.outputs.study.worst_frames import show, worst_frames

    return list(show(ran, worst_frames(ran)))
