"""Votes of PoseNet's cells, and the head in pictures whose dots are known."""

import numpy as np
import pytest
from onnx_graphs import Graph, picture

from mvpose.networks import Card
from mvpose.networks.detector import open_head
from mvpose.networks.posenet import PoseNet, votes

CARD = Card(name="posenet", size=(129, 129), mean=(0.0,) * 3, std=(1 / 255,) * 3, cells="span", padding=1.0)


def test_cells_that_name_one_place_peak_there_with_the_greatest_probability():
    """Offsets are exact: joint j of crop m is at a place between the cells of the result."""
    place = np.array([[[9.5, 13.25], [3.0, 20.0]], [[16.0, 6.5], [22.75, 11.0]]])
    rows, columns = np.mgrid[:8, :9]
    cells = 4 * np.stack([rows, columns], axis=-1)[None, :, :, None]
    away = place[:, None, None] - cells
    heat = 0.7 * np.exp(-((away / 6) ** 2).sum(axis=-1))
    found = votes(heat.astype(np.float32), away)
    assert found.shape == (2, 2, 29, 33)
    np.testing.assert_allclose(found.max(axis=(2, 3)), heat.max(axis=(1, 2)), rtol=1e-5)
    weight = found / found.sum(axis=(2, 3), keepdims=True)
    grid = np.mgrid[:29, :33]
    mean = np.stack([(weight * each).sum(axis=(2, 3)) for each in grid], axis=-1)
    np.testing.assert_allclose(mean, place, atol=0.05)


def test_votes_outside_of_the_crop_are_lost_and_no_votes_are_no_peak():
    heat = np.zeros((1, 3, 3, 1), np.float32)
    assert not votes(heat, np.zeros((1, 3, 3, 1, 2))).any()
    heat[0, 0, 0, 0] = 0.5
    assert not votes(heat, np.full((1, 3, 3, 1, 2), -5.0)).any()


@pytest.fixture(scope="module")
def head(tmp_path_factory):
    """PoseNet that sees joints where every sixteenth pixel is bright, with no offset but that of its joint's number."""
    graph = Graph(("n", 129, 129, 3))
    graph.undo_normalisation(CARD, channels_last=True)
    first = graph.add("Transpose", perm=[0, 3, 1, 2])
    shifts = np.concatenate([np.zeros(17), np.arange(17)])  # rows, then columns: pixels of the input
    for name, channels, gain, constant in (("heatmaps", 17, 1 / 3, np.zeros(17)), ("offsets", 34, 0, shifts)):
        graph.add("Conv", first, np.full((channels, 3, 1, 1), float(gain)), constant * 1.0, strides=[16, 16])
        graph.add("Transpose", perm=[0, 2, 3, 1])
        graph.output(name, ["n", 9, 9, channels])
    return graph.save(tmp_path_factory.mktemp("networks") / "dots.onnx", card=CARD)


def test_joints_are_placed_in_the_picture(head):
    spot = np.array([64.0, 80.0])  # a cell of the network in a box as large as its input
    shown = picture((200, 180), (*(spot + 30), 10.0, (250, 250, 250)))
    found = PoseNet(head).detect([shown], [0], [[29.5, 29.5, 129, 129]])
    expected = spot + 30 + np.stack([np.arange(17), np.zeros(17)], axis=1)
    np.testing.assert_allclose(found.keypoints[0], expected, atol=1.0)
    assert found.likelihoods.values.shape == (1, 17, 33, 33)
    np.testing.assert_allclose(found.likelihoods.stride, 4.0)
    assert PoseNet(head, likelihoods=False).detect([shown], [0], [[30, 30, 129, 129]]).likelihoods is None
    for likelihoods in (False, True):
        opened = open_head(head, likelihoods=likelihoods)
        assert (isinstance(opened, PoseNet), opened.likelihoods) == (True, likelihoods)


def test_another_network_is_refused(tmp_path):
    graph = Graph(("n", 129, 129, 3))
    graph.output("heatmaps", ["n", 129, 129, 3])
    with pytest.raises(ValueError, match="outputs must be heat maps"):
        PoseNet(graph.save(tmp_path / "other.onnx", card=CARD))
