"""Pictures of files: their layers, the files they become, and the program's picture beside them."""

import subprocess
import sys
import warnings

import numpy
import pytest
import surfel
from conftest import pixels_of_png

SMALL = {"resolution": (64, 48), "spp": 1, "light_samples": 2}


@pytest.fixture(scope="module")
def image(hill):
    return surfel.load(hill).render(**SMALL)


def test_layers_have_their_shapes_and_are_not_copied(image):
    layers = {
        "color": ((48, 64, 4), "f4"),
        "srgb": ((48, 64, 4), "u1"),
        "coverage": ((48, 64), "f4"),
        "depth": ((48, 64), "f4"),
        "normal": ((48, 64, 3), "f4"),
        "position": ((48, 64, 3), "f8"),
        "point_ids": ((48, 64), "u4"),
        "geometry_ids": ((48, 64), "u4"),
        "instance_ids": ((48, 64), "u4"),
        "albedo": ((48, 64, 3), "f4"),
        "support_count": ((48, 64), "u4"),
        "support_distance": ((48, 64), "f4"),
    }
    for name, (shape, code) in layers.items():
        layer = getattr(image, name)
        assert layer.shape == shape and layer.dtype == numpy.dtype(code), name
        assert not layer.flags.writeable and not layer.flags.owndata, name
        assert numpy.shares_memory(layer, getattr(image, name)), name
    assert (image.width, image.height) == (64, 48)
    assert repr(image) == "<surfel.Image 64x48>"


def test_layers_say_where_nothing_was_hit(image):
    hit = image.point_ids != 0xFFFFFFFF
    assert hit[24, 32] and not hit.all()
    assert numpy.isfinite(image.depth[hit]).all() and numpy.isinf(image.depth[~hit]).all()
    assert numpy.isnan(image.position[~hit]).all()
    assert numpy.allclose(numpy.linalg.norm(image.normal[hit], axis=-1), 1, atol=1e-3)
    assert (image.instance_ids[hit] == 0).all()


def test_point_ids_are_rows_of_the_file(hill, image):
    rows = numpy.loadtxt(hill)
    hit = image.point_ids != 0xFFFFFFFF
    distances = numpy.linalg.norm(rows[image.point_ids[hit]] - image.position[hit], axis=-1)
    # Neighbouring points are 0.04 apart; at the rim the surface ends a radius behind the last of them.
    assert numpy.median(distances) < 0.03 and distances.max() < 0.12


def test_pixels_name_what_was_added(hill):
    scene = surfel.load(hill, **SMALL)
    square = surfel.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    hidden, shown = scene.add(square, visible=False, translate=(0, 0, 5)), scene.add(square, translate=(3, 0, 0))
    image = scene.render(camera_direction=(0, 0, -1))
    assert (hidden, shown) == (1, 2)
    assert set(numpy.unique(image.geometry_ids)) == {0, 2, 0xFFFFFFFF}
    assert ((image.geometry_ids == 0xFFFFFFFF) == (image.point_ids == 0xFFFFFFFF)).all()
    assert (image.position[image.geometry_ids == 2][:, 0] > 1.9).all()
    down = numpy.zeros((*image.geometry_ids.shape, 6))
    down[..., :3], down[..., 5] = image.position + [0, 0, 9], -1
    seen = image.geometry_ids == 2
    assert (scene.cast_rays(down)["geometry_ids"][seen] == 2).all()
    with pytest.raises(AttributeError, match="layers=False"):
        scene.render(layers=False).geometry_ids


def test_layers_live_longer_than_their_picture(hill):
    depth = surfel.load(hill).render(**SMALL).depth
    copy = depth.copy()
    surfel.load(hill).render(**SMALL)
    assert (depth == copy).all()


def test_pictures_without_layers_have_colour_alone(hill):
    image = surfel.load(hill).render(layers=False, **SMALL)
    assert image.color.any()
    with pytest.raises(AttributeError, match="layers=False"):
        image.depth


def test_notebooks_get_a_png(image):
    assert image._repr_png_().startswith(b"\x89PNG\r\n")


@pytest.mark.parametrize("extension", ["png", "jpg", "webp", "tif", "exr"])
def test_pictures_are_saved(image, tmp_path, extension):
    path = tmp_path / f"hill.{extension}"
    image.save(path)
    assert 100 < path.stat().st_size


def test_other_extensions_are_refused(image, tmp_path):
    with pytest.raises(surfel.InvalidFile, match="bmp"):
        image.save(tmp_path / "hill.bmp")
    with pytest.raises(surfel.InaccessibleFile, match="create it first"):
        image.save(tmp_path / "nowhere" / "hill.png")


def test_the_program_makes_the_same_picture(hill, tmp_path):
    ours, theirs = tmp_path / "library.png", tmp_path / "program.png"
    surfel.load(hill, surface="smooth", sun_azimuth=200).render(**SMALL).save(ours)
    words = ["render", hill, "-o", theirs, "--surface", "smooth", "--sun-azimuth", "200"]
    words += ["--resolution", "64x48", "--spp", "1", "--light-samples", "2", "--quiet"]
    subprocess.run([sys.executable, "-m", "surfel", *map(str, words)], check=True)
    assert ours.read_bytes() == theirs.read_bytes()


def test_keywords_of_a_picture_do_not_stay(hill):
    scene = surfel.load(hill)
    before = scene.render(**SMALL)
    other = scene.render(camera_azimuth_angle=120, **SMALL)
    again = scene.render(**SMALL)
    assert (before.color == again.color).all() and (before.color != other.color).any()


def test_display_colours_are_those_of_the_png(hill):
    image = surfel.load(hill).render(background="transparent", **SMALL)
    pixels = pixels_of_png(image._repr_png_())
    covered = image.srgb[..., 3] > 0
    assert covered.any() and not covered.all()
    assert (image.srgb[..., 3] == pixels[..., 3]).all()
    assert (image.srgb[covered] == pixels[covered]).all()


def test_choices_name_their_keys(image):
    assert any("camera" in choice and "[camera.position" in choice for choice in image.choices)


def test_pictures_of_what_is_known_list_the_same_choices(hill):
    scene = surfel.load(hill)
    first = scene.render(**SMALL).choices
    assert any("columns taken as" in choice and choice.endswith("[columns]") for choice in first)
    assert any("[radius" in choice for choice in first) and any("normals" in choice for choice in first)
    assert len(first) == len(set(first))
    turned = scene.render(camera_azimuth_angle=120, **SMALL).choices
    # The sun stands beside the camera, and lights what it shows.
    follows_camera = lambda choice: any(key in choice for key in ("[camera", "[sun", "[exposure"))
    others = [[choice for choice in choices if not follows_camera(choice)] for choices in (first, turned)]
    assert len(others[0]) >= 4 and others[0] == others[1]
    assert scene.render(**SMALL).choices == first
    # Files whose settings group them otherwise are read again, once.
    keys = {"object_settings": ["hill.xyz:color=#ff0000"], **SMALL}
    other = scene.render(**keys).choices
    scene.render(**SMALL)
    assert scene.render(**keys).choices == other and any("[columns]" in choice for choice in other)
    movies = surfel.Movie(scene, frames=2, turntable=1, **SMALL)
    assert any("[columns]" in choice for choice in movies.render(0).choices)


def test_warnings_of_all_calls_reach_the_module_warnings(hill):
    with pytest.warns(UserWarning, match=r"only for the surface cylinder.*\[reach, surface\]$"):
        scene = surfel.load(hill, reach=3)
    place = {"place": (48.1, 11.6), "light": "sun,sky"}
    with pytest.warns(UserWarning, match="below the horizon: it gives no light") as caught:
        scene.render(sun="2026-06-21T00:00:00Z", **place, **SMALL)
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.render(sun="2026-06-21T12:00:00Z", **place, **SMALL)
        with pytest.raises(UserWarning, match="below the horizon"):
            scene.render(sun="2026-06-21T00:10:00Z", **place, **SMALL)


def test_notes_and_choices_are_logged(hill, caplog):
    with caplog.at_level("INFO", logger="surfel"):
        scene = surfel.load(hill)
        scene.render(**SMALL)
    lines = [record.getMessage() for record in caplog.records if record.name == "surfel"]
    assert any("2500 points, text" in line for line in lines)
    assert any("columns taken as x y z" in line for line in lines)
    assert any("[camera.position" in line for line in lines)


def test_a_scene_file_is_a_scene(hill, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(f'resolution = "64x48"\nspp = 1\nlight_samples = 2\n[[object]]\nfile = "{hill.as_posix()}"\n')
    image = surfel.load(file).render()
    assert image.depth.shape == (48, 64) and numpy.isfinite(image.depth).any()


def test_the_description_is_complete(hill):
    keys = surfel.load(hill).describe(resolution=(64, 48))
    assert keys["resolution"] == "64x48" and len(keys["camera"]["position"]) == 3


def test_pictures_are_arrays_of_their_colours(image):
    assert image.shape == (48, 64, 4) == numpy.asarray(image).shape
    assert numpy.shares_memory(numpy.asarray(image), image.color) and (numpy.asarray(image) == image.color).all()
    assert numpy.asarray(image, dtype="f8").dtype == numpy.float64
    assert not numpy.shares_memory(numpy.array(image), image.color)
