import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from mvpose.networks.crops import Placement, check_images, crop_images, in_view, padded, stretched

SIZE = (640, 480)
BLACK = (0, 0, 0)


def noise(size=(97, 61)):
    return np.random.default_rng(5).integers(0, 256, (size[1], size[0], 3), np.uint8)


def crop(image, box, size, fill=BLACK):
    placement = stretched(np.array([box], float), size)
    return crop_images([image], np.zeros(1, int), placement, size, fill=fill)[0]


@given(
    st.floats(0, 60), st.floats(0, 40), st.floats(0.5, 36), st.floats(0.5, 20), st.integers(1, 40), st.integers(1, 40)
)
def test_a_crop_is_pillows_antialiased_resizing(x, y, w, h, width, height):
    image = noise()
    edges = (x + 0.5, y + 0.5, x + w + 0.5, y + h + 0.5)  # Pillow's integers are corners of pixels
    channels = [Image.fromarray(image[..., c].astype(np.float32)) for c in range(3)]
    exact = [np.asarray(each.resize((width, height), Image.Resampling.BILINEAR, box=edges)) for each in channels]
    np.testing.assert_allclose(crop(image, (x, y, w, h), (width, height)), np.stack(exact, axis=2), atol=0.51)


@given(st.floats(-50, 90), st.floats(-30, 50), st.floats(1, 120), st.floats(1, 90))
def test_only_pixels_outside_the_image_have_the_fill_colour(x, y, w, h):
    white = np.full((61, 97, 3), 255, np.uint8)
    size, fill = (16, 24), (1, 2, 3)
    result = crop(white, (x, y, w, h), size, fill=fill)
    across, down = x + w * (np.arange(16) + 0.5) / 16, y + h * (np.arange(24) + 0.5) / 24
    inside = ((across > -0.5) & (across < 96.5))[None, :] & ((down > -0.5) & (down < 60.5))[:, None]
    assert (result[inside] == 255).all()
    assert (result[~inside] == fill).all()


@given(st.floats(0.25, 6.0), st.floats(0.25, 6.0), st.floats(0, 1), st.floats(0, 1))
def test_crop_pixels_follow_the_placement(stride_x, stride_y, along, below):
    columns, rows = np.meshgrid(np.arange(256), np.arange(256))
    image = np.stack([columns, rows, 0 * rows], axis=2).astype(np.uint8)
    size = (20, 30)
    reach = np.array([stride_x, stride_y]) * (np.array(size) - 1)
    origin = 6 + np.array([along, below]) * (243 - reach)
    placement = Placement(origin[None], np.array([[stride_x, stride_y]]))
    result = crop_images([image], np.zeros(1, int), placement, size, fill=BLACK)[0]
    np.testing.assert_allclose(result[0, :, 0], origin[0] + stride_x * np.arange(20), atol=0.51)
    np.testing.assert_allclose(result[:, 0, 1], origin[1] + stride_y * np.arange(30), atol=0.51)


def test_a_reducing_crop_is_antialiased():
    """Stripes of one pixel become grey for any position of the box; interpolation of four pixels would flicker."""
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[:, ::2] = 255
    for x in np.linspace(10, 12, 9):
        assert np.ptp(crop(stripes, (x, 10, 40, 40), (10, 10)).astype(int) - 127) <= 12


@pytest.mark.parametrize("middle", [15.5, 14.0])
def test_a_mirrored_placement_gives_the_mirrored_crop(middle):
    image = noise()
    placement = stretched(np.array([[20.3, 11.1, 50.2, 40.7]]), (32, 24))
    both = (placement, placement.mirrored(middle))
    straight, mirrored = (crop_images([image], np.zeros(1, int), each, (32, 24), fill=BLACK)[0] for each in both)
    start = int(2 * middle)
    np.testing.assert_array_equal(mirrored[:, : start + 1], straight[:, start::-1])


@given(st.floats(-100, 700), st.floats(-100, 500), st.floats(1, 900), st.floats(1, 900), st.floats(1, 2))
def test_a_padded_crop_keeps_the_aspect_and_holds_the_box(x, y, w, h, padding):
    size = (192, 256)
    placement = padded(np.array([[x, y, w, h]]), size, padding)
    (sx, sy), low = placement.stride[0], placement.origin[0] - 0.5 * placement.stride[0]
    high = low + placement.stride[0] * size
    assert sx == sy
    np.testing.assert_allclose((low + high) / 2, [x + w / 2, y + h / 2], atol=1e-9)
    extent = (high - low) / [w, h]
    assert extent.min() == pytest.approx(padding)
    assert extent.max() >= padding - 1e-9


def seen_in(images, view, boxes, least=0.0, size=(8, 16)):
    return in_view(images, np.array(view), stretched(np.array(boxes, float), size), size, least=least).tolist()


def test_a_crop_is_in_view_where_it_has_an_area_and_pixels_inside_its_image():
    images = [np.zeros((480, 640, 3), np.uint8), None, np.zeros((0, 0, 3), np.uint8)]
    boxes = {
        (0, 0, 640, 480): True, (-10, -10, 5, 500): False, (-10, -10, 10.5, 10.5): True, (639, 479, 5, 5): True,
        (639.3, 479, 5, 5): False, (-10, -10, 9.7, 500): False, (1e308, 0, 1e308, 5): False,
        (640, 0, 10, 10): False, (0, 480, 10, 10): False, (5, 5, 0, 10): False, (5, 5, 10, 0): False,
        (-20, -20, 700, 600): True, (-1e9, -1e9, 3e9, 3e9): False,
    }  # fmt: skip
    for box, seen in boxes.items():
        assert seen_in(images, [0, 1, 2], [box] * 3) == [seen, False, False], box


@given(st.floats(-50, 90), st.floats(-30, 50), st.floats(1, 120), st.floats(1, 90), st.floats(0, 1))
def test_the_fraction_in_view_counts_unfilled_pixels(x, y, w, h, least):
    white = np.full((61, 97, 3), 255, np.uint8)
    share = (crop(white, (x, y, w, h), (8, 16)) == 255).all(axis=2).mean()
    assert seen_in([white], [0], [(x, y, w, h)], least) == [0 < share >= least]


@pytest.mark.parametrize("box", [(-1e9, -1e9, 3e9, 3e9), (10, 10, 1e-6, 1e-6), (639.4, 479.4, 3, 3)])
def test_boxes_of_any_size_give_a_crop(box):
    image = np.full((480, 640, 3), 77, np.uint8)
    assert set(np.unique(crop(image, box, (64, 128)))) <= {0, 77}


def test_crops_of_several_views_equal_those_of_single_views():
    images = [noise(), noise((40, 50))[::-1], noise((200, 30))]  # the second is not contiguous
    view = np.array([2, 0, 1, 0])
    boxes = np.array([[5, 5, 20, 20], [30, 2, 9, 50], [-5, 3, 20, 30], [0, 0, 90, 60]], float)
    together = crop_images(images, view, stretched(boxes, (16, 32)), (16, 32), fill=BLACK)
    for k, box, result in zip(view, boxes, together, strict=True):
        np.testing.assert_array_equal(result, crop(images[k], box, (16, 32)))


@pytest.mark.parametrize(
    ("images", "message"),
    [
        ([np.zeros((4, 4, 3), np.uint8)], "a picture for every view, got 1 pictures and a detection of view 1"),
        ([None, np.zeros((4, 4, 3))], r"view 1 must be \(h, w, 3\) uint8, red green blue, got float64 \(4, 4, 3\)"),
        ([None, np.zeros((4, 4), np.uint8)], r"got uint8 \(4, 4\)"),
        ([None, [[1, 2, 3]]], "got list"),
        (np.zeros((4, 4, 3), np.uint8), "got one picture"),
    ],
)
def test_an_invalid_picture_is_refused(images, message):
    with pytest.raises(ValueError, match=message):
        check_images(images, np.array([1]), np.ones((1, 4)))


def test_invalid_boxes_and_views_are_refused():
    images = [np.zeros((4, 4, 3), np.uint8)]
    with pytest.raises(ValueError, match=r"boxes must be finite x, y, width, height, got .*nan.* for detection 1"):
        check_images(images, np.zeros(2, int), np.array([[0, 0, 1, 1], [0, np.nan, 1, 1]]))
    with pytest.raises(ValueError, match="view must be camera indices from 0, got -1"):
        check_images(images, np.array([-1]), np.ones((1, 4)))
