"""Exports of a scene whose people come and go."""

from __future__ import annotations

import json

import numpy as np

from mvpose.formats.people import read_people
from simharness import load_scenario
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence


def test_an_absent_person_has_no_body_in_the_frame_and_undefined_joints_in_the_truth(tmp_path):
    scenario = load_scenario(
        "passage",
        overrides=[
            'people.activities=["stand", "visit"]',
            "people.count=2",
            "people.traffic.entering=0",
            "people.traffic.leaving=0",
            "duration=5",
            "rate=4",
            "cameras.count=2",
            'rendering.renderer="rays"',
        ],
    )
    folder = export_sequence(scenario, ExportPlan(tmp_path / "out", pictures=False), command="test")
    files = sorted((folder / "hdPose3d_stage1_coco19").glob("body3DScene_*.json"))
    here = [{body["id"] for body in json.loads(file.read_text())["bodies"]} for file in files]
    assert here[0] == {0}
    assert {0, 1} in here
    truth = read_people(folder / "truth.npz").joints
    defined = np.isfinite(truth).all(axis=(2, 3))
    assert [{int(person) for person in np.flatnonzero(row)} for row in defined] == here
