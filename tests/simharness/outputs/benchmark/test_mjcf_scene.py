"""Scenes as MJCF: MuJoCo reads them, and bodies, geoms, cameras and shown meshes are those of the scene."""

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

from simharness.capture.picture import meshes_at
from simharness.cli import app
from simharness.outputs.benchmark.mjcf_scene import HIDDEN_GROUP, SHOWN_GROUP, write_mjcf
from simharness.scenario.load import load
from simharness.trial.stages.build_trial import true_rig
from simharness.world.scene.build import build
from simharness.world.scene.playback import Playback

SMALL = ("people.count=2", "clutter.boxes=1", "clutter.carts=1", "duration=0.4", "cameras.count=3")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    scenario = load("quickstart", overrides=SMALL)
    rig = true_rig(scenario)
    scene = build(scenario, rig)
    model = mujoco.MjModel.from_xml_path(str(write_mjcf(scene, rig, tmp_path_factory.mktemp("mjcf") / "scene")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    playback = Playback(scene)
    return scene, rig, playback, playback.at(0.0), model, data


def test_bodies_and_geoms_are_those_of_the_scene(written):
    scene, _, playback, _, model, data = written
    ours, theirs = ([each.body(k).name for k in range(each.nbody)] for each in (model, scene.model))
    assert ours == theirs
    np.testing.assert_allclose(data.xpos, playback.data.xpos, atol=2e-5)
    np.testing.assert_allclose(data.xmat, playback.data.xmat, atol=2e-5)
    assert (model.geom_group == HIDDEN_GROUP).sum() == scene.model.ngeom
    for k in range(scene.model.ngeom):
        np.testing.assert_allclose(data.geom(scene.model.geom(k).name).xpos, playback.data.geom_xpos[k], atol=1e-4)
    assert model.nq == 0


def test_cameras_are_those_of_the_rig(written):
    _, rig, *_, model, data = written
    assert [model.cam(k).name for k in range(model.ncam)] == [camera.name for camera in rig]
    for k, camera in enumerate(rig):
        np.testing.assert_allclose(data.cam_xpos[k], camera.center, atol=2e-5)
        axes = data.cam_xmat[k].reshape(3, 3)
        np.testing.assert_allclose(axes, np.column_stack([camera.R[0], -camera.R[1], -camera.R[2]]), atol=2e-5)
        focal = camera.size[1] / 2 / np.tan(np.radians(model.cam_fovy[k]) / 2)
        assert focal == pytest.approx(camera.K[1, 1], rel=1e-5)


def test_people_and_solids_are_shown_where_they_are(written):
    scene, _, _, state, model, data = written
    names = [*(f"person{k}" for k in range(len(scene.bodies))), *(solid.name for solid in scene.solids)]
    for name, mesh in zip(names, meshes_at(scene, state), strict=True):
        points = []
        for k in np.flatnonzero(model.geom_group == SHOWN_GROUP):
            label = model.geom(k).name.removeprefix("shown ")
            if label == name or (label.startswith(f"{name} ") and label.removeprefix(f"{name} ").isdigit()):
                first, count = model.mesh_vertadr[model.geom_dataid[k]], model.mesh_vertnum[model.geom_dataid[k]]
                local = model.mesh_vert[first : first + count]
                points.append(local @ data.geom_xmat[k].reshape(3, 3).T + data.geom_xpos[k])
        shown = np.concatenate(points)
        used = mesh.vertices[np.unique(mesh.faces)]
        np.testing.assert_allclose(shown.min(axis=0), used.min(axis=0), atol=1e-3)
        np.testing.assert_allclose(shown.max(axis=0), used.max(axis=0), atol=1e-3)


@pytest.mark.slow
def test_the_command_writes_a_scene_and_says_how_to_open_it(tmp_path):
    arguments = ["mjcf", "quickstart", "--out", str(tmp_path)]
    for each in (*SMALL, 'room.kind="office"'):
        arguments += ["--set", each]
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    file = tmp_path / "quickstart" / "scene.xml"
    assert "".join(result.output.split()) == f"python-mmujoco.viewer--mjcf={file}"
    assert mujoco.MjModel.from_xml_path(str(file)).ngeom > 100
