"""Page of the doctor: residuals and lines of exact rigs are exact, and the page holds what was found."""

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from people import crowd, detect, ring
from scipy.spatial.transform import Rotation

from mvpose import COCO17, Rig
from mvpose.calibration.findings import Diagnosis, Finding
from mvpose.calibration.repair import Repair
from mvpose.calibration.sightings import Sightings
from mvpose.report.doctor_drawings import (
    Field,
    MatchedJoint,
    best_partner,
    distance_from_line,
    draw_field,
    epipolar_curve,
    exaggerated,
    matched_joints,
    motion_factor,
    nice_factor,
)
from mvpose.report.doctor_page import write_doctor_page
from mvpose.report.leave_one_out import leave_one_out, mean_field
from mvpose.report.verdict import quantities, sentence_of


def sighted(rig, *, frames=12, people=3, noise=0.0, offsets=None):
    """Sightings of people who walk by 5 cm a frame; a camera with an offset of its clock takes pictures later."""
    rng = np.random.default_rng(0)
    step, period = np.array([0.05, 0.02, 0.0]), 0.04
    offsets = np.zeros(len(rig)) if offsets is None else np.asarray(offsets)
    frame, view, person, joint = (index.ravel() for index in np.indices((frames, len(rig), people, 17)))
    late = (frame + offsets[view] / period)[:, None]
    points = crowd(people)[person, joint] + late * step
    pixels, ahead = np.empty((len(frame), 2)), np.empty((len(frame), 2))
    for number, camera in enumerate(rig):
        here = view == number
        pixels[here], ahead[here] = camera.project(points[here]), camera.project(points[here] + 1e-4 * step)
    velocity = (ahead - pixels) / (1e-4 * period)
    times = np.repeat(period * np.arange(frames)[:, None], len(rig), axis=1)
    pixels = pixels + noise * rng.standard_normal(pixels.shape)
    return Sightings(frame, view, person, joint, pixels, np.full(len(frame), 5.0), times, COCO17, velocity)


def moved(rig, view, *, degrees=0.0, metres=0.0):
    camera = rig[view]
    R = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])).as_matrix() @ camera.R
    center = camera.center + metres * np.array([0.0, 0.6, 0.8])
    other = replace(camera, R=R, t=-R @ center)
    return Rig([other if each is camera else each for each in rig])


class TestLeaveOneOut:
    def test_an_exact_rig_has_no_residuals(self):
        rig = ring(5, distortion=[-0.2, 0.05, 0.001, -0.001, 0.0])
        found = leave_one_out(rig, sighted(rig))
        np.testing.assert_allclose(found.offset, 0.0, atol=1e-5)

    def test_its_points_are_the_joints(self):
        rig = ring(4)
        sightings = sighted(rig, frames=1)
        np.testing.assert_allclose(
            leave_one_out(rig, sightings).point, crowd(3)[sightings.person, sightings.joint], atol=1e-7
        )

    def test_the_camera_that_moved_has_by_far_the_largest(self):
        rig = ring(5)
        wrong = moved(rig, 3, degrees=1.5)
        lengths = np.hypot(*leave_one_out(wrong, (sightings := sighted(rig))).offset.T)
        by_view = [np.median(lengths[sightings.view == view]) for view in range(5)]
        assert np.argmax(by_view) == 3
        assert by_view[3] == pytest.approx(800 * np.radians(1.5), rel=0.5)
        assert max(by_view[:3] + by_view[4:]) < by_view[3] / 4

    def test_a_late_clock_is_taken_out(self):
        rig, offsets = ring(4), np.array([0.0, 0.02, 0.0, 0.0])
        sightings = sighted(rig, offsets=offsets)
        late, right = (
            np.hypot(*leave_one_out(rig, sightings, offsets=each).offset.T)[sightings.view == 1]
            for each in (None, offsets)
        )
        assert np.median(late) > 3.0
        assert np.median(right) < 0.05

    def test_two_cameras_have_nothing_to_be_compared_with(self):
        rig = ring(3)
        pair = Rig(rig.cameras[:2])
        assert np.isnan(leave_one_out(pair, sighted(pair)).offset).all()

    def test_the_field_is_the_median_of_each_cell(self):
        rng = np.random.default_rng(3)
        pixels, offset = rng.uniform([0, 0], [400, 300], (900, 2)), rng.normal(size=(900, 2))
        offset[5] = np.nan
        places, medians = mean_field(pixels, offset, size=(400, 300), columns=4, least=20)
        cells = {}
        for pixel, each in zip(pixels, offset, strict=True):
            if np.isfinite(each).all():
                cells.setdefault(tuple(((pixel + 0.5) // 100).astype(int))[::-1], []).append(each)
        expected = [np.median(cells[key], axis=0) for key in sorted(cells) if len(cells[key]) >= 20]
        np.testing.assert_allclose(medians, expected)
        assert places.shape == medians.shape


class TestEpipolarLines:
    @pytest.mark.parametrize("distortion", [None, [-0.25, 0.08, 0.002, -0.001, 0.0]])
    def test_a_joint_lies_on_its_line(self, distortion):
        rig = ring(4, distortion=distortion)
        for joint in crowd(2)[0]:
            seen = MatchedJoint(0, rig[0].project(joint), rig[1].project(joint), "joint")
            assert distance_from_line(rig[0], rig[1], seen) < 0.05

    def test_the_distance_is_that_from_the_line_of_the_fundamental_matrix(self):
        rig = ring(4)
        first, second = rig[0].project(crowd(1)[0, 9]), rig[1].project(crowd(1)[0, 9]) + [12.0, -7.0]
        line = rig.F[0, 1] @ np.append(first, 1.0)
        expected = abs(line @ np.append(second, 1.0)) / np.hypot(line[0], line[1])
        assert distance_from_line(rig[0], rig[1], MatchedJoint(0, first, second, "")) == pytest.approx(
            expected, abs=1e-3
        )

    def test_a_curve_ends_where_the_second_camera_sees_nothing(self):
        rig = ring(4)
        curve = epipolar_curve(rig[0], rig[2], np.array([640.0, 480.0]))
        assert np.isnan(curve[-1]).all()  # behind the opposite camera
        assert np.isfinite(curve[0]).all()

    def test_joints_are_of_one_frame_and_of_both_views(self):
        rig = ring(4)
        sightings = sighted(rig)
        found = matched_joints(sightings, (0, 2), rig)
        assert len({joint.frame for joint in found}) == 1
        assert len(found) == 6
        assert not {"left hip", "right hip"} & {joint.name for joint in found}
        for joint in found:
            assert distance_from_line(rig[0], rig[2], joint) < 0.05

    def test_the_partner_sees_the_same_people(self):
        rig = ring(4)
        sightings = sighted(rig)
        alone = sightings.select((sightings.view != 1) | (sightings.frame > 8))
        assert best_partner(alone, 0, rig) in (2, 3)
        assert best_partner(sightings.select(sightings.view == 0), 0, rig) is None


class TestExaggeration:
    def test_factors_are_nice_and_never_too_large(self):
        for factor in np.geomspace(0.1, 5000, 60):
            found = nice_factor(factor)
            assert found == 1.0 or found <= factor < 2.5 * found + 1e-9
            assert f"{found:g}"[0] in "125"

    def test_a_factor_of_one_is_the_repaired_camera(self):
        rig = ring(4)
        other = moved(rig, 0, degrees=3.0, metres=0.1)
        np.testing.assert_allclose(exaggerated(rig[0], other[0], 1.0).P, other[0].P, atol=1e-9)
        ten = exaggerated(rig[0], other[0], 10.0)
        np.testing.assert_allclose(np.linalg.norm(ten.center - rig[0].center), 1.0)
        assert Rotation.from_matrix(ten.R @ rig[0].R.T).magnitude() == pytest.approx(np.radians(30.0))
        assert motion_factor(rig, other) in (5.0, 2.0)


def made_repair(rig, corrections=None, refused=None):
    """A repair that turned and moved cameras by ``corrections``, (V, 6)."""
    views = len(rig)
    corrections = np.zeros((views, 6)) if corrections is None else corrections
    covariance = np.tile(1e-6 * np.eye(6), (views, 1, 1)) * (np.abs(corrections).max(axis=1) > 0)[:, None, None]
    nothing = np.zeros(views)
    clocks = dict(offsets=nothing, offset_sigmas=nothing, focal=np.ones(views), center=np.zeros((views, 2)))
    residuals = dict(residuals_before=nothing, residuals_after=nothing)
    return Repair(
        rig,
        corrections=corrections,
        covariance=covariance,
        held=("clocks",),
        refused=refused,
        people=3,
        **clocks,
        **residuals,
    )


def finding(**changes):
    given = dict(
        kind="moved-camera", text="camera <2> has moved", camera="cam2", view=2, size={"degrees": 2.0, "metres": 0.05},
        interval={"metres": (0.04, 0.06)}, cost=0.03, mend="look at it", repair=("--free", "extrinsics"),
    )  # fmt: skip
    return Finding(**{**given, **changes})


def page_of(folder, rig, sightings, findings, repair=None):
    diagnosis = Diagnosis.of_findings(
        findings, evidence=["a line"], cameras=[c.name for c in rig], residuals=np.zeros(len(rig))
    )
    given = dict(
        diagnosis=diagnosis, repair=repair, command=lambda options: " ".join(["mvpose repair a.json b", *options])
    )
    path = write_doctor_page(folder, name="a rig", rig=rig, frames=[], sightings=sightings, **given)
    page = path.read_text(encoding="utf-8")
    for svg in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        ET.fromstring(svg.replace("xlink:", ""))
    assert not re.search(r"<script|<link|@import|url\((?!#)", page)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    return page, json.loads((folder / "doctor.json").read_text())


class TestPage:
    @pytest.mark.slow
    def test_residuals_are_those_of_the_diagnosis(self, tmp_path):
        """One quantity has one value, in the words of the doctor and in the table and the pictures of its page."""
        rig, own = ring(4), np.array([11.1, 22.2, 43.9, 14.4])
        diagnosis = Diagnosis.of_findings(
            [finding()], evidence=[], cameras=[c.name for c in rig], residuals=own, usual=np.full(4, 10.0)
        )
        given = dict(name="a rig", rig=rig, frames=[], sightings=sighted(rig, noise=1.0), diagnosis=diagnosis)
        page = write_doctor_page(tmp_path, **given).read_text(encoding="utf-8")
        for value in own:
            assert f">{value:.1f}</td>" in page
            assert f"median {value:.1f} px" in page
        files = replace(diagnosis, findings=(finding(repair=("--mend", "inverted")),))  # other files were examined then
        page = write_doctor_page(tmp_path, **{**given, "diagnosis": files}).read_text(encoding="utf-8")
        assert ">43.9</td>" not in page

    @pytest.mark.parametrize("size", [(640, 480), (1045, 773), (1920, 1080), (1080, 1920)])
    def test_arrows_are_seen_on_a_wide_screen(self, size):
        """Pictures are at least 336 px wide there, and a line of less than one pixel is hardly seen."""
        camera = replace(ring(3)[0], size=size)
        (drawn,) = draw_field(camera, Field(np.full((1, 2), 300.0), np.full((1, 2), 40.0)), kind="before", factor=1.0)
        (width,) = re.findall(r'stroke-width="([\d.]+)"', drawn)
        assert float(width) * 336 / size[0] >= 1.0

    def test_before_and_after(self, tmp_path):
        rig = ring(5)
        wrong = moved(rig, 2, degrees=2.0, metres=0.05)
        corrections = np.zeros((5, 6))
        corrections[2] = [0.02, 0, 0.028, 0, -0.03, -0.04]
        repair = made_repair(rig, corrections)
        page, numbers = page_of(tmp_path, wrong, sighted(rig, noise=1.0), [finding()], repair)
        assert "Camera &lt;2&gt; has moved." in page
        assert "4.0 to 6.0" in page  # cm
        assert "5.0 cm ± 0.2" in page
        assert 'class="field after"' in page
        assert 'class="line after"' in page
        assert "mvpose repair a.json b --free extrinsics" in page
        assert numbers["findings"][0]["kind"] == "moved-camera"
        assert "held" in page
        assert numbers["repair"]["refused"] is None

    def test_what_was_refused_is_stated_and_nothing_is_drawn_after(self, tmp_path):
        rig = ring(4)
        repair = made_repair(rig, refused="nobody moved")
        page, _ = page_of(tmp_path, rig, sighted(rig), [finding(kind="cannot-tell", severity="unknown")], repair)
        assert "nobody moved" in page
        assert "cannot tell" in page
        assert 'class="field after"' not in page

    def test_a_rig_without_faults(self, tmp_path):
        rig = ring(4)
        page, numbers = page_of(tmp_path, rig, sighted(rig, noise=2.0), [])
        assert "Nothing is wrong with the cameras." in page
        assert "Findings" not in page
        assert numbers["verdict"] == "fine"

    def test_without_anybody(self, tmp_path):
        rig = ring(4)
        page, _ = page_of(tmp_path, rig, sighted(rig).select(np.zeros(0, int)), [])
        assert "No joint was seen by two cameras at once" in page

    def test_clocks_are_plotted_where_they_are_off(self, tmp_path):
        rig = ring(4)
        late = finding(kind="clock-offset", size={"ms": 12.0}, interval={"ms": (8.0, 17.0)}, mend="", severity="note")
        page, _ = page_of(tmp_path, rig, sighted(rig), [late])
        assert "<h3>Clocks</h3>" in page
        assert "12.0 ms" in page
        assert "8.0 to 17.0" in page


def test_sizes_are_shown_in_units_that_people_use():
    shown = {
        each.name: (each.value, each.interval)
        for each in quantities(
            finding(
                size={"degrees": 1.234, "metres": 0.0512, "since_s": 4.0, "pictures": 3.0, "scale_percent": 2.5},
                interval={"metres": (0.04, 0.0612), "degrees": (1.0, np.inf)},
            )
        )
    }
    assert shown["angle"] == ("1.23°", "1.00 to ∞")
    assert shown["distance"] == ("5.1 cm", "4.0 to 6.1")
    assert shown["since"] == ("4.0 s", "")
    assert shown["scale"] == ("2.5 %", "")
    assert ("3 pictures", "") in shown.values()


@pytest.mark.parametrize(
    ("text", "name", "expected"),
    [
        ("2 looks elsewhere", "2", "Camera 2 looks elsewhere."),
        ("cam2 looks elsewhere.", "cam2", "Camera cam2 looks elsewhere."),
        ("camera 2 looks elsewhere", "camera 2", "Camera 2 looks elsewhere."),
        ("the unit is wrong", None, "The unit is wrong."),
    ],
)
def test_findings_are_sentences(text, name, expected):
    assert sentence_of(finding(text=text, camera=name)) == expected


def test_sightings_are_matched_where_none_are_given(tmp_path):
    rig = ring(4)
    frames = [detect(rig, crowd(1) + k * np.array([0.05, 0, 0]), noise=1.0, seed=k)[0] for k in range(20)]
    diagnosis = Diagnosis.of_findings([], evidence=[], cameras=[c.name for c in rig], residuals=np.zeros(4))
    path = write_doctor_page(tmp_path, name="a rig", rig=rig, frames=frames, diagnosis=diagnosis)
    assert 'class="line before"' in path.read_text(encoding="utf-8")
