"""BVH files of tracked simulated people: their joints lie at those of the tracks, and nearer to the true ones."""

import numpy as np
import pytest

import simharness
from mvpose import COCO17, preset
from mvpose.formats.joint_names import canonical
from mvpose.formats.people import write_people
from mvpose.recording import People
from simharness.world.motion.mocap.bvh import read_bvh

_NODES = {"shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand", "hip": "UpLeg", "knee": "Leg", "ankle": "Foot"}


def node_of(joint):
    """Name of the node at a joint of COCO17."""
    side, _, part = joint.partition("_")
    return side.capitalize() + _NODES[part] if part in _NODES else joint


@pytest.mark.slow
def test_joints_of_the_files(tmp_path):
    scenario = simharness.load_scenario(
        "quickstart", overrides=["duration=0.8", "rate=25", "people.count=2", 'rendering.renderer="rays"']
    )
    recording = simharness.simulate(scenario)
    tracks = preset("track-fast", period=0.04).track(recording.rig, recording.detections)
    people = People.of_estimates(tracks, COCO17, 0.04)
    paths = {path.stem: path for path in write_people(people, tmp_path, formats=["bvh"])}
    distances, errors, errors_before = [], [], []
    truth = np.stack([frame.joints for frame in recording.truth])
    for row, identity in enumerate(people.ids.tolist()):
        if f"person_{identity}" not in paths:
            continue
        motion = read_bvh(paths[f"person_{identity}"])
        assert motion.rate == 25.0
        names = [canonical(name) for name in motion.skeleton.names]
        rows = [names.index(canonical(node_of(joint))) for joint in COCO17.joints]
        places, _ = motion.pose()
        joints = places[:, rows][..., [2, 0, 1]] / 100  # centimetres with y up
        estimated = people.joints[:, row]
        distances.append(np.linalg.norm(joints - estimated, axis=-1))
        true = truth[:, np.nanmean(np.linalg.norm(truth - estimated[:, None], axis=-1), axis=(0, 2)).argmin()]
        known = people.present[:, row]
        errors.append(np.linalg.norm(joints - true, axis=-1)[known])
        errors_before.append(np.linalg.norm(estimated - true, axis=-1)[known])
    assert len(distances) == 2
    assert np.nanmedian(distances) < 0.01
    assert np.concatenate(errors).mean() < np.concatenate(errors_before).mean()
