"""``mvpose estimate`` of long recordings: in parts on disk, with the results of the whole, also after a kill."""

import functools
import json

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lab_files import filmed, write_mmpose
from typer.testing import CliRunner

from mvpose import Detections, preset
from mvpose.cli import estimation
from mvpose.cli.app import app
from mvpose.cli.inputs import Choices, read_inputs
from mvpose.formats.calibration import pose2sim
from mvpose.formats.detections import recorded_frames
from mvpose.formats.people import people_parts, read_people
from mvpose.formats.people.filters import filtered
from mvpose.formats.people.outliers import OutputLimits, within_limits
from mvpose.formats.people.people_parts import PeopleParts
from mvpose.recording import People

FRAMES = 40
FORMATS = "trc,csv,c3d,panoptic,npz,lengths,mot,angles"


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Two people, of whom one is away for some frames, with keypoints that jump now and then."""
    folder = tmp_path_factory.mktemp("lab")
    rig, _, pixels = filmed(frames=FRAMES, noise=2.0)
    pixels[12:24, :, 1] = np.nan
    pixels[30, :, 0, 9] += 400.0
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    folder.joinpath("dets").mkdir()
    for view, camera in enumerate(rig):
        write_mmpose(folder / "one", [camera.name], pixels[:, [view]])
        frames = json.loads((folder / "one" / f"{camera.name}.json").read_text())
        for frame in frames:
            frame["instances"] = [each for each in frame["instances"] if np.isfinite(each["keypoints"]).all()]
        (folder / "dets" / f"{camera.name}.json").write_text(json.dumps(frames))
    return folder


def estimate(lab, out, *options):
    words = ["estimate", lab / "Calib.toml", lab / "dets", "--out", out, "--fps", 25, "--no-doctor", *options]
    return CliRunner().invoke(app, list(map(str, words)))


@pytest.fixture(scope="module")
def whole(lab, tmp_path_factory):
    """Return a function that gives the folder of an estimation in one piece, made once for all options."""

    @functools.cache
    def made(*options):
        out = tmp_path_factory.mktemp("whole") / "out"
        assert estimate(lab, out, *options).exit_code == 0
        return out

    return made


@pytest.fixture
def in_parts(monkeypatch):
    """Return a function that makes recordings long from a few frames on, with parts of some frames."""

    def change(frames):
        monkeypatch.setattr(recorded_frames, "IN_MEMORY", 3)
        monkeypatch.setattr(people_parts, "FRAMES", frames)
        monkeypatch.setattr(estimation, "FRAMES", frames)

    return change


def content(folder):
    """All files but those that state the command, and pages, which show every n-th frame of a long recording."""
    left_out = ("inputs.json", ".written", "recording.html", "recording.json")
    return {
        each.relative_to(folder).as_posix(): each.read_bytes()
        for each in sorted(folder.rglob("*"))
        if each.is_file() and each.name not in left_out
    }


@pytest.mark.parametrize("method", ["track", "fast"])
@pytest.mark.parametrize("size", [7, *(pytest.param(size, marks=pytest.mark.slow) for size in (1, 39))])
def test_files_of_parts_are_those_of_the_whole(lab, tmp_path, in_parts, whole, method, size):
    options = ("--format", FORMATS, "--method", method)
    expected = whole(*options)
    in_parts(size)
    result = estimate(lab, tmp_path / "parts", *options)
    assert result.exit_code == 0, result.output
    files, parts = content(expected), content(tmp_path / "parts")
    tables = [each.pop("poses.parquet") for each in (files, parts)]
    assert pl.read_parquet(tables[0]).equals(pl.read_parquet(tables[1]))
    archives = [read_people(each / "people.npz") for each in (expected, tmp_path / "parts")]
    np.testing.assert_array_equal(archives[0].joints, archives[1].joints)
    assert set(files) == set(parts)
    for name in set(files) - {"people.npz"}:
        assert files[name] == parts[name], name
    about = [json.loads((each / "inputs.json").read_text()) for each in (expected, tmp_path / "parts")]
    for key in ("fps", "numbers", "people", "left_out"):
        assert about[0][key] == about[1][key]
    assert (tmp_path / "parts" / "recording.html").is_file()
    assert not list(tmp_path.glob(".*"))


class Killed(BaseException):
    """What a killed process is to the code: no handler of errors takes it."""


@pytest.mark.parametrize(("method", "lag"), [("track", 0.2), ("track", 0.0), ("track-fast", 0.5), ("full", 0.2)])
@pytest.mark.parametrize("killed", [17, *(pytest.param(at, marks=pytest.mark.slow) for at in (0, 9, 34, FRAMES - 1))])
def test_a_killed_estimation_goes_on_with_the_same_bytes(
    lab, tmp_path, in_parts, whole, monkeypatch, method, lag, killed
):
    options = ("--method", method, "--no-page", *(("--lag", lag) if "track" in method else ()))
    expected = whole(*options)
    in_parts(8)
    made = recorded_frames.RecordedFrames.frame
    asked = []

    def frame(self, row, times):
        if row == killed:
            raise Killed
        asked.append(row)
        return made(self, row, times)

    monkeypatch.setattr(recorded_frames.RecordedFrames, "frame", frame)
    with pytest.raises(Killed):
        estimate(lab, tmp_path / "again", *options)
    assert not (tmp_path / "again").exists()
    monkeypatch.setattr(
        recorded_frames.RecordedFrames, "frame", lambda self, *row: asked.append(row[0]) or made(self, *row)
    )
    asked.clear()
    result = estimate(lab, tmp_path / "again", *options)
    assert result.exit_code == 0, result.output
    parts = (killed - round(25 * lag) * ("track" in method)) // 8  # whose estimates had been given
    if parts > 0:
        assert f"goes on from frame {8 * parts} of {FRAMES}" in result.stderr
        assert min(set(asked) - {0}) >= 8 * parts  # frame 0 tells the skeleton
    assert content(tmp_path / "again") == content(expected)
    assert not list(tmp_path.glob(".*"))


@pytest.mark.slow
def test_parts_of_other_detections_or_of_another_method_are_not_used(lab, tmp_path, in_parts, monkeypatch):
    in_parts(8)
    monkeypatch.setattr("mvpose.cli.results.write_results", lambda *_, **__: (_ for _ in ()).throw(Killed))
    with pytest.raises(Killed):
        estimate(lab, tmp_path / "out", "--method", "fast")
    monkeypatch.undo()
    in_parts(8)
    assert (tmp_path / ".out.parts").is_dir()
    for options in (("--method", "full"), ("--method", "fast", "--cameras", "cam0,cam1,cam2")):
        result = estimate(lab, tmp_path / "out", *options)
        assert result.exit_code == 0, result.output
        assert "goes on" not in result.stderr


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(size=st.integers(1, 45), lag=st.sampled_from([0.0, 0.04, 0.2, 0.7, np.inf]), all_=st.booleans())
def test_people_of_parts_are_those_of_the_whole(lab, tmp_path_factory, size, lag, all_):
    inputs = read_inputs(lab / "Calib.toml", [lab / "dets"], Choices(fps=25.0))
    method = preset("track", lag=lag, period=inputs.period)
    whole = People.of_estimates(method.track(inputs.rig, inputs.frames), period=inputs.period)
    limits = OutputLimits(max_error=np.inf if all_ else 0.03, min_frames=1 if all_ else 15)
    limited, left_out = within_limits(whole, limits)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimation, "FRAMES", size)
        parts = estimation.estimate_people(inputs, method, tmp_path_factory.mktemp("parts"))
    for expected in (whole, limited):
        if expected is limited:
            assert parts.limit(limits).to_json() == left_out.to_json()
        for people in (parts.whole(), *(parts.whole(rows=np.arange(3, FRAMES, 5)),)):
            rows = people.numbers
            assert people.ids.tolist() == expected.ids.tolist()
            np.testing.assert_array_equal(people.times, expected.times[rows])
            np.testing.assert_array_equal(people.joints, expected.joints[rows])
            np.testing.assert_array_equal(people.scores, expected.scores[rows])
            if len(people):
                np.testing.assert_array_equal(people.covariance, expected.covariance[rows])
    assert [each["id"] for each in parts.spans] == limited.ids.tolist()
    parts.change(lambda person: filtered(person, "butterworth", 3.0))
    smooth, rows = filtered(limited, "butterworth", 3.0).joints, np.arange(3, FRAMES, 5)
    assert not len(limited) or not np.array_equal(smooth, limited.joints, equal_nan=True)
    np.testing.assert_array_equal(parts.whole().joints, smooth)
    np.testing.assert_array_equal(parts.whole(rows=rows).joints, smooth[rows])


def test_nobody_at_all(tmp_path):
    parts = PeopleParts(tmp_path, preset("full").reconstruction and Detections.empty().skeleton, 0.04, tracked=True)
    assert parts.limit(OutputLimits()).sentences() == []
    assert (parts.whole().frames, len(parts.ids), parts.spans) == (0, 0, [])
