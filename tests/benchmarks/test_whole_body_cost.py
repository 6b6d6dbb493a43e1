"""Benchmark of hands, face and feet: its people can be estimated, and its table has a time for each skeleton."""

import sys

import numpy as np

from benchmarks.method.scenes import ring
from benchmarks.whole_body.__main__ import detected, main, whole_people
from mvpose import COCO17, preset
from mvpose.wholebody import body_part, complete, skeleton_by_name


def test_the_people_of_the_benchmark_are_found_with_all_joints():
    rng, rig, skeleton = np.random.default_rng(3), ring(5, 4), skeleton_by_name("wholebody133")
    joints = whole_people(skeleton, 4, rng)
    detections = detected(rig, joints, skeleton, rng)
    people = complete(rig, detections, preset("fast").estimate(rig, body_part(detections)))
    assert len(people) == 4
    nearest = np.linalg.norm(people.joints[:, None] - joints, axis=-1).mean(axis=-1, where=np.isfinite(joints[..., 0]))
    true = joints[np.nanargmin(np.nan_to_num(nearest, nan=9.0), axis=1)]
    error = np.linalg.norm(people.joints - true, axis=-1)
    assert np.isfinite(error).mean() > 0.98
    assert np.nanmedian(error[:, len(COCO17) :]) < 0.03


def test_every_skeleton_has_a_row(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["whole_body", "--frames", "2", "--rounds", "1", "--people", "2"])
    main()
    rows = capsys.readouterr().out.splitlines()[2:]
    assert {row.split("|")[1].strip() for row in rows} == {"halpe26", "body25", "wholebody133", "openpose137"}
    assert all(float(row.split("|")[3]) > 0 for row in rows)
