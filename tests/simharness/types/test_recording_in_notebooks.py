"""What a notebook shows of a recording."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
from moments import crowd, moment, recorded, ring

from mvpose import Rig


def test_a_notebook_shows_the_cameras_with_their_numbers_and_the_people():
    rig = Rig([replace(camera, name=f"<b>{camera.name}") for camera in ring(3)])
    seen, truth = moment(rig, crowd(2, spacing=1.2))
    absent = replace(
        truth, joints=np.full_like(truth.joints, np.nan), person=np.where(seen.view == 1, -1, truth.person)
    )
    shown = recorded(rig, (seen, truth), (seen, absent), (seen.select(seen.view != 2), _without(truth, seen.view == 2)))
    html = shown._repr_html_()
    counts = re.findall(r"<th>&lt;b&gt;(\w+)<td>(\d+)<td>(\d+)", html)
    assert counts == [
        (camera.name[3:], *pair) for camera, pair in zip(rig, [("6", "0"), ("6", "2"), ("4", "0")], strict=True)
    ]
    assert "<b>3 frames in" in html
    assert "2 people, 3 cameras" in html
    plot = ElementTree.fromstring(re.search(r"<svg.*</svg>", html, re.DOTALL)[0])
    assert len(plot.findall(".//{http://www.w3.org/2000/svg}path")) > 10
    assert shown._repr_html_() == html


def _without(truth, left_out):
    return replace(truth, person=truth.person[~left_out], error=truth.error[~left_out])
