"""Result folder of a run: written, read back, and the same bytes every time."""

import json

import numpy as np
import polars as pl
import pytest

from mvpose import Camera, Detections, Estimate, Matching, Rig
from simharness.scenario.sections.method_section import MethodSection
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.run_folder import Record, read_run, write_run
from simharness.types.truth import Truth

FRAMES, VIEWS = 5, 3


def make_record(*, people: int, empty: bool = False, seed: int = 0) -> Record:
    """Return a run of random numbers, with frames without detections and without estimates."""
    rng = np.random.default_rng(seed)
    rig = Rig([_camera(rng, f"cam{view}") for view in range(VIEWS)])
    detections, truth, estimates = [], [], []
    for frame in range(FRAMES):
        count = 0 if empty or frame == 2 else int(rng.integers(1, 6))
        scores = rng.random((count, 17))
        scores[scores < 0.2] = 0.0
        boxes = rng.random((count, 4))
        views = rng.integers(0, VIEWS, count)
        keypoints = rng.normal(size=(count, 17, 2))
        detections.append(Detections(views, keypoints, scores, boxes, rng.random(count)))
        truth.append(
            Truth(
                joints=rng.normal(size=(people, 17, 3)),
                pixels=rng.normal(size=(VIEWS, people, 17, 2)),
                visibility=rng.integers(0, 5, (VIEWS, people, 17)).astype(np.int8),
                boxes=rng.random((VIEWS, people, 4)),
                person=rng.integers(-1, people, count),
                error=rng.integers(0, 6, (count, 17)).astype(np.int8),
            )
        )
        estimates.append(_estimate(rng, count))
    return Record(
        scenario=Scenario(name="x", method=MethodSection(variants=("full",))),
        rig=rig,
        time=np.arange(FRAMES) / 10,
        detections=tuple(detections),
        truth=tuple(truth),
        estimates={"full": tuple(estimates)},
        scores=pl.DataFrame(
            {"variant": ["full"] * FRAMES, "frame": range(FRAMES), "errors_mm": [[1.5, None]] * FRAMES}
        ),
        summary={"name": "x", "variants": {"full": {"pcp": None}}},
    )


def _camera(rng: np.random.Generator, name: str) -> Camera:
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    return Camera(np.diag([500.0, 501.0, 1.0]), rotation, rng.normal(size=3), rng.normal(size=5), (640, 480), name)


def _estimate(rng: np.random.Generator, count: int) -> Estimate:
    people = int(rng.integers(0, count + 1))
    joints = rng.normal(size=(people, 17, 3))
    joints[rng.random((people, 17)) < 0.1] = np.nan
    matching = Matching(
        labels=rng.integers(-1, people, count),
        iterations=int(rng.integers(100)),
        residuals=(rng.random(), rng.random()),
        objective=rng.normal(),
        converged=bool(rng.integers(2)),
    )
    covariance = rng.normal(size=(people, 17, 3, 3))
    return Estimate(joints, rng.random((people, 17)), matching, covariance, {"matching": 0.25, "total": rng.random()})


def assert_same(a, b, fields):
    for field in fields:
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field), err_msg=field, strict=True)


@pytest.mark.parametrize(("people", "empty"), [(3, False), (0, True), (1, True)])
def test_a_run_is_read_as_it_was_written(tmp_path, people, empty):
    record = make_record(people=people, empty=empty)
    write_run(record, tmp_path)
    back = read_run(tmp_path)
    assert back.scenario == record.scenario
    assert back.summary == record.summary
    assert back.scores.equals(record.scores)
    np.testing.assert_array_equal(back.time, record.time)
    for one, other in zip(record.rig, back.rig, strict=True):
        assert_same(one, other, ("K", "R", "t", "distortion", "size", "name"))
    for one, other in zip(record.detections, back.detections, strict=True):
        assert_same(one, other, ("view", "keypoints", "scores", "boxes", "box_scores"))
        assert other.skeleton == one.skeleton
    for one, other in zip(record.truth, back.truth, strict=True):
        assert_same(one, other, ("joints", "pixels", "visibility", "boxes", "person", "error"))
    assert list(back.estimates) == list(record.estimates)
    for one, other in zip(record.estimates["full"], back.estimates["full"], strict=True):
        assert_same(one, other, ("joints", "scores", "covariance"))
        assert_same(one.matching, other.matching, ("labels",))
        for field in ("iterations", "residuals", "objective", "converged"):
            assert getattr(other.matching, field) == getattr(one.matching, field)
        assert other.timings == one.timings


def test_the_same_run_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_run(make_record(people=2), tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


@pytest.mark.parametrize("name", ["truth.npz", "summary.json", "scores.parquet"])
def test_a_folder_without_a_file_is_refused(tmp_path, name):
    write_run(make_record(people=1), tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(ValueError, match=f"not the result folder of a run: missing {name}"):
        read_run(tmp_path)


def test_a_summary_without_a_number_is_not_written(tmp_path):
    record = make_record(people=1)
    broken = Record(**{**vars(record), "summary": {"pcp": float("nan")}})
    with pytest.raises(ValueError, match="JSON"):
        write_run(broken, tmp_path)
    assert not (tmp_path / "summary.json").exists()


def test_the_summary_is_json(tmp_path):
    write_run(make_record(people=1), tmp_path)
    assert json.loads((tmp_path / "summary.json").read_text())["variants"]["full"]["pcp"] is None


def test_frames_must_agree():
    record = make_record(people=1)
    with pytest.raises(ValueError, match=r"an entry for each frame, got \[4, 5\]"):
        Record(**{**vars(record), "truth": record.truth[:-1]})
