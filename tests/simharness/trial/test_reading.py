"""Networks that read the rendered pictures of a scenario."""

import numpy as np
import pytest
from onnx_graphs import constant_people, dots, mean_color
from trials import simulated as detected_frames

from simharness.outputs.run.result_folder import run
from simharness.scenario.load import ScenarioError, load
from simharness.trial.identity import trial_identity
from simharness.trial.run_folder import read_run
from simharness.trial.stages.build_trial import build_trial
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility

BODY = """
name = "tiny"
seed = 5
duration = 0.2
[people]
count = 2
activities = ["wave", "talk"]
[cameras]
count = 3
size = [200, 150]
[detector]
profile = "perfect"
[method]
variants = ["full", "appearance", "geometry"]
"""

FOUND = 'source = "network"\nnetwork = "people.onnx"\n'


@pytest.fixture
def scenario(tmp_path):
    def write(text, *, detector='profile = "perfect"'):
        path = tmp_path / "tiny.toml"
        path.write_text(BODY.replace('profile = "perfect"', detector) + text)
        return path

    return write


@pytest.mark.slow
def test_descriptors_are_read_from_the_pictures_and_stored(scenario, tmp_path):
    mean_color(tmp_path / "colors.onnx")
    path = scenario('[appearance]\nsource = "pictures"\nnetwork = "colors.onnx"\n')
    record = read_run(run(load(path), out=tmp_path / "runs"))
    assert sum(map(len, record.detections)) >= 10
    for detections in record.detections:
        np.testing.assert_allclose(np.linalg.norm(detections.descriptors, axis=1), 1.0)
    assert set(record.estimates) == {"full", "appearance", "geometry"}
    # One person's crops are of one colour, more or less, and not of the other's.
    detections, truth = record.detections[0], record.truth[0]
    same = truth.person[:, None] == truth.person
    distance = np.linalg.norm(detections.descriptors[:, None] - detections.descriptors, axis=-1)
    assert distance[same & ~np.eye(len(same), dtype=bool)].mean() < distance[~same].mean()


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_workers(scenario, tmp_path):
    mean_color(tmp_path / "colors.onnx")
    path = scenario('[appearance]\nsource = "pictures"\nnetwork = "colors.onnx"\n')
    one, two = (run(load(path), out=tmp_path / f"runs{workers}", workers=workers) for workers in (1, 2))
    assert (one / "detections.npz").read_bytes() == (two / "detections.npz").read_bytes()


@pytest.mark.slow
def test_keypoints_are_read_in_the_simulated_boxes(scenario, tmp_path):
    dots(tmp_path / "head.onnx")
    simulated = detected_frames(load(scenario(""), overrides=['method.variants=["full"]']))[1]
    changed = ['method.variants=["full"]', f"detector.onnx={tmp_path / 'head.onnx'}", "detector.heatmaps.size=64x48"]
    read = detected_frames(load(scenario(""), overrides=changed))[1]
    for before, after in zip(simulated, read, strict=True):
        np.testing.assert_array_equal(before.detections.boxes, after.detections.boxes)
        np.testing.assert_array_equal(before.truth.person, after.truth.person)
        assert after.detections.likelihoods is not None
        assert (after.detections.keypoints != before.detections.keypoints).any()
        # A head that returns the brightest pixel is nearly always wrong, and its errors are classified so.
        assert (after.truth.error > 0).mean() > 0.5


@pytest.mark.slow
def test_people_are_those_whom_a_network_finds(scenario, tmp_path):
    """A network that finds the true places in one picture in every picture is right there, and nowhere else."""
    full = ['method.variants=["full"]']
    simulated = detected_frames(load(scenario(""), overrides=full))[1]
    truth = simulated[0].truth
    view = int(np.isfinite(truth.pixels).all(axis=(1, 2, 3)).argmax())
    constant_people(tmp_path / "people.onnx", truth.pixels[view], (200, 150))
    found = detected_frames(load(scenario("", detector=FOUND), overrides=full))[1]
    people = len(truth.joints)
    for frame in found:
        assert np.bincount(frame.detections.view).tolist() == [people] * 3
        np.testing.assert_allclose(frame.detections.keypoints[:people], truth.pixels[view], atol=1e-3)
    first = found[0]
    here = first.detections.view == view
    assert first.truth.person[here].tolist() == list(range(people))
    inside = truth.visibility[view] != Visibility.OUTSIDE
    assert (first.truth.error[here][inside] == KeypointError.GOOD).all()
    assert (first.truth.error[~here] != KeypointError.GOOD).mean() > 0.8
    for before, after in zip(simulated, found, strict=True):  # everything else is the same
        np.testing.assert_array_equal(before.truth.pixels, after.truth.pixels)


@pytest.mark.slow
def test_people_in_the_boxes_of_a_network_are_those_on_whom_the_keypoints_of_a_head_lie(scenario, tmp_path):
    """A detector of boxes has no keypoints: only those of the head say whom a detection shows."""
    full = ['method.variants=["full"]']
    truth = detected_frames(load(scenario(""), overrides=full))[1][0].truth
    view = int(np.isfinite(truth.pixels).all(axis=(1, 2, 3)).argmax())
    constant_people(tmp_path / "yolox_boxes.onnx", truth.pixels[view], (200, 150), kind="boxes")
    dots(tmp_path / "head.onnx")
    boxes = 'source = "network"\nnetwork = "yolox_boxes.onnx"\nonnx = "head.onnx"'
    found = detected_frames(load(scenario("", detector=boxes), overrides=full))[1]
    assert all((frame.detections.scores > 0).any() for frame in found)
    assert any((frame.truth.person >= 0).any() for frame in found)


def test_a_trial_is_that_of_its_network(scenario, tmp_path):
    places = np.random.default_rng(0).uniform(20, 120, (2, 17, 2))
    identities = set()
    for shift in (0.0, 1.0, 0.0):
        constant_people(tmp_path / "people.onnx", places + shift, (200, 150))
        identities.add(trial_identity(load(scenario("", detector=FOUND))))
    assert len(identities) == 2


@pytest.mark.slow
def test_drawn_descriptors_stay_where_keypoints_are_read(scenario, tmp_path):
    dots(tmp_path / "head.onnx")
    path, head = scenario('[appearance]\nsource = "drawn"\n'), f"detector.onnx={tmp_path / 'head.onnx'}"
    simulated, read = (detected_frames(load(path, overrides=changed))[1] for changed in ([], [head]))
    for before, after in zip(simulated, read, strict=True):
        assert len(before.detections.descriptors)
        np.testing.assert_array_equal(before.detections.descriptors, after.detections.descriptors)
    record = read_run(run(load(path, overrides=[head]), out=tmp_path / "runs"))
    assert set(record.estimates) == {"full", "appearance", "geometry"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[appearance]\nsource = "pictures"\nnetwork = "none.onnx"\n', "appearance.network: .*none.onnx"),
        ('[appearance]\nsource = "pictures"\nnetwork = "tiny.toml"\n', "appearance.network: .*tiny.toml"),
        ("", 'appearance needs descriptors.*appearance.source = "pictures"'),
    ],
)
def test_mistakes_are_reported_before_any_work(scenario, text, message):
    with pytest.raises(ValueError, match=message):
        build_trial(load(scenario(text)))


def test_a_file_that_is_no_pose_head_is_named(scenario):
    with pytest.raises(ValueError, match=r"detector\.onnx: .*tiny.toml"):
        build_trial(load(scenario('[rendering]\nrenderer = "rays"\n'), overrides=["detector.onnx=tiny.toml"]))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("nobody", r"detector\.network: network 'nobody': no such file or name; `mvpose networks list`"),
        ("none.onnx", r"detector\.network: .*none\.onnx"),
        ("yolox_boxes.onnx", r"detector\.network: yolox_boxes\.onnx gives boxes alone; name a pose head"),
    ],
)
def test_a_network_that_finds_no_keypoints_is_named(scenario, tmp_path, given, message):
    constant_people(tmp_path / "yolox_boxes.onnx", np.full((1, 17, 2), 50.0), (200, 150), kind="boxes")
    path = scenario("", detector=f'source = "network"\nnetwork = "{given}"')
    with pytest.raises(ValueError, match=message):
        build_trial(load(path, overrides=['method.variants=["full"]']))


def test_sources_are_known(scenario):
    with pytest.raises(ScenarioError, match=r"appearance\.source"):
        load(scenario('[appearance]\nsource = "photos"\n'))
