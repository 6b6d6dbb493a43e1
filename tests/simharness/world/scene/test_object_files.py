"""Objects from files: what they show and stop, where they stand, messages, identity; those shipped."""

from typing import get_args

import cv2
import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image
from walkers import Rays, space

from mvpose.skeleton import COCO17
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.identity import trial_identity
from simharness.world.motion.motion import PropKind
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.object_files import ASSETS, load_object, load_shipped, object_dependencies, variants
from simharness.world.scene.placement.clutter import CLUTTER_KINDS, place_clutter
from simharness.world.scene.placement.free_space import WALL_MARGIN
from simharness.world.scene.placement.sight_lines import intersects
from simharness.world.scene.rooms.kinds import LampKind, room_kinds

FITTINGS = sorted(ASSETS.glob("fitting_*.xml"))
STOOL = """
<mujoco>
  <worldbody>
    <geom type="box" size="0.2 0.2 0.02" pos="0 0 0.48" rgba="0.8 0.2 0.1 1"/>
    <geom type="cylinder" fromto="0 0 0 0 0 0.46" size="0.05"/>
    <geom type="box" size="5 5 5" group="3"/>
    <geom type="box" size="5 5 5" rgba="1 1 1 0"/>
  </worldbody>
</mujoco>
"""
CRATE = """
mtllib crate.mtl
v -0.3 -0.2 0
v 0.3 -0.2 0
v 0.3 0.2 0
v -0.3 0.2 0
v -0.3 -0.2 1
v 0.3 -0.2 1
v 0.3 0.2 1
v -0.3 0.2 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl red
f 4 3 2 1
f 5/1 6/2 7/3 8/4
f 1 2 6 5
usemtl blue
f 2 3 7 6
f -6 -5 -1 -2
f 4 1 5 8
"""
MATERIALS = "newmtl red\nKd 0.8 0.1 0.1\nnewmtl blue\nKd 0.1 0.1 0.8\n"


@pytest.fixture
def write(tmp_path):
    (tmp_path / "crate.mtl").write_text(MATERIALS)

    def written(name, content):
        (tmp_path / name).write_text(content)
        return tmp_path / name

    return written


def volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


@pytest.mark.parametrize(
    ("geom", "expected"),
    [
        ('type="box" size="0.1 0.2 0.3"', 0.048),
        ('type="cylinder" size="0.2 0.5"', np.pi * 0.04),
        ('type="sphere" size="0.3"', 4 / 3 * np.pi * 0.027),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 4 / 3 * np.pi * 0.006),
        ('type="capsule" size="0.2 0.3"', np.pi * 0.04 * 0.6 + 4 / 3 * np.pi * 0.008),
    ],
)
def test_every_geom_is_shown_with_its_volume_at_its_place(write, geom, expected):
    file = write("one.xml", f'<mujoco><worldbody><geom {geom} pos="3 2 5" euler="20 30 40"/></worldbody></mujoco>')
    mesh = load_object(file).mesh()
    assert volume(mesh) == pytest.approx(expected, rel=0.06)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose([*(low + high)[:2], low[2]], 0.0, atol=1e-6)  # centred, and it stands on the floor


def test_what_mujoco_hides_is_neither_shown_nor_in_the_way(write):
    object_ = load_object(write("stool.xml", STOOL))
    mesh = object_.mesh()
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.4, 0.4, 0.5], atol=1e-6)
    assert {tuple(color) for color in mesh.colors.astype(float).round(3).tolist()} == {(0.8, 0.2, 0.1), (0.5, 0.5, 0.5)}
    assert mesh.texture is None
    assert len(object_.model().geoms) == 2


def test_meshes_and_pictures_of_a_material_are_shown(write, tmp_path):
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:4] = (10, 200, 30)  # the upper half, blue green red
    cv2.imwrite(str(tmp_path / "picture.png"), picture)
    file = write(
        "board.xml",
        """<mujoco><asset><texture name="picture" type="2d" file="picture.png"/>
        <material name="print" texture="picture" rgba="1 0.5 1 1"/>
        <mesh name="board" inertia="shell" vertex="0 0 0  0 1 0  0 1 1  0 0 1" texcoord="0 1 1 1 1 0 0 0"
              face="0 1 2 0 2 3"/></asset>
        <worldbody><geom type="mesh" mesh="board" material="print" contype="0" conaffinity="0"/>
        <geom type="box" size="0.1 0.1 0.1"/></worldbody></mujoco>""",
    )
    mesh = load_object(file).mesh()
    board = mesh.vertices[mesh.faces[:2]]
    texel = mesh.uv[:2] * mesh.texture.shape[1::-1]
    assert np.ptp(board[..., 1]) == pytest.approx(1.0)
    up = np.polyfit(board[..., 2].ravel(), texel[..., 1].ravel(), 1)[0]
    assert up == pytest.approx(-8.0)  # rows run downwards
    middle = mesh.texture[tuple(texel.mean(axis=1)[0].astype(int)[::-1])]
    assert {tuple(middle)} <= {(30, 200, 10), (0, 0, 0)}
    np.testing.assert_allclose(mesh.colors[0], (1, 0.5, 1))
    plain = (mesh.uv[2:].reshape(-1, 2) * mesh.texture.shape[1::-1]).astype(int)
    assert (mesh.texture[plain[:, 1], plain[:, 0]] == 255).all()


def test_an_obj_file_has_the_colours_of_its_materials(write):
    mesh = load_object(write("crate.obj", CRATE)).mesh()
    assert volume(mesh) == pytest.approx(0.24, rel=1e-5)
    assert len(mesh.faces) == 12
    assert {tuple(color) for color in mesh.colors.astype(float).round(3).tolist()} == {(0.8, 0.1, 0.1), (0.1, 0.1, 0.8)}
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    assert len(mesh.vertices) == 24, "edges of a box are sharp"
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c - 3 * np.array([0, 0, 0.5])) > 0).all()


def gltf(path, *meshes):
    """Write meshes of trimesh, each with its place and material, as a glTF file."""
    scene = trimesh.Scene()
    for mesh, place, material, uv in meshes:
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=trimesh.visual.material.PBRMaterial(**material))
        scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix(place))
    scene.export(path)
    return path


@pytest.mark.parametrize("name", ["bed.glb", "bed.gltf"])
def test_a_gltf_file_is_shown_upright_with_its_nodes_and_base_colours(tmp_path, name):
    # In glTF x is to the left, y up and z to the front: a bed 1 wide and 2 long, with a pillow on its front end.
    bed = trimesh.creation.box((1.0, 0.4, 2.0)), (0, 3, 0), {"baseColorFactor": [0.5, 0.2, 0.0, 1.0]}, None
    pillow = trimesh.creation.box((0.5, 0.1, 0.3)), (0.2, 3.25, 0.85), {"baseColorFactor": [1.0, 1.0, 1.0, 1.0]}, None
    file = gltf(tmp_path / name, bed, pillow)
    mesh = load_object(file).mesh()
    is_white = mesh.colors[:, 1] > 0.99
    on_top, below = (mesh.vertices[mesh.faces[each]].reshape(-1, 3) for each in (is_white, ~is_white))
    np.testing.assert_allclose([below.min(axis=0), below.max(axis=0)], [[-1, -0.5, 0], [1, 0.5, 0.4]], atol=1e-5)
    np.testing.assert_allclose([on_top.min(axis=0), on_top.max(axis=0)], [[0.7, -0.05, 0.4], [1, 0.45, 0.5]], atol=1e-5)
    # sRGB values of the linear ones (IEC 61966-2-1), which the file keeps in steps of 1/255.
    np.testing.assert_allclose(mesh.colors[~is_white][0], [0.735, 0.485, 0.0], atol=0.005)
    assert volume(mesh) == pytest.approx(0.8 + 0.015, rel=1e-5), "faces look outwards"
    beside = {each for each in tmp_path.iterdir() if each != file}
    assert set(object_dependencies(file)) == {file, *beside}
    assert bool(beside) == (name == "bed.gltf")


def test_names_in_a_gltf_file_are_percent_encoded_and_may_be_damaged(tmp_path):
    file = tmp_path / "bed.gltf"
    file.write_text('{"buffers": [{"uri": "my%20bed.bin"}, {"uri": "data:;base64,AA=="}, 3], "images": 7}')
    assert object_dependencies(file) == (file, tmp_path / "my bed.bin")


def test_the_picture_of_a_gltf_material_is_upright(tmp_path):
    picture = np.full((8, 8, 3), 255, np.uint8)
    picture[:4] = (30, 200, 10)  # the upper half
    corners = [[-1, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 1, 0]]
    board = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    material = {"baseColorTexture": Image.fromarray(picture)}
    mesh = load_object(
        gltf(tmp_path / "board.glb", (board, (0, 0, 0), material, [[0, 0], [1, 0], [1, 1], [0, 1]]))
    ).mesh()
    height = mesh.vertices[mesh.faces][..., 2].mean(axis=1)
    column, row = np.moveaxis((mesh.uv.mean(axis=1) * mesh.texture.shape[1::-1]).astype(int), -1, 0)
    upper, lower = mesh.texture[row, column][np.argsort(height)[::-1]].tolist()
    assert (upper, lower) == ([30, 200, 10], [255, 255, 255])


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"glTF", "not a valid glTF 2.0 file"), (b"", "not a valid glTF 2.0 file"), (None, "it has no triangles")],
)
def test_a_file_that_is_no_gltf_object_is_refused(tmp_path, content, message):
    file = tmp_path / "bed.glb"
    if content is None:
        trimesh.Scene([trimesh.load_path([[0, 0, 0], [1, 0, 0]])]).export(file)
    else:
        file.write_bytes(content)
    with pytest.raises(ValueError, match=rf"bed.glb: cannot be read as an object: {message}"):
        load_object(file)


def test_files_beside_an_object_belong_to_it(write, tmp_path):
    file = write("crate.obj", CRATE)
    (tmp_path / "crate.mtl").write_text(MATERIALS + "map_Kd wood.png\n")
    assert {each.name for each in object_dependencies(file)} == {"crate.obj", "crate.mtl", "wood.png"}
    mesh = write("part.obj", CRATE)
    other = write(
        "other.xml",
        '<mujoco><asset><mesh file="part.obj"/></asset><worldbody><geom type="mesh" mesh="part"/></worldbody></mujoco>',
    )
    assert mesh.resolve() in {each.resolve() for each in object_dependencies(other)}


@pytest.mark.parametrize("name", ["stool.xml", "crate.obj"])
def test_an_object_of_a_file_is_placed_clear_of_people_by_the_seed(write, name):
    file = write(name, STOOL if name == "stool.xml" else CRATE)
    free = space(4, duration=1.0)
    clutter = ClutterSection(objects=(str(file), str(file)), boxes=1)
    placed = place_clutter(3, clutter, free)
    assert [solid.name for solid in placed] == [f"object0 {file.stem}", f"object1 {file.stem}", "box0"]
    for k, solid in enumerate(placed):
        assert solid.kind == "clutter"
        assert not free.obstructed(solid.hull)
        assert all(solid.hull.gap_on_floor(other.hull) > 0 for other in placed[:k])
    again, other = place_clutter(3, clutter, free), place_clutter(4, clutter, free)
    np.testing.assert_array_equal(placed[0].mesh.vertices, again[0].mesh.vertices)
    assert not np.array_equal(placed[0].mesh.vertices, other[0].mesh.vertices)
    alone = place_clutter(3, ClutterSection(objects=(str(file),)), free)
    np.testing.assert_array_equal(alone[0].mesh.vertices, placed[0].mesh.vertices)


@pytest.mark.parametrize("name", ["stool.xml", "crate.obj"])
def test_rays_hit_what_pictures_show_of_a_file(write, name):
    file = write(name, STOOL if name == "stool.xml" else CRATE)
    placed = place_clutter(5, ClutterSection(objects=(str(file),)), space(2, duration=1.0))
    triangles = placed[0].mesh.vertices[placed[0].mesh.faces].astype(float)
    start = np.array([0.0, 0.0, 2.5])
    ends = start + 1.5 * (triangles.mean(axis=1) - start)
    hits = Rays(placed).distance(start, ends)
    for end, hit in zip(ends, hits, strict=True):
        way = (end - start) / np.linalg.norm(end - start)
        a, b, c = np.moveaxis(triangles, 1, 0)
        matrix = np.stack([b - a, c - a, np.broadcast_to(start - end, a.shape)], axis=-1)
        good = np.abs(np.linalg.det(matrix)) > 1e-12
        u, v, t = np.linalg.solve(matrix[good], (start - a[good])[..., None])[..., 0].T
        first = t[(u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6)].min()
        assert hit == pytest.approx(first, abs=1e-4), way


def test_sites_of_all_joints_make_a_decoy(write):
    sites = "".join(f'<site name="{joint}" pos="0 0 {0.1 * k}"/>' for k, joint in enumerate(COCO17.joints))
    plain, decoy = (
        load_object(write("stool.xml", STOOL)),
        load_object(write("decoy.xml", STOOL.replace("</worldbody>", f"{sites}</worldbody>"))),
    )
    assert plain.model().figure is None
    np.testing.assert_allclose(decoy.model().figure[:, 2], 0.1 * np.arange(17), atol=1e-7)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("no.xml", None, "no.xml.*(does not exist|no such file)"),
        ("broken.xml", "<mujoco><worldbody><geom", "broken.xml: cannot be read as an object"),
        ("empty.xml", "<mujoco/>", "empty.xml: cannot be read as an object: it has no geom that is visible"),
        ("plane.xml", STOOL.replace('type="box" size="0.2 0.2', 'type="plane" size="1 1'), "expected box, sphere"),
        ("large.xml", STOOL.replace('size="0.2 0.2', 'size="200 200'), r"400 x 400 x .* m large.*metres, so scale"),
        ("empty.obj", "v 0 0 0\n", "no faces"),
        ("corner.obj", "v 0 0 0\nf 1 2 3\n", "line 2: corner '2' refers to a vertex that does not come before it"),
        ("text.obj", "v 0 0 zero\n", "line 1: could not convert"),
    ],
)
def test_a_file_that_is_no_object_is_refused(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=f"(?i){message}"):
        load_object(tmp_path / name)


def test_other_kinds_of_files_are_refused_with_the_scenario():
    with pytest.raises(ValueError, match=r"'chair.stl' is no file of an object: expected a name that ends in .xml"):
        ClutterSection(objects=("chair.stl",))


def test_an_object_that_fits_nowhere_is_named(write):
    file = write("hall.xml", STOOL.replace('size="0.2 0.2', 'size="6 6'))
    with pytest.raises(ValueError, match=r"clutter.objects: found no place for .*hall.xml, 12.00 x 12.00 x 0.50 m"):
        place_clutter(0, ClutterSection(objects=(str(file),)), space(1, duration=1.0))


def test_the_contents_of_objects_count_in_the_identity_of_a_trial(write):
    file = write("crate.obj", CRATE)
    scenario = Scenario(name="objects", clutter=ClutterSection(objects=(str(file),)))
    before = trial_identity(scenario)
    assert trial_identity(scenario) == before
    write("crate.mtl", MATERIALS.replace("0.8", "0.7"))
    repainted = trial_identity(scenario)
    write("crate.obj", CRATE.replace("v -0.3", "v -0.4"))
    assert len({before, repainted, trial_identity(scenario)}) == 3


def test_rooms_name_objects_that_ship():
    assert {name for name, kind in room_kinds().items() if not kind.furniture} == {"laboratory"}
    names = {name for kind in room_kinds().values() for name in kind.furniture}
    assert all(variants(name)[0].is_file() for name in names)
    files = {file.name.partition(".")[0] for file in {*ASSETS.glob("*.xml")} - {*FITTINGS}}
    decoys = {"poster", "wall_poster", "mirror", "wall_mirror", "coat_stand"}
    props = set(get_args(PropKind)) - {"box"}
    clutter = {kind.file or kind.name for kind in CLUTTER_KINDS} - {"box", "shelf"} | {"cart"}
    assert files == names | {"far_tree", "far_shrub"} | decoys | props | clutter


@pytest.mark.parametrize("name", ["chair", "potted_plant", "laid_table", "cart"])
def test_a_stretched_object_is_as_large_as_its_scale_says(name):
    """Mesh and geoms are stretched alike: the seat of a chair with its depth, width and height."""
    file, scale = load_shipped(variants(name)[0]), np.array([1.1, 0.8, 1.3])
    model = file.model(scale=scale)
    np.testing.assert_allclose(model.extent.half, file.model().extent.half * scale, rtol=1e-5)
    solid = model.at((0.0, 0.0), 0.0, kind="clutter", name=name)
    middle, half = np.array(solid.hull.center), np.array(solid.hull.half)
    start = middle + [2.0, 1.0, 1.5]
    ends = start + 2 * (middle + np.random.default_rng(0).uniform(-1, 1, (200, 3)) * half - start)
    met = np.isfinite(Rays([solid]).distance(start, ends))
    assert met.any()
    assert (met == intersects(solid.mesh, np.tile(start, (200, 1)), ends)).mean() > 0.97


MIRROR = """<mujoco><asset><material name="glass" reflectance="0.8"/></asset><worldbody>
<geom type="box" size="0.02 0.4 0.8" pos="0.3 0 0.9" material="glass"/></worldbody></mujoco>"""


def test_a_box_that_reflects_is_a_mirror(write):
    glass = load_object(write("mirror.xml", MIRROR)).model().mirror
    np.testing.assert_allclose(glass.center, (0.02, 0.0, 0.8), atol=1e-9)
    assert (glass.normal, glass.half) == ((1.0, 0.0, 0.0), (0.4, 0.8))
    assert load_object(write("dull.xml", MIRROR.replace('0.8"/>', '0.3"/>', 1))).model().mirror is None


@pytest.mark.parametrize("file", FITTINGS, ids=lambda file: file.stem)
def test_a_fitting_fills_its_place_and_stands_out_less_than_a_camera(file):
    fitting, sheet = load_shipped(file), draw_sheet(0)
    low, high = np.array([0.0, 1.0, 0.2]), np.array([1.0, 1.5, 0.5])
    placed, own = fitting.fitting(sheet, (low, high)).vertices, fitting.mesh(sheet).vertices / fitting.size
    np.testing.assert_allclose((placed - low) / (high - low), own, atol=1e-5)
    if file.stem.split("_")[1].split(".")[0] not in get_args(LampKind):
        assert own[:, 0].max() < WALL_MARGIN
        np.testing.assert_allclose([own[:, 1:].min(), own[:, 1:].max()], [0.0, 1.0], atol=0.25)


@pytest.mark.parametrize("file", sorted({*ASSETS.glob("*.xml")} - {*FITTINGS}), ids=lambda file: file.stem)
def test_a_shipped_object_opens_in_mujoco_and_stands_on_the_floor(file):
    model = mujoco.MjModel.from_xml_path(str(file))
    object_, sheet = load_shipped(file), None if file.stem.split(".")[0] in ("poster", "wall_poster") else draw_sheet(0)
    mesh = load_shipped(file).mesh() if sheet is None else object_.mesh(sheet)
    assert len(object_.parts) == model.ngeom
    assert sheet is None or mesh.texture is sheet.texture
    if file.stem.startswith("wall_") and not file.stem.startswith("wall_bars"):  # it hangs on the plane x = 0
        assert 0.0 <= mesh.vertices[:, 0].min() < 0.01
        assert 0.05 < mesh.vertices[:, 2].min() < 0.15
    else:
        assert mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    assert abs(object_.offset[2]) < 0.02
    assert 0.2 < np.ptp(mesh.vertices, axis=0).max() < 8.0
    assert mesh.uv.min() >= 0.0
    assert mesh.uv.max() <= 1.0


def test_the_shipped_objects_stay_small():
    sizes = [file.stat().st_size for file in ASSETS.rglob("*") if file.is_file()]
    assert sum(sizes) < 3_000_000
    assert max(sizes) < 300_000
