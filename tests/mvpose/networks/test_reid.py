from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from onnx_graphs import Graph, dots, mean_color, picture

from mvpose import Detections, preset
from mvpose.affinity import AppearanceAffinity, FusedAffinity
from mvpose.networks import Card, ReId, Session

COLORS = np.array([[200, 60, 30], [30, 180, 90], [70, 40, 220], [128, 128, 128]], float)
BOXES = np.array([[40, 30, 60, 150], [200, 50, 80, 160], [350, 200, 50, 120], [500, 100, 90, 200]], float)


@pytest.fixture(scope="module")
def reid(tmp_path_factory):
    return ReId(mean_color(tmp_path_factory.mktemp("reid") / "color.onnx"))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def dressed(order=(0, 1, 2, 3)):
    """A picture with a person of one colour in each box, one pixel larger than the box."""
    image = picture((640, 480), background=90)
    for (x, y, w, h), color in zip(BOXES.astype(int), COLORS[list(order)], strict=True):
        image[y - 1 : y + h + 2, x - 1 : x + w + 2] = color
    return image


def test_the_descriptor_is_that_of_the_box(reid):
    orders = ((0, 1, 2, 3), (3, 1, 0, 2))
    images = [dressed(order) for order in orders]
    view = np.repeat([0, 1], 4)
    result = reid.descriptors(images, view, np.tile(BOXES, (2, 1)))
    np.testing.assert_allclose(result, unit(COLORS[[*orders[0], *orders[1]]]), atol=2e-3)
    assert reid.dimensions == 3


@given(st.permutations(range(4)), st.integers(0, 4))
def test_a_descriptor_depends_on_its_box_alone(reid, order, many):
    image = dressed()
    chosen = list(order)[:many]
    np.testing.assert_allclose(
        reid.descriptors([image], np.zeros(many), BOXES[chosen]), reid.descriptors([image], np.zeros(4), BOXES)[chosen],
        atol=1e-6,
    )  # fmt: skip


@pytest.mark.parametrize(
    "box",
    [(100, 100, 0, 50), (100, 100, 50, 0), (640, 0, 50, 50), (-60, 0, 50, 50), (0, 480, 50, 50), (1e8, 1e8, 1e3, 1e3)],
)
def test_an_empty_box_has_no_descriptor_and_does_not_affect_others(reid, box):
    image = dressed()
    result = reid.descriptors([image], [0, 0, 0], [BOXES[0], box, BOXES[1]])
    assert np.isnan(result[1]).all()
    np.testing.assert_array_equal(result[[0, 2]], reid.descriptors([image], [0, 0], BOXES[:2]))
    assert np.isnan(reid.descriptors([image], [0], [box])).all()


@given(
    st.sampled_from(["left", "right", "top", "bottom"]), st.floats(0.002, 0.9), st.floats(40, 200), st.floats(40, 200)
)
def test_boxes_mostly_outside_the_image_do_not_match(reid, side, share, w, h):
    """With too small a part of the box there is no descriptor; with more it is not that of the fill."""
    x, y = {
        "left": (-0.5 - w * (1 - share), 100), "right": (639.5 - w * share, 100),
        "top": (100, -0.5 - h * (1 - share)), "bottom": (100, 479.5 - h * share),
    }[side]  # fmt: skip
    people = [np.full((480, 640, 3), color, np.uint8) for color in ((230, 10, 10), (10, 230, 10))]
    one, other = reid.descriptors(people, [0, 1], [(x, y, w, h)] * 2)
    assert np.isnan(one).all() == np.isnan(other).all()
    assert np.isnan(one).all() == (share < 0.3) or abs(share - 0.3) < 0.04  # it is counted in pixels of the crop
    assert not one @ other > 0.95


def test_pixels_outside_the_image_have_the_mean_colour_of_the_training(reid):
    """A box half outside a red picture is half red and half the colour that normalises to zero."""
    image = np.full((480, 640, 3), (255, 0, 0), np.uint8)
    (result,) = reid.descriptors([image], [0], [(-50.5, 100, 100, 200)])
    np.testing.assert_allclose(result, unit(0.5 * np.array([1.0, 0, 0]) + 0.5 * np.array(Card().mean)), atol=2e-3)


def test_detections_get_the_descriptors_of_their_boxes(reid):
    bare = Detections([0, 2, 1], np.full((3, 17, 2), np.nan), np.zeros((3, 17)), BOXES[[0, 1, 3]], np.full(3, 0.7))
    images = [dressed(), None, dressed((3, 2, 1, 0))]
    found = reid.describe(bare, images)
    np.testing.assert_allclose(found.descriptors[:2], unit(COLORS[[0, 2]]), atol=2e-3)
    assert np.isnan(found.descriptors[2]).all()  # its view has no picture
    assert bare.descriptors is None
    np.testing.assert_array_equal(found.boxes, bare.boxes)
    assert reid.describe(Detections.empty(), []).descriptors.shape == (0, 3)


def test_an_output_with_pooled_axes_is_a_descriptor(tmp_path):
    pooled = ReId(mean_color(tmp_path / "net.onnx", pooled=True))
    np.testing.assert_allclose(pooled.descriptors([dressed()], np.zeros(4), BOXES), unit(COLORS), atol=2e-3)


@pytest.mark.parametrize("batch", [1, 3, 16])
def test_a_fixed_batch_size_gives_the_same_descriptors(tmp_path, reid, batch):
    fixed = ReId(mean_color(tmp_path / "net.onnx", batch=batch))
    given = [dressed()], np.zeros(4), BOXES
    np.testing.assert_allclose(fixed.descriptors(*given), reid.descriptors(*given), atol=1e-6)


def test_an_output_of_zeros_is_no_descriptor(tmp_path):
    graph = Graph(("n", 3, 64, 32))
    graph.undo_normalisation(Card())
    graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.add("Sub", graph.last, np.array(0.5))
    graph.add("Relu")
    graph.output("features", ("n", 3))
    dark, bright = np.zeros((480, 640, 3), np.uint8), np.full((480, 640, 3), 250, np.uint8)
    result = ReId(graph.save(tmp_path / "net.onnx")).descriptors([dark, bright], [0, 1], BOXES[:2])
    assert np.isnan(result[0]).all()
    np.testing.assert_allclose(result[1], unit(np.ones(3)), atol=1e-5)


def test_the_scale_of_distances_is_on_the_card(tmp_path, reid):
    """The scale on the card becomes that of the affinity of a pipeline."""
    assert reid.affinity == AppearanceAffinity()
    card = Card(name="ours", midpoint=0.8, slope=0.05)
    stated = ReId(mean_color(tmp_path / "net.onnx", card=card))
    assert stated.session.card == card
    assert stated.affinity == AppearanceAffinity(midpoint=0.8, slope=0.05)
    images = [dressed((0, 1, 2, 3)), dressed((0, 1, 3, 2))]
    bare = Detections(
        np.repeat([0, 1], 4), np.full((8, 17, 2), np.nan), np.zeros((8, 17)), np.tile(BOXES, (2, 1)), np.ones(8)
    )
    affinity = stated.affinity(None, stated.describe(bare, images), None)
    found = np.argmax(affinity[:4], axis=1) - 4
    assert found.tolist() == [0, 1, 3, 2]
    full = replace(preset("full"), affinity=FusedAffinity(appearance=stated.affinity))
    assert full.affinity.appearance.midpoint == 0.8


def test_a_network_of_another_kind_is_refused(tmp_path):
    heads = dots(tmp_path / "pose.onnx")
    with pytest.raises(ValueError, match=r"must be descriptors \(n, D\) .* got \(n, 17, 64, 48\); pass a re-ID"):
        ReId(heads)
    graph = Graph(("n", 3, 64, 32))
    mean = graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.output("features", ("n", 3))
    graph.add("ReduceMean", mean, axes=[1], keepdims=1)
    graph.output("score", ("n", 1))
    path = graph.save(tmp_path / "two.onnx")
    with pytest.raises(ValueError, match="reads one output, but the file has 2: 'features', 'score'"):
        ReId(path)
    assert ReId(Session(path, card=Card(outputs=("features",)))).dimensions == 3
    with pytest.raises(ValueError, match=r"with D of 2 or more, got \(n, 1\)"):
        ReId(Session(path, card=Card(outputs=("score",))))


def test_invalid_input_is_refused(reid):
    with pytest.raises(ValueError, match=r"boxes must be \(2, 4\), got \(1, 4\)"):
        reid.descriptors([dressed()], [0, 0], BOXES[:1])
    with pytest.raises(ValueError, match="images must hold a picture for every view, got 1 pictures"):
        reid.descriptors([dressed()], [0, 1], BOXES[:2])
    with pytest.raises(ValueError, match="boxes must be finite"):
        reid.descriptors([dressed()], [0], [[0, 0, np.inf, 5]])
