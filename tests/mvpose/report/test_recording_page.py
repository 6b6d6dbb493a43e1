"""Page of a recording: one file without references, whatever the recording holds; its numbers are those of JSON."""

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from synthetic_recording import recording

from mvpose import Detections, Rig
from mvpose.calibration.findings import Diagnosis, Finding
from mvpose.recording import People
from mvpose.report.recording_page import write_page


def page_of(folder, rig, frames, people, **options):
    path = write_page(folder, name="a recording", people=people, rig=rig, frames=frames, **options)
    return path.read_text(encoding="utf-8"), json.loads((folder / "recording.json").read_text())


def drawings(page):
    return re.findall(r"<svg.*?</svg>", page, re.DOTALL)


def self_contained(page):
    """No script, and no address of another file, except links to pages beside it and namespaces."""
    page = re.sub(r'xmlns(:xlink)?="[^"]*"', "", page)
    return not re.search(r"<script|<link|@import|https?://|url\((?!#)", page)


def test_the_page_is_one_file_of_well_formed_drawings(tmp_path):
    page, _ = page_of(tmp_path, *recording(3, noise=2.0))
    assert self_contained(page)
    assert len(drawings(page)) == 3 + 3 + 3 * 4  # plots, key, views of frames
    for svg in drawings(page):
        ET.fromstring(svg.replace("xlink:", ""))
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["recording.html", "recording.json"]


def test_the_numbers_of_perfect_people(tmp_path):
    _, numbers = page_of(tmp_path, *recording(2, frames=8))
    assert numbers["residual_px"] == pytest.approx(0.0, abs=1e-6)
    assert numbers["joints_on_one_view"] == 0.0
    assert [person["id"] for person in numbers["people"]] == [3, 4]
    assert [person["median_views"] for person in numbers["people"]] == [4, 4]
    assert list(numbers["cameras"]) == ["cam0", "cam1", "cam2", "cam3"]


def test_names_are_escaped(tmp_path):
    rig, frames, people = recording(1, frames=2)
    rig = Rig([replace(camera, name=f"<b>&{view}$x$") for view, camera in enumerate(rig)])
    page, numbers = page_of(tmp_path, rig, frames, people)
    assert "<b>&0" not in page
    for svg in drawings(page):
        ET.fromstring(svg.replace("xlink:", ""))
    assert next(iter(numbers["cameras"])) == "<b>&0$x$"


@pytest.mark.slow
def test_of_many_people_those_who_are_there_longest_have_columns_of_their_own(tmp_path):
    rig, frames, people = recording(11, frames=4)
    joints = people.joints.copy()
    joints[2:, [0, 4, 7]] = np.nan  # numbers 3, 7 and 10 leave
    sigmas = 0.01 * np.arange(1, 12)
    covariance = np.broadcast_to((sigmas**2)[:, None, None, None] * np.eye(3), people.covariance.shape)
    page, _ = page_of(tmp_path, rig, frames, replace(people, joints=joints, covariance=covariance))
    (heads,) = re.findall(r'<th scope="col">joint</th>(.*?)</tr>', page.split("Error of joints")[1])
    assert [int(number) for number in re.findall(r"</span>(\d+)</th>", heads)] == [4, 5, 6, 8, 9, 11, 12, 13]
    (total,) = re.findall(r'<th scope="row">all joints</th>(.*?)</tr>', page)
    errors = np.array([float(number) for number in re.findall(r">(\d+)</td>", total)])
    kept = sigmas[[1, 2, 3, 5, 6, 8, 9, 10]]
    np.testing.assert_allclose(errors / errors[0], kept / kept[0], rtol=0.03)  # whole millimetres
    assert "Of 11 people the 8 who are there longest." in page


@pytest.mark.slow
@pytest.mark.parametrize("people", ["nobody", "no detections", "no covariance", "one frame", "a person without hips"])
def test_any_recording_has_a_page(tmp_path, people):
    rig, frames, found = recording(2, frames=5)
    if people == "nobody":
        found = People(found.times, np.zeros(0, int), found.joints[:, :0], found.scores[:, :0])
    elif people == "no detections":
        frames = [Detections.empty()] * 5
    elif people == "no covariance":
        found = replace(found, covariance=None)
    elif people == "one frame":
        frames = frames[:1]
        found = People(found.times[:1], found.ids, found.joints[:1], found.scores[:1])
    else:
        joints = found.joints.copy()
        joints[:, 1, 5:] = np.nan
        found = replace(found, joints=joints)
    page, _ = page_of(tmp_path, rig, frames, found)
    assert self_contained(page)
    assert ("Nobody was found" in page) == (people == "nobody")
    assert ("Expected error" in page) == (people in ("no detections", "a person without hips"))
    text = re.sub(r"<(svg|style).*?</\1>", "", page, flags=re.DOTALL)
    assert not re.search(r"\bnan\b", text)


def test_pictures_are_embedded_below_the_drawings(tmp_path):
    rig, frames, people = recording(1, frames=1)
    asked = []

    def pictures(frame, view):
        asked.append((frame, view))
        return np.full((96, 128, 3), 60 * view, np.uint8) if view else None

    page, _ = page_of(tmp_path, rig, frames, people, pictures=pictures)
    assert [view for _, view in asked] == [0, 1, 2, 3]
    assert page.count("data:image/jpeg;base64,") == 3
    assert self_contained(page)


def test_the_verdict_stands_in_plain_words(tmp_path):
    moved = Finding(
        "moved-camera", "camera cam2 has moved by 5 cm", camera="cam2", view=2, size={"degrees": 1.1, "metres": 0.05}
    )
    diagnosis = Diagnosis.of_findings([moved], evidence=["rays miss by 4 px"], cameras=["a"], residuals=np.array([4.0]))
    page, numbers = page_of(tmp_path, *recording(1), diagnosis=diagnosis)
    assert "Camera cam2 has moved by 5 cm." in page
    assert numbers["doctor"]["verdict"] == "faults"


def test_without_frames_there_is_no_page(tmp_path):
    rig, _, people = recording(1)
    with pytest.raises(ValueError, match="at least one frame"):
        write_page(tmp_path, name="x", people=people, rig=rig, frames=[])


def test_a_verdict_that_is_open_says_why(tmp_path):
    short = Finding("cannot-tell", "cannot tell: people were seen for 2 s only", "unknown", 1.0, mend="record more")
    diagnosis = Diagnosis.of_findings([short], evidence=["90 joints"], cameras=["a"], residuals=np.array([4.0]))
    page, _ = page_of(tmp_path, *recording(1), diagnosis=diagnosis)
    assert "does not determine whether the cameras are right" in page
    assert "<li>Cannot tell: people were seen for 2 s only.</li>" in page
