from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from onnx_graphs import Graph, dots, mean_color, picture, simcc_dots
from people import ring

import mvpose
from mvpose import COCO17, SHELF14, Detections, Skeleton
from mvpose.networks import Card, PoseHead, Session

WHITE = (250, 250, 250)
SIZE = (640, 480)
PLAIN, SIMCC = "stride", "simcc"


@pytest.fixture(scope="module")
def heads(tmp_path_factory):
    """A head of every kind, with and without the flip test, by name."""
    folder = tmp_path_factory.mktemp("heads")
    files = {cells: dots(folder / f"{cells}.onnx", card=Card(cells=cells)) for cells in ("stride", "span", "area")}
    files["wide"] = dots(folder / "wide.onnx", size=(256, 192))
    files["simcc"] = simcc_dots(folder / "simcc.onnx")
    files["simcc3"] = simcc_dots(folder / "simcc3.onnx", size=(128, 160), split=3)
    return {(name, flip): PoseHead(file, flip=flip) for name, file in files.items() for flip in (False, True)}


def shrinks(head, box):
    """Pixels of the image to one of the input."""
    return max(1.25 * box[2] / head.session.size[0], 1.25 * box[3] / head.session.size[1])


@pytest.mark.slow
@given(
    st.sampled_from(["stride", "span", "area", "wide", "simcc", "simcc3"]), st.booleans(),
    st.floats(-200, 600), st.floats(-200, 440), st.floats(20, 900), st.floats(20, 900), st.floats(0.1, 0.9),
    st.floats(0.1, 0.9),
)  # fmt: skip
@example("stride", True, 10.0, 10.0, 300.0, 30.0, 0.5, 0.5)
@example("simcc", True, 10.0, 10.0, 30.0, 300.0, 0.5, 0.5)
def test_keypoints_are_at_the_dot(heads, kind, flip, x, y, w, h, across, down):
    """Accurate to a tenth of a pixel (required: a quarter), for any aspect, position and size, in every convention."""
    head, box = heads[kind, flip], (x, y, w, h)
    dot = np.array([x + across * w, y + down * h])
    deviation = 1.5 * max(shrinks(head, box), 1)
    assume((dot > 4 * deviation).all() and (dot < np.array(SIZE) - 1 - 4 * deviation).all())
    image = picture(SIZE, (*dot, deviation, WHITE))
    found = head.detect([image], [0], [box])
    np.testing.assert_allclose(found.keypoints[0], np.tile(dot, (17, 1)), atol=0.1)
    np.testing.assert_allclose(found.scores, 1, atol=0.01)
    np.testing.assert_array_equal(found.boxes, [box])
    pixels, heights = found.likelihoods.modes(1)
    np.testing.assert_allclose(pixels[0, :, 0], found.keypoints[0], atol=0.25)
    np.testing.assert_allclose(np.minimum(heights[0, :, 0], 1), found.scores[0], atol=0.01)


def test_the_wrong_cell_convention_causes_the_documented_error(heads, tmp_path):
    """With cells of four pixels the error is 1.5 input pixels at the middle of an axis, also with the flip test."""
    area = heads["area", False].session.path
    wrong = PoseHead(Session(area, card=Card(cells="stride")))
    box = (100, 100, 192 / 1.25, 256 / 1.25)  # a pixel of the input for a pixel of the image
    image = picture(SIZE, (170, 200, 2, WHITE))
    off = wrong.detect([image], [0], [box]).keypoints[0, 0] - (170, 200)
    np.testing.assert_allclose(off, [-1.5, -1.5], atol=0.05)


@pytest.mark.parametrize("kind", [PLAIN, SIMCC])
def test_every_box_gets_a_separate_pose(heads, kind):
    """Two people in one view, one in another: each box gives the dot within it."""
    spots = np.array([[120, 100], [400, 300], [220, 350]], float)
    boxes = np.array([[70, 20, 100, 160], [330, 200, 140, 210], [190, 300, 60, 110]], float)
    images = [picture(SIZE, *((*spot, 2, WHITE) for spot in spots[:2])), None, picture(SIZE, (*spots[2], 2, WHITE))]
    head = heads[kind, False]
    found = head.detect(images, [0, 0, 2], boxes, box_scores=[0.9, 0.8, 0.7])
    np.testing.assert_allclose(found.keypoints[:, 5], spots, atol=0.25)
    assert found.view.tolist() == [0, 0, 2]
    assert found.box_scores.tolist() == [0.9, 0.8, 0.7]
    order = [2, 0, 1]
    again = head.detect(images, np.array([0, 0, 2])[order], boxes[order])
    np.testing.assert_allclose(again.keypoints, found.keypoints[order], atol=1e-3)


@pytest.mark.parametrize("kind", [PLAIN, SIMCC])
@pytest.mark.parametrize("flip", [False, True])
def test_an_empty_box_has_no_keypoint_and_does_not_affect_others(heads, kind, flip):
    image = picture(SIZE, (300, 200, 3, WHITE))
    good = (250, 100, 100, 200)
    nothing = [(250, 100, 0, 200), (250, 100, 100, 0), (700, 100, 50, 50), (0, -60, 50, 50), (50, 50, 60, 60)]
    found = heads[kind, flip].detect([image, None], [0, 0, 0, 0, 0, 1], [good, *nothing])
    np.testing.assert_allclose(found.keypoints[0], np.tile([300, 200], (17, 1)), atol=0.25)
    assert np.isnan(found.keypoints[1:]).all()
    assert (found.scores[1:] == 0).all()
    assert (found.likelihoods.values[1:] == 0).all()
    assert np.isfinite(found.likelihoods.origin).all()
    assert found.box_scores[0] == pytest.approx(1, abs=0.01)
    assert (found.box_scores[1:] == 0).all()
    alone = heads[kind, flip].detect([image], [0], [good])
    np.testing.assert_array_equal(found.likelihoods.values[:1], alone.likelihoods.values)


@pytest.mark.parametrize("kind", [PLAIN, SIMCC])
def test_no_boxes_give_no_detections(heads, kind):
    found = heads[kind, True].detect([np.zeros((480, 640, 3), np.uint8)], [], np.zeros((0, 4)))
    assert len(found) == 0
    assert found.keypoints.shape == (0, 17, 2)


GAINS = np.linspace(0.1, 0.8, 17)


def assert_heights(scores, gains):
    """The highest cell has the height of the gain; the peak is higher according to its offset from that cell."""
    ratio = scores / gains
    assert 0.999 < ratio.mean() < np.exp(0.5 * 2 * (0.5 / 1.5) ** 2)  # half a cell off both ways, deviation 1.5 cells
    assert np.ptp(ratio) < 1e-3


@pytest.mark.parametrize("simcc", [False, True])
def test_heights_are_scores_and_the_flip_test_averages_mirror_pairs(tmp_path, simcc):
    """The mirrored map of a joint is that of its counterpart, so the average has the mean height."""
    path = (simcc_dots if simcc else dots)(tmp_path / "head.onnx", gains=GAINS)
    image, box = picture(SIZE, (300, 200, 3, WHITE)), (250, 100, 100, 200)
    plain, flipped = (PoseHead(path, flip=flip).detect([image], [0], [box]) for flip in (False, True))
    assert_heights(plain.scores[0], GAINS)
    assert_heights(flipped.scores[0], (GAINS + GAINS[list(COCO17.mirror)]) / 2)
    assert plain.box_scores[0] == pytest.approx(plain.scores[0].mean())


def test_channels_may_come_last(tmp_path):
    image, box = picture(SIZE, (300, 200, 3, WHITE)), (250, 100, 100, 200)
    last = PoseHead(dots(tmp_path / "head.onnx", channels_last=True, gains=GAINS))
    found = last.detect([image], [0], [box])
    np.testing.assert_allclose(found.keypoints[0], np.tile([300, 200], (17, 1)), atol=0.25)
    assert_heights(found.scores[0], GAINS)


def test_the_card_gives_the_scale_of_peaks(tmp_path):
    image, box = picture(SIZE, (300, 200, 3, WHITE)), (250, 100, 100, 200)
    path = dots(tmp_path / "head.onnx", card=Card(peak=255.0), gains=GAINS)
    assert_heights(PoseHead(path).detect([image], [0], [box]).scores[0], GAINS)
    with pytest.raises(
        ValueError, match=r"heights reach 2[01]\d, expected about 1 at a confident peak; give .* Card\(peak="
    ):
        PoseHead(Session(path, card=Card())).detect([image], [0], [box])


def test_negative_heights_count_as_0(tmp_path):
    path = dots(tmp_path / "head.onnx", gains=[-0.5] * 2 + [1.0] * 15)
    found = PoseHead(path).detect([picture(SIZE, (300, 200, 3, WHITE))], [0], [(250, 100, 100, 200)])
    assert (found.scores[0, :2] == 0).all()
    assert np.isnan(found.keypoints[0, :2]).all()
    assert (found.likelihoods.values >= 0).all()


@pytest.mark.parametrize("padding", [1.0, 1.25, 2.0])
def test_padding_extends_the_crop_beyond_the_box(heads, padding):
    head = PoseHead(Session(heads[PLAIN, False].session.path, card=Card(padding=padding)))
    box, image = (250, 100, 90, 120), picture(SIZE, (295, 80, 3, WHITE))  # a sixth of the height above the box
    found = head.detect([image], [0], [box])
    spread = found.likelihoods.stride[0] * (48, 64)
    np.testing.assert_allclose(spread, [90 * padding, 120 * padding])
    near = np.abs(found.keypoints[0, 0] - (295, 80)).max() < 0.25
    assert near == (padding > 1.34)


@pytest.mark.parametrize("kind", [PLAIN, SIMCC])
def test_without_likelihoods_the_keypoints_are_the_same(heads, kind):
    image, box = picture(SIZE, (300, 200, 3, WHITE)), (250, 100, 100, 200)
    path = heads[kind, False].session.path
    bare, full = (PoseHead(path, likelihoods=wanted).detect([image], [0], [box]) for wanted in (False, True))
    assert bare.likelihoods is None
    np.testing.assert_array_equal(bare.keypoints, full.keypoints)
    assert isinstance(replace(full, likelihoods=None), Detections)


@pytest.mark.parametrize("down", [0.5, 1.6])
def test_the_lower_peak_of_two_vectors_is_the_score(tmp_path, down):
    head = PoseHead(simcc_dots(tmp_path / "head.onnx", gains=(0.6,) * 17, down=down))
    found = head.detect([picture(SIZE, (300, 200, 3, WHITE))], [0], [(250, 100, 100, 200)])
    lower = 0.6 * min(down, 1)
    np.testing.assert_allclose(found.scores, lower, rtol=0.01)
    np.testing.assert_allclose(found.likelihoods.modes(1)[1], lower, rtol=0.01)


def test_the_outer_product_of_two_peaks_has_four_peaks(heads):
    spots = np.array([[290.0, 150.0], [310.0, 250.0]])
    image = picture(SIZE, *((*spot, 3, WHITE) for spot in spots))
    found = heads[SIMCC, False].detect([image], [0], [(200, 100, 200, 200)])
    modes = found.likelihoods.modes(4)[0][0, 0]
    crossed = {(round(x / 10), round(y / 10)) for x, y in modes}
    assert crossed == {(29, 15), (31, 25), (29, 25), (31, 15)}


def test_fixed_batches_give_the_same(heads, tmp_path):
    fixed = PoseHead(dots(tmp_path / "head.onnx", batch=2))
    image = picture(SIZE, (300, 200, 3, WHITE))
    boxes = [(250, 100, 100, 200), (230, 120, 100, 200), (200, 50, 200, 300)]
    one, other = (head.detect([image], [0, 0, 0], boxes) for head in (fixed, heads[PLAIN, False]))
    np.testing.assert_allclose(one.keypoints, other.keypoints, atol=1e-4)


@pytest.mark.parametrize("preset", ["full", "fast"])
@pytest.mark.parametrize("kind", [PLAIN, SIMCC])
def test_people_are_estimated_from_pictures(tmp_path, preset, kind):
    """Three dots in space, seen by five cameras: a red hip, a green knee, a blue ankle."""
    leg = Skeleton("leg", ("left_hip", "left_knee", "left_ankle"), (-1, 0, 1), (0, 1, 2), (0.1, 0.1, 0.1))
    make = dots if kind == PLAIN else simcc_dots
    head = PoseHead(make(tmp_path / "head.onnx", gains=(1.0,) * 3, by_color=True), skeleton=leg)
    rig = ring(5, focal=500.0, size=SIZE)
    joints = np.array([[0.1, 0.2, 0.92], [0.15, 0.25, 0.5], [0.05, 0.22, 0.1]])
    pixels = rig.project(joints)
    images = [
        picture(SIZE, *((*spot, 2, color) for spot, color in zip(each, 250 * np.eye(3), strict=True)))
        for each in pixels
    ]
    low, high = pixels.min(axis=1) - 25, pixels.max(axis=1) + 25
    found = head.detect(images, np.arange(5), np.concatenate([low, high - low], axis=1))
    np.testing.assert_allclose(found.keypoints, pixels, atol=0.25)
    estimate = mvpose.preset(preset).estimate(rig, found)
    assert len(estimate) == 1
    np.testing.assert_allclose(estimate.joints[0], joints, atol=0.005)


# What is refused.


def test_a_network_of_another_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"heat maps \(n, 17, h, w\), or SimCC .* got 'features' \(n, 3\)"):
        PoseHead(mean_color(tmp_path / "reid.onnx"))


@pytest.mark.parametrize("make", [dots, simcc_dots])
def test_another_skeleton_is_refused(tmp_path, make):
    path = make(tmp_path / "head.onnx", gains=(1.0,) * 14)
    with pytest.raises(ValueError, match="has 14 joints, but skeleton 'coco17' has 17; pass the skeleton of the head"):
        PoseHead(path)
    found = PoseHead(path, skeleton=SHELF14).detect([picture(SIZE, (300, 200, 3, WHITE))], [0], [(250, 100, 100, 200)])
    assert found.skeleton is SHELF14
    np.testing.assert_allclose(found.keypoints[0], np.tile([300, 200], (14, 1)), atol=0.25)


def test_exchanged_vectors_are_refused_and_can_be_ordered(tmp_path):
    path = simcc_dots(tmp_path / "head.onnx")
    swapped = Card(outputs=("simcc_y", "simcc_x"))
    with pytest.raises(ValueError, match="512 wide and 384 high, which is not the aspect of the input, 192 x 256"):
        PoseHead(Session(path, card=swapped))
    PoseHead(Session(path, card=Card(outputs=("simcc_x", "simcc_y"))))


def test_maps_of_another_aspect_are_refused(tmp_path):
    graph = Graph(("n", 3, 256, 192))
    graph.add("AveragePool", kernel_shape=[8, 4], strides=[8, 4])
    graph.add("Concat", *[graph.last] * 6, axis=1)
    graph.output("heatmaps", ("n", 18, 32, 48))
    skeleton = replace(
        SHELF14, joints=tuple("abcdefghijklmnopqr"), parents=(-1, *[0] * 17), mirror=range(18), sigmas=[1] * 18
    )
    with pytest.raises(ValueError, match="outputs are 48 wide and 32 high, which is not the aspect"):
        PoseHead(graph.save(tmp_path / "head.onnx"), skeleton=skeleton)


def test_invalid_input_is_refused(heads):
    head, image = heads[PLAIN, False], np.zeros((480, 640, 3), np.uint8)
    with pytest.raises(ValueError, match=r"boxes must be \(1, 4\), got \(2, 4\)"):
        head.detect([image], [0], np.ones((2, 4)))
    with pytest.raises(ValueError, match=r"box_scores must be \(1,\), got \(2,\)"):
        head.detect([image], [0], np.ones((1, 4)), box_scores=[1, 1])
    with pytest.raises(ValueError, match="got 1 pictures and a detection of view 3"):
        head.detect([image], [3], np.ones((1, 4)))
    with pytest.raises(ValueError, match="image of view 0 must be"):
        head.detect([image / 255.0], [0], np.ones((1, 4)))


@pytest.mark.parametrize("simcc", [False, True])
def test_a_crop_without_a_pixel_in_the_image_has_no_keypoint(tmp_path, simcc):
    """The crop would be black, and the head would still give keypoints."""
    head = PoseHead((simcc_dots if simcc else dots)(tmp_path / "net.onnx"))
    image = np.full((480, 640, 3), 255, np.uint8)
    boxes = [[639.4, 100, 60, 80], [-1e9, -1e9, 3e9, 3e9], [1e308, 0, 1e308, 5], [630, 100, 60, 80], [5, 5, 60, 80]]
    inner = PoseHead(Session(head.session.path, card=Card(padding=0.5)))  # of the fourth it sees no pixel
    for each, nothing in ((head, [True, True, True, False, False]), (inner, [True, True, True, True, False])):
        found = each.detect([image], [0] * 5, boxes)
        assert np.isnan(found.keypoints).all(axis=(1, 2)).tolist() == nothing
        assert (found.scores[nothing] == 0).all()
