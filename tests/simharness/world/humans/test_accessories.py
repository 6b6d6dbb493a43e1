"""Things that people wear: shares, uniforms, what they cover, and that the body below does not change."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

from mvpose.camera import Camera
from simharness.capture.joint_visibility import label_joints
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.types.views import Visibility
from simharness.world.humans.accessories import take_off, wear
from simharness.world.humans.anatomy import Segment
from simharness.world.humans.body import FacePart, make_body
from simharness.world.humans.clothing import dress, face_colors
from simharness.world.humans.mujoco_model import neutral_transforms
from simharness.world.humans.population import draw_sex, draw_shape
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import BAGS, GLASSES, HAIR_STYLES, HATS, draw_look, draw_looks
from simharness.world.scene.build import make_person

BARE = {"hat": "none", "bag": "none", "glasses": "none", "mask": "none", "hair_style": "short", "bald": 0.0}
HEAD_WEAR = [{"glasses": kind} for kind in GLASSES[1:]] + [{"hat": kind} for kind in HATS[1:]] + [{"mask": "medical"}]
WORN = [*HEAD_WEAR, *({"bag": kind} for kind in BAGS[1:])]
FACE, EARS = [0, 1, 2], [3, 4]


@cache
def dressed(person, **changes):
    shape = Shape(age=0.3) if person == "child" else draw_shape(stream(person, "people", 0, "shape"))
    look = replace(draw_look(stream(4, "test")), **BARE | changes)
    return dress(make_body(shape), look), look


def worn(person, **changes):
    body, look = dressed(person, **changes)
    return wear(body, look), look


def looking_at(aim, bearing, height, distance=1.2):
    """Return a camera at a bearing from the face and an elevation, degrees, that looks at a point."""
    bearing, height = np.radians([bearing, height])
    away = np.array([np.cos(height) * np.cos(bearing), np.cos(height) * np.sin(bearing), np.sin(height)])
    z = -away
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    K = [[500, 0, 150], [0, 500, 150], [0, 0, 1]]
    return Camera(K=K, R=R, t=-R @ (aim + distance * away), size=(301, 301), name="test")


def seen(body, camera):
    """Return the visibility of the joints (17,)."""
    mesh = Mesh(body.vertices, body.faces, np.full((len(body.faces), 3), 0.5, np.float32))
    image = RasterRenderer().render(camera, [mesh], color=False)
    joints = body.joints(np.tile(np.eye(3, 4), (len(body.bones), 1, 1)))
    return label_joints(image, camera, joints=joints[None], radii=body.joint_radii[None])[0]


@cache
def people():
    return [
        (draw_sex(stream(seed, "people", i, "shape")), look)
        for seed in range(250)
        for i, look in enumerate(draw_looks(seed, 8))
    ]


@pytest.mark.slow
def test_accessories_have_their_shares():
    """Of 2,000 people, within three standard deviations; the shares are those of the module's sources."""
    for sex, glasses, backpack, shoulder in (("female", 0.52, 0.08, 0.20), ("male", 0.42, 0.12, 0.10)):
        looks = [look for other, look in people() if other == sex]
        count = {key: Counter(getattr(look, key) for look in looks) for key in ("glasses", "hat", "bag", "mask")}
        corrected = count["glasses"]["rectangular"] + count["glasses"]["round"]
        for found, share in (
            (corrected, 0.7 * glasses),
            (count["glasses"]["sunglasses"], 0.03),
            (len(looks) - count["hat"]["none"], 0.10),
            (count["bag"]["backpack"], backpack),
            (count["bag"]["shoulder"], shoulder),
            (count["mask"]["medical"], 0.03),
        ):
            assert abs(found / len(looks) - share) < 3 * np.sqrt(share * (1 - share) / len(looks))


def test_every_hair_style_is_drawn_and_long_styles_are_of_women():
    count = Counter((sex, look.hair_style) for sex, look in people())
    assert {style for _, style in count} == set(HAIR_STYLES)
    assert not any(count["male", style] for style in ("bob", "ponytail", "bun"))
    assert not any(look.bald and look.hair_style == "curly" for _, look in people())


def test_the_draws_of_clothes_do_not_change():
    """Accessories and hair styles have streams of their own: all else is the look of the person's first stream."""
    look = draw_looks(5, 3)[2]
    start = stream(5, "people", "hue").random()
    female = draw_sex(stream(5, "people", 2, "shape")) == "female"
    first = draw_look(stream(5, "people", 2, "look"), female=female, place=float(start + (5**0.5 - 1)))
    new = {"glasses", "hat", "mask", "bag", "frame_color", "hat_color", "mask_color", "bag_color"}
    for entry in fields(look):
        if entry.name not in new | {"hair_style", "beard", "bald"}:
            assert getattr(look, entry.name) == getattr(first, entry.name), entry.name


def test_hats_and_bags_belong_to_the_uniform_and_glasses_do_not():
    groups = [draw_looks(seed, 6, look_alike=1.0) for seed in range(60)]
    for looks in groups:
        assert len({(look.hat, look.bag, look.hat_color, look.bag_color) for look in looks}) == 1
    assert {looks[0].bag for looks in groups} == set(BAGS)
    assert any(len({look.glasses for look in looks}) > 1 for looks in groups)


@pytest.mark.parametrize("changes", WORN, ids=lambda changes: next(iter(changes.values())))
def test_what_is_worn_is_a_small_mesh_after_all_others_and_can_be_taken_off(changes):
    before, look = dressed(1, **changes)
    body = wear(before, look)
    k, n = len(before.faces), len(before.vertices)
    assert 0 < len(body.faces) - k < 620
    assert (body.part[k:] >= FacePart.GLASSES).all()
    assert (body.faces[k:] >= n).all()
    np.testing.assert_allclose(body.weights.sum(axis=1), 1, atol=1e-5)
    np.testing.assert_array_equal(body.keypoints, before.keypoints)
    again = take_off(body)
    for key in ("vertices", "faces", "part", "level", "weight_bones", "weights"):
        np.testing.assert_array_equal(getattr(again, key), getattr(before, key))
    on_head = np.isin(body.part[k:], [FacePart.BAG, FacePart.STRAP], invert=True)
    assert (body.segments[k:][on_head] == Segment.HEAD).all()


def test_people_move_as_without_accessories():
    """Also with another hair style: hair is tied, cut or curled after motion is decided."""
    shape, look = draw_shape(stream(2, "people", 0, "shape")), replace(draw_look(stream(2, "test")), **BARE)
    before = make_person(shape, look)
    laden = replace(look, bag="backpack", glasses="round")
    for changed in (laden, replace(look, hair_style="curly"), replace(look, hair_style="bob", hat="cap")):
        person = make_person(shape, changed)
        np.testing.assert_array_equal(person.mover.body.vertices, before.mover.body.vertices)
        np.testing.assert_array_equal(person.mover.body.faces, before.mover.body.faces)
        assert len(person.figure.vertices) == len(person.body.vertices)
        assert not np.array_equal(person.figure.vertices, before.figure.vertices)


@pytest.mark.parametrize("person", [1, "child"])
@pytest.mark.parametrize("changes", [*HEAD_WEAR, *({"hair_style": style} for style in ("bob", "ponytail", "curly"))])
def test_the_face_stays_visible_from_eye_level(person, changes):
    """Glasses, masks, hats and hair lie close to the joints that they cover, as skin does: the labels do not change."""
    body, _ = worn(person, **changes)
    aim = body.keypoints[0, :, :3].sum(axis=0)
    for bearing, joints in ((0, FACE), (40, FACE), (90, [1, 3]), (-90, [2, 4])):
        assert (seen(body, looking_at(aim, bearing, 0))[joints] == Visibility.VISIBLE).all(), bearing


def test_a_brim_hides_eyes_from_above_and_a_beanie_does_not():
    for kind, label in (("brimmed", Visibility.SELF_OCCLUDED), ("beanie", Visibility.VISIBLE)):
        body, _ = worn(1, hat=kind)
        aim = body.keypoints[0, :, :3].sum(axis=0)
        assert (seen(body, looking_at(aim, 0, 55))[[1, 2]] == label).all()


@pytest.mark.parametrize("person", [pytest.param(1, marks=pytest.mark.slow), "child"])
@pytest.mark.parametrize("kind", HATS[1:])
@pytest.mark.parametrize("hair_style", HAIR_STYLES)
def test_neither_skin_nor_hair_comes_through_a_hat(person, kind, hair_style):
    body, _ = worn(person, hat=kind, hair_style=hair_style, volume=1.7)
    hat = np.isin(body.part, [FacePart.HAT, FacePart.HAT_BAND])
    colors = np.where(hat[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]).astype(np.float32)
    mesh = Mesh(body.vertices, body.faces, colors)
    crown, eyes = body.keypoints[:, :, :3].sum(axis=1)[[18, 1], 2]
    aim = body.keypoints[1, :, :3].sum(axis=0) * [1, 0, 1]
    for bearing in range(20, 360, 90):
        for height in (10, 50):
            camera = looking_at(aim, bearing, height)
            image = RasterRenderer().render(camera, [mesh])
            rows, columns = np.nonzero((image.ids == 0) & (image.rgb[..., 0] > image.rgb[..., 1]))
            pixels = np.column_stack([columns, rows, np.ones(len(rows))])
            local = (pixels @ np.linalg.inv(camera.K).T) * image.depth[rows, columns, None]
            points = (local - camera.t) @ camera.R
            assert (points[:, 2] < eyes + 0.75 * (crown - eyes)).all()


def test_accessories_have_the_colours_of_the_look():
    body, look = worn(1, hat="cap", bag="shoulder", glasses="round", mask="medical")
    colors = face_colors(body, look)
    for part, color in (
        (FacePart.HAT, look.hat_color),
        (FacePart.BAG, look.bag_color),
        (FacePart.GLASSES, look.frame_color),
        (FacePart.MASK, look.mask_color),
    ):
        np.testing.assert_allclose(colors[body.part == part], np.tile(color, (np.sum(body.part == part), 1)), atol=1e-6)


@pytest.mark.parametrize("person", [1, 2, "child"])
def test_an_arm_that_hangs_down_is_free_of_the_bag(person):
    """Else the wrist of everybody with a shoulder bag would be hidden in the bag."""
    body, look = worn(person, bag="shoulder")
    pose = neutral_transforms(dressed(person, bag="shoulder")[0])
    bag = body.skin(pose)[np.unique(body.faces[body.part == FacePart.BAG])]
    wrist = body.joints(pose)[10]
    assert np.linalg.norm(bag - wrist, axis=1).min() > body.joint_radii[10]
    assert look.bag == "shoulder"
