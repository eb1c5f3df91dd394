"""Scenes of clouds, meshes and files: places, materials, numbers of what was added."""

import types
import warnings

import numpy
import pytest
import surfel
from conftest import hill_points

SMALL = {"resolution": (64, 48), "spp": 1, "light_samples": 1}
SQUARE = surfel.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def down(x, y, z=10.0):
    return [x, y, z, 0.0, 0.0, -1.0]


def test_a_cloud_of_arrays_renders_as_its_file_does(hill):
    scene = surfel.Scene(**SMALL)
    assert scene.add(surfel.Cloud(numpy.loadtxt(hill))) == 0
    ours, theirs = scene.render(up="+Z"), surfel.load(hill, up="+Z").render(**SMALL)
    assert (ours.color == theirs.color).all() and (ours.point_ids == theirs.point_ids).all()


def test_things_are_numbered_and_placed(hill, points):
    scene = surfel.Scene()
    shift = numpy.eye(4)
    shift[0, 3] = 10
    assert scene.add(surfel.Cloud(points), name="wall") == 0
    assert scene.add(SQUARE, transform=shift) == 1
    assert scene.add(hill, translate=(20, 0, 0), scale=2) == 2
    hits = scene.cast_rays([down(0, 0), down(10, 0.5), down(20, 0), down(30, 0)])
    assert hits["geometry_ids"].tolist() == [0, 1, 2, 0xFFFFFFFF]
    assert numpy.allclose(hits["t_hit"][:3], [9.5, 10, 9], atol=0.02)
    assert hits["point_ids"][1] == 0xFFFFFFFF and hits["primitive_ids"][1] < 2
    assert numpy.hypot(*points[hits["point_ids"][0], :2]) < 0.1
    assert numpy.allclose(scene.bounds[:, 0], [-1, 22], atol=0.5)
    assert repr(scene) == "<surfel.Scene of 0 files and 3 objects>"


def test_one_cloud_is_shown_at_several_places(points):
    scene, cloud = surfel.Scene(), surfel.Cloud(points)
    for x in (0, 5, 10):
        scene.add(cloud, translate=(x, 0, 0))
    hits = scene.cast_rays([down(0, 0), down(5, 0), down(10, 0)])
    assert hits["geometry_ids"].tolist() == [0, 1, 2]
    assert len(set(hits["point_ids"].tolist())) == 1


def test_added_things_follow_files(hill):
    scene = surfel.load(hill)
    assert scene.add(SQUARE, translate=(10, 0, 0)) == 1
    assert scene.cast_rays([down(0, 0), down(10, 0)])["geometry_ids"].tolist() == [0, 1]


def test_a_file_with_settings_of_its_own_comes_after_what_is_added(hill):
    scene = surfel.load(hill, object_settings=["hill.xyz:color=elevation"])
    assert scene.add(SQUARE, translate=(10, 0, 0)) == 0
    assert scene.cast_rays([down(0, 0), down(10, 0)])["geometry_ids"].tolist() == [1, 0]


def test_filters_hold_for_all_files_of_a_sequence(tmp_path):
    for i, z in enumerate([0, 1]):
        numpy.savetxt(tmp_path / f"hill{i}.xyz", hill_points(offset=(0, 0, z)))
    (tmp_path / "scene.toml").write_text('[[object]]\nfiles = ["hill0.xyz", "hill1.xyz"]\nfps = 1\n')
    keys = {"filter": "x < 0", "camera_position": (0, -4, 5), "camera_focal_point": (0, 0, 0.5), "up": "+Z", **SMALL}
    sequence = surfel.load(tmp_path / "scene.toml", **keys)
    for i in range(2):
        ours, alone = sequence.render(time=i), surfel.load(tmp_path / f"hill{i}.xyz", **keys).render()
        assert (ours.depth == alone.depth).all() and (ours.point_ids == alone.point_ids).all(), i
        shown = ours.position[numpy.isfinite(ours.depth)]
        assert 0 < len(shown) and shown[:, 0].max() < 0.1, i


def test_keys_that_count_while_files_are_read_hold_for_pictures(tmp_path):
    corners = [f"v {x} {y} 0\n" for x in range(5) for y in range(5)]
    (tmp_path / "mesh.obj").write_text("".join(corners) + "f 1 5 25 21\n")
    scene = surfel.load(tmp_path / "mesh.obj", **SMALL)
    points = surfel.load(tmp_path / "mesh.obj", vertices=True, **SMALL).render()
    assert scene.render().point_ids.min() == 0 and (scene.render(vertices=True).color == points.color).all()
    assert not (scene.render().color == points.color).all()


def test_settings_by_name_hold_for_pictures(hill):
    red = surfel.load(hill, object_settings=["hill.xyz:color=#ff0000"]).render(**SMALL)
    assert (red.color == surfel.load(hill, color="#ff0000").render(**SMALL).color).all()


def test_all_files_together_have_one_number(hill, tmp_path):
    house = tmp_path / "house.obj"
    house.write_text("v 4 -1 0\nv 6 -1 0\nv 6 1 0\nv 4 1 0\nf 1 2 3 4\n")
    scene = surfel.load(hill, house)
    assert scene.add(SQUARE, translate=(10, 0, 0)) == 1
    hits = scene.cast_rays([down(0, 0), down(5, 0.5), down(10, 0.5)])
    assert hits["geometry_ids"].tolist() == [0, 0, 1]


def test_materials_are_those_of_scene_files(hill, tmp_path):
    camera = {"camera_position": (0, -4, 3), "camera_focal_point": (0, 0, 0)}
    written = {
        "": None,
        'material = "mirror"': "mirror",
        'material = { kind = "plastic", roughness = 0.2 }': {"kind": "plastic", "roughness": 0.2},
    }
    pictures = []
    for line, material in written.items():
        scene = surfel.Scene(**camera, **SMALL)
        scene.add(hill, material=material)
        pictures.append(scene.render().color)
        (tmp_path / "scene.toml").write_text(f'[[object]]\nfile = "{hill.as_posix()}"\n{line}\n')
        assert (pictures[-1] == surfel.load(tmp_path / "scene.toml", **camera, **SMALL).render().color).all()
    assert (pictures[0] != pictures[1]).any() and (pictures[0] != pictures[2]).any()


def test_scalars_colour_a_cloud(points):
    ages = numpy.arange(len(points)).astype("f4")
    scene = surfel.Scene(light="none", **SMALL)
    scene.add(surfel.Cloud(points, scalars={"age": ages}), color="age", cmap="viridis")
    image = scene.render()
    hit = image.point_ids != 0xFFFFFFFF
    assert 50 < len(numpy.unique(image.srgb[hit], axis=0))


def test_filters_keep_the_ids_of_the_array(points):
    scene = surfel.Scene(**SMALL)
    scene.add(surfel.Cloud(points), filter="z > 0.2")
    ids = scene.render().point_ids
    shown = ids[ids != 0xFFFFFFFF]
    assert shown.size and (points[shown, 2] > 0.2).all()
    assert scene.add(SQUARE, visible=False) == 1


@pytest.mark.parametrize(
    ("geometry", "keywords", "error", "words"),
    [
        (SQUARE, {"trnslate": (1, 2, 3)}, surfel.InvalidSetting, "^trnslate: unknown key; the nearest known one is `translate`"),
        (SQUARE, {"translate": "far"}, surfel.InvalidSetting, "^translate: found"),
        (SQUARE, {"material": "velvet"}, surfel.InvalidSetting, "velvet"),
        (SQUARE, {"transform": numpy.eye(3)}, surfel.InvalidArray, "transform: expected a 4x4 matrix"),
        (SQUARE, {"transform": numpy.eye(4).ravel()}, surfel.InvalidArray, "transform: expected a 4x4 matrix"),
        (SQUARE, {"transform": numpy.eye(4) + numpy.eye(4)[::-1]}, surfel.InvalidArray, "0, 0, 0, 1 as the last row"),
        (SQUARE, {"transform": numpy.diag([0, 0, 0, 1.0])}, surfel.InvalidSetting, "flat, empty or infinite"),
        (SQUARE, {"transform": numpy.diag([numpy.nan, 1, 1, 1])}, surfel.InvalidSetting, "found NaN"),
        (SQUARE, {"parent": "nobody"}, surfel.InvalidSetting, "no object `nobody`"),
        ("nowhere.ply", {}, surfel.MissingFile, "nowhere.ply"),
        (42, {}, surfel.InvalidArray, "points: found an object of type int"),
        (object(), {}, surfel.InvalidArray, "points: found"),
    ],
)
def test_what_cannot_be_added_changes_nothing(geometry, keywords, error, words):
    scene = surfel.Scene()
    with pytest.raises(error, match=words):
        scene.add(geometry=geometry, **keywords)
    assert repr(scene) == "<surfel.Scene of 0 files and 0 objects>"


def test_parents_move_their_children(points):
    scene = surfel.Scene()
    scene.add(surfel.Cloud(points), name="ground", translate=(5, 0, 0))
    scene.add(SQUARE, parent="ground", translate=(0, 5, 3))
    assert scene.cast_rays([down(5, 5)])["t_hit"].tolist() == [7.0]


def test_keys_that_need_another_opening_count(hill, tmp_path):
    scene = surfel.load(hill, **SMALL)
    with pytest.raises(surfel.MissingFile, match="no.hdr"):
        scene.render(environment=tmp_path / "no.hdr")
    with pytest.raises(surfel.OutOfMemory):
        scene.render(memory_limit="1K")
    with pytest.raises(surfel.InvalidSetting, match="camera.name"):
        scene.render(camera_name="nobody")
    with pytest.raises(surfel.InvalidSetting, match="no file or object `nope`"):
        scene.render(material="nope=mirror")
    with pytest.raises(surfel.InvalidSetting, match="scale_bar"):
        scene.render(scale_bar=True)
    with pytest.raises(surfel.InvalidSetting, match="output"):
        scene.render(output="picture.png")
    assert (scene.render(threads=1).color == scene.render().color).all()


def test_rays_need_a_surface(points):
    scene = surfel.Scene(surface="points")
    scene.add(surfel.Cloud(points))
    with pytest.raises(surfel.InvalidSetting, match="points have no surface"):
        scene.cast_rays([down(0, 0)])


@pytest.mark.parametrize("keys", [{"color": "red"}, {"filter": "z > 0"}])
def test_keywords_for_points_without_effect_on_a_mesh_are_told(points, keys):
    scene = surfel.Scene(**SMALL)
    scene.add(surfel.Cloud(points), **keys)
    scene.add(SQUARE, name="board", translate=(5, 0, 0), **keys)
    words = rf"object `board`: settings for points do not change triangles.* \[{list(keys)[0]}, material\]"
    with pytest.warns(UserWarning, match=words) as caught:
        scene.render()
    assert len(caught) == 1


def test_materials_colour_meshes_without_a_warning():
    scene = surfel.Scene(camera_direction=(0, 0, -1), **SMALL)
    scene.add(SQUARE, material=types.MappingProxyType({"color": "#ff0000"}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert scene.render().albedo[24, 32].tolist() == [1, 0, 0]


def test_names_are_given_once(points):
    scene = surfel.Scene()
    scene.add(SQUARE, name="board")
    with pytest.raises(surfel.InvalidSetting, match="^name: another object is `board` already; choose another name"):
        scene.add(surfel.Cloud(points), name="board")
    # Names that are not given are free ones.
    scene.add(SQUARE, name="object 2")
    assert scene.add(surfel.Cloud(points)) == 2
    assert [thing["name"] for thing in scene.describe()["object"]] == ["board", "object 2", "object 3"]


@pytest.mark.parametrize(
    "use",
    [
        lambda scene: scene.render(),
        lambda scene: scene.bounds,
        lambda scene: scene.cast_rays([down(0, 0)]),
        lambda scene: surfel.Movie(scene, turntable=1),
        lambda scene: surfel.animate(scene, "turn.gif", turntable=1),
        lambda scene: surfel.view(scene),
        lambda scene: surfel.load(),
    ],
)
def test_scenes_without_objects_say_how_to_add_some(use):
    with pytest.raises(surfel.InvalidSetting, match="^the scene has no objects: add a Cloud, a Mesh or a file with scene.add"):
        use(surfel.Scene())
