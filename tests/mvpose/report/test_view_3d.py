"""3D views of a page: the data of the script, and the still drawing."""

import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mvpose import Camera
from mvpose.report.view_3d import Piece3D, Scene3D, Shape3D, Style3D, camera_pyramid, loop, prism, view_3d

SQUARE = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])


def scene(*fixed, **changes):
    points = np.concatenate([piece.points for piece in fixed])
    return Scene3D(**{"label": "A <scene>", "center": points.mean(axis=0), "fitted": points, "fixed": fixed} | changes)


def still(shown):
    return ET.fromstring(view_3d(shown).still)


def corners(element):
    return np.array(re.findall(r"-?\d+\.?\d*", element.get("d")), float).reshape(-1, 2)


def test_points_are_whole_millimetres_and_null_where_unknown():
    points = np.array([[0.0004, 1.2346, -2.0], [np.nan, 0.0, 0.0]])
    shown = scene(Piece3D(points, Shape3D(lines=((0, 1),)), Style3D("--ink")), center=np.zeros(3))
    data = json.loads(view_3d(shown).json)
    assert data["fixed"] == [[0, 0, [[0, 1235, -2000], None]]]


def test_shapes_and_styles_are_written_once():
    piece = Piece3D(SQUARE, prism(2), Style3D("#112233"))
    data = view_3d(scene(piece, piece, frames=((piece,), (piece,)), times=(0.0, 0.1))).data
    assert len(data["shapes"]) == len(data["styles"]) == 1
    assert [each[:2] for each in [*data["fixed"], *data["frames"][0], *data["frames"][1]]] == [[0, 0]] * 4


def test_the_data_cannot_end_its_script():
    piece = Piece3D(SQUARE, prism(2), Style3D("--ink"))
    assert "<" not in view_3d(scene(piece, names=[("</script>", SQUARE[0])])).json


def test_everything_fits_into_the_still_drawing_and_touches_its_edge_from_some_side():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(40, 3)) * [3.0, 1.0, 0.5]
    balls = Shape3D(lines=tuple((k, k + 1) for k in range(39)))
    (path,) = still(scene(Piece3D(points, balls, Style3D("--ink")))).iter("path")
    at = corners(path)
    assert (at >= 7.9).all()
    assert (at <= [712.1, 532.1]).all()
    assert np.ptp(at[:, 0]) > 250


def test_the_still_drawing_is_a_perspective_picture():
    """Pixels of the drawing are those of some pinhole camera: a homography on a plane, with parallels that converge."""
    grid = np.array([[x, y, 0.0] for x in range(5) for y in range(5)])
    lines = Shape3D(lines=tuple((k, k + 1) for k in range(24)))
    (path,) = still(scene(Piece3D(grid, lines, Style3D("--ink")))).iter("path")
    starts = np.vstack([corners(path)[::2], corners(path)[-1:]])
    rows = []
    for (x, y, _), (u, v) in zip(grid, starts, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y, -u], [0, 0, 0, x, y, 1, -v * x, -v * y, -v]]
    *_, homography = np.linalg.svd(np.array(rows))
    again = np.column_stack([grid[:, :2], np.ones(25)]) @ homography[-1].reshape(3, 3).T
    np.testing.assert_allclose(again[:, :2] / again[:, 2:], starts, atol=0.15)


def test_nearer_bodies_are_broader_and_drawn_later():
    ball = Shape3D(bodies=(((0,), 0.1),))
    places = [np.array([[2.0, -2.0, 0.0]]), np.array([[-2.0, 2.0, 0.0]])]  # the eye is at the right and in front
    drawn = list(still(scene(*(Piece3D(place, ball, Style3D("#808080")) for place in places))).iter("path"))
    widths = [float(path.get("stroke-width")) for path in drawn]
    assert len(widths) == 4
    assert widths[2] > widths[0] > widths[1]
    assert widths[2] > widths[3]


def test_what_needs_an_unknown_point_is_left_out():
    points = np.vstack([SQUARE, np.full(3, np.nan)])
    shape = Shape3D(lines=((0, 1), (1, 4)), faces=((0, 1, 2), (0, 1, 4)), bodies=(((0,), 0.1), ((0, 4), 0.1)))
    paths = list(still(scene(Piece3D(points, shape, Style3D("#808080")), center=np.zeros(3))).iter("path"))
    assert [len(corners(path)) for path in paths] == [3, 2, 2, 2]  # a ball is a line of no length, in two tones


def test_colours_of_the_page_and_names_are_in_the_still_drawing():
    pieces = [Piece3D(SQUARE, Shape3D(lines=loop(4)), Style3D(color)) for color in ("--ink", "--line", "#123456")]
    drawn = still(scene(*pieces, names=[("cam <1>", SQUARE[0])]))
    assert [path.get("stroke") for path in drawn.iter("path")] == ["currentColor", "var(--line)", "#123456"]
    assert [text.text for text in drawn.iter("text")] == ["cam <1>"]
    assert drawn.get("aria-label") == "A <scene>"


@pytest.mark.parametrize("count", [3, 4, 7])
def test_a_prism_has_three_edges_for_each_side(count):
    edges = prism(count).lines
    assert len(set(map(frozenset, edges))) == 3 * count
    assert {len([edge for edge in edges if corner in edge]) for corner in range(2 * count)} == {3}


def test_a_camera_sees_the_base_of_its_pyramid_at_the_corners_of_its_picture():
    camera = Camera([[500, 0, 320], [0, 510, 250], [0, 0, 1]], np.eye(3), [0.1, 0.2, 0.3], size=(640, 480))
    apex, *base = camera_pyramid(camera, 0.7)
    np.testing.assert_allclose(apex, camera.center)
    np.testing.assert_allclose(
        camera.project(np.array(base)), [[-0.5, -0.5], [639.5, -0.5], [639.5, 479.5], [-0.5, 479.5]]
    )
    np.testing.assert_allclose(camera.depth(np.array(base)), 0.7)
