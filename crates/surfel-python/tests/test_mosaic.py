"""Plans of survey tiles: what is put together from tiles with rims is the plan of the whole."""

import functools

import numpy
import pytest
import surfel
from conftest import pixels_of_png, tags_of_tiff

dask = pytest.importorskip("dask")
from surfel.dask import Recipe, render_mosaic  # noqa: E402
from surfel.dask._mosaic import Layout, _survey  # noqa: E402

ORIGIN = numpy.array([691_000.013, 5_334_000.017, 500.0])
IMAGE_LENGTH, MODEL_PIXEL_SCALE, MODEL_TIEPOINT, GEO_KEYS = 257, 33550, 33922, 34735
#: Key of the projected coordinate system among those of GeoTIFF.
PROJECTED_SYSTEM = 3072
KEYS = {"gsd": 0.25, "spp": 1, "light_samples": 4}


def terrain(n=161):
    """Points of hills on a square of 40 m, with a wall of 6 m in its middle, whose shadow crosses tiles."""
    x, y = (axis.ravel() for axis in numpy.meshgrid(numpy.linspace(0, 40, n), numpy.linspace(0, 40, n)))
    ground = numpy.stack([x, y, numpy.sin(x / 5) + numpy.cos(y / 7)], axis=1)
    u, v = (axis.ravel() for axis in numpy.meshgrid(numpy.linspace(8, 32, 97), numpy.linspace(0, 6, 25)))
    wall = numpy.stack([u, numpy.full_like(u, 19.9), v + 1], axis=1)
    return numpy.concatenate([ground, wall]) + ORIGIN


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """Files of four tiles, and one of all their points in the same order."""
    folder = tmp_path_factory.mktemp("survey")
    points = terrain()
    east, north = (points[:, axis] >= ORIGIN[axis] + 20.05 for axis in (0, 1))
    tiles = []
    for i, own in enumerate([~east & ~north, east & ~north, ~east & north, east & north]):
        tiles.append(folder / f"tile_{i}.xyz")
        numpy.savetxt(tiles[-1], points[own], fmt="%.3f")
    return tuple(tiles)


@functools.lru_cache
def layout(tiles, rim=None, **keys):
    recipes = tuple(Recipe(tile, **KEYS, **keys) for tile in tiles)
    return Layout(recipes, [_survey(recipe) for recipe in recipes], rim)


def whole(tiles, layout):
    """The plan of all tiles in one scene."""
    return surfel.load(*tiles, **layout.keys).render()


def test_a_mosaic_is_the_plan_of_the_whole(survey, tmp_path):
    recipes = [Recipe(tile, **KEYS) for tile in survey]
    found = pixels_of_png(render_mosaic(recipes).compute()).astype(int)
    expected = whole(survey, layout(survey))
    assert found.shape[:2] == (expected.height, expected.width) == (161, 161)
    expected.save(tmp_path / "whole.png")
    difference = abs(found - pixels_of_png((tmp_path / "whole.png").read_bytes())).max(axis=2)
    # Blocks of eight points keep positions in steps of their own size, and the blocks of a tile are others than those of
    # the whole: surfaces move by less than a thousandth of the spacing of points. Colours round otherwise by one step, and
    # a pixel at the edge of a shadow may show the other side.
    assert (difference > 0).mean() < 0.05, (difference > 0).mean()
    assert (difference > 1).mean() < 0.001, (difference > 1).mean()


def test_a_mosaic_of_one_tile_is_its_plan(survey, tmp_path):
    found = render_mosaic([Recipe(survey[0], **KEYS)]).compute()
    # With an edge of the rim's filter nothing differs.
    whole(survey[:1], layout(survey[:1])).save(tmp_path / "whole.png")
    assert found == (tmp_path / "whole.png").read_bytes()


def test_without_a_rim_shadows_end_at_edges(survey):
    """The rim is what makes a plan seamless."""
    recipes = [Recipe(tile, **KEYS) for tile in survey]
    with_rim, without = (pixels_of_png(render_mosaic(recipes, rim=rim).compute()).astype(int) for rim in (None, 0))
    difference = abs(with_rim - without).max(axis=2)
    assert (numpy.concatenate([difference[:, 78:83].ravel(), difference[78:83].ravel()]) > 4).mean() > 0.1


def test_each_pixel_has_one_tile_and_each_tile_its_rim(survey):
    found = layout(survey, rim=3)
    owners = found.owners()
    assert owners.shape == (161, 161) and owners.min() == 0 and owners.max() == 3
    for i, ((x0, x1), (y0, y1)) in enumerate(found.regions):
        rows, columns = numpy.nonzero(owners == i)
        assert (columns.min(), columns.max() + 1, rows.min(), rows.max() + 1) == (x0, x1, y0, y1)
    west, south, east, north = found.recipe(0).keys["crop"]
    assert abs(west + 3 - ORIGIN[0]) < 0.3 and abs(south + 3 - ORIGIN[1]) < 0.3
    assert abs(east - 23 - ORIGIN[0]) < 0.3 and abs(north - 23 - ORIGIN[1]) < 0.3
    assert len(found.recipe(0).paths) == 4


def test_tiles_beyond_the_rim_are_not_read(survey, tmp_path):
    far = tmp_path / "far.xyz"
    numpy.savetxt(far, numpy.loadtxt(survey[0]) + (60, 0, 0), fmt="%.3f")
    found = layout((survey[0], far), rim=3)
    assert [list(found.recipe(i).paths) for i in (0, 1)] == [[str(survey[0])], [str(far)]]
    assert len(layout((survey[0], far), rim=50).recipe(0).paths) == 2


def test_the_ranges_of_colours_are_common(survey):
    found = layout(survey, color="elevation")
    ranges = [_survey(recipe)[2] for recipe in found.recipes]
    assert found.keys["range"] == (min(low for low, _ in ranges), max(high for _, high in ranges))
    assert layout(survey, color="elevation", range=(490, 520)).keys["range"] == [490, 520]


def test_dicts_leave_what_they_do_not_say_common(survey):
    """A key of a dict counts as the keyword of its name does."""
    keys = {"light": ("sun", "sky")}
    dicts = layout.__wrapped__(survey, **keys, sky={"strength": 2}, sun={"strength": 2})
    words = layout(survey, **keys, sky_strength=2, sun_strength=2)
    assert dicts.keys["sky"]["ao_distance"] == words.keys["sky"]["ao_distance"] > 0
    assert dicts.keys["sky"]["strength"] == dicts.keys["sun"]["strength"] == 2
    assert dicts.rim == words.rim
    scenes = [surfel.load(*survey, **found.keys).describe() for found in (dicts, words)]
    assert scenes[0] == scenes[1]


def test_the_legend_has_the_classes_of_all_tiles(tmp_path):
    """The picture is that of all tiles in one scene, whose legend lists the classes of each."""
    tiles = []
    for i, others in enumerate([(2, 6), (2, 9)]):
        x, y = (axis.ravel() for axis in numpy.meshgrid(numpy.linspace(0, 20, 81), numpy.linspace(0, 20, 81)))
        columns = numpy.stack([x + 20.25 * i, y, 0 * x, numpy.where(x < 10, *others)], axis=1)
        tiles.append(tmp_path / f"tile_{i}.csv")
        numpy.savetxt(tiles[-1], columns, fmt="%.3f,%.3f,%.3f,%d", header="x,y,z,classification", comments="")
    keys = KEYS | {"color": "class", "light": "none"}
    recipes = [Recipe(tile, **keys, legend=True) for tile in tiles]
    found = pixels_of_png(render_mosaic(recipes).compute()).astype(int)
    bare = pixels_of_png(render_mosaic([Recipe(tile, **keys) for tile in tiles]).compute()).astype(int)
    both = surfel.load(*tiles, **layout(tuple(tiles), **{key: keys[key] for key in ("color", "light")}).keys)
    both.render(legend=True).save(tmp_path / "whole.png")
    expected = pixels_of_png((tmp_path / "whole.png").read_bytes()).astype(int)
    assert found.shape == expected.shape and (found != bare).any()
    assert (abs(found - expected).max(axis=2) > 1).mean() < 0.001
    assert surfel.load(tiles[0], color="class")._classes() == bytes([2, 6])
    assert both._classes() == bytes([2, 6, 9])


def test_places_without_tiles_are_background(survey, tmp_path):
    corners = (survey[0], survey[3])
    data = render_mosaic([Recipe(tile, **KEYS, background="transparent") for tile in corners], rim=1).compute()
    alpha = pixels_of_png(data)[..., 3]
    assert alpha.shape == (161, 161)
    assert (alpha[:70, :70] == 0).all() and (alpha[90:, 90:] == 0).all()
    assert (alpha[85:160, 1:75] == 255).mean() > 0.95


def test_mosaics_are_geotiffs(survey):
    data = render_mosaic([Recipe(tile, **KEYS, crs="EPSG:25832") for tile in survey[:2]], format="tif").compute()
    tags = tags_of_tiff(data)
    assert tags[MODEL_PIXEL_SCALE][:2] == (0.25, 0.25)
    *pixel, x, y, _ = tags[MODEL_TIEPOINT]
    assert pixel == [0, 0, 0] and (x % 0.25, y % 0.25) == (0, 0)
    assert abs(x - ORIGIN[0]) < 1 and abs(y - tags[IMAGE_LENGTH][0] * 0.25 - ORIGIN[1]) < 1
    directory = tags[GEO_KEYS]
    geo_keys = {directory[i]: directory[i + 3] for i in range(4, len(directory), 4)}
    assert geo_keys[PROJECTED_SYSTEM] == 25832


@pytest.mark.parametrize(
    "recipes, words",
    [
        ([], "found none"),
        ([Recipe("a.laz")], "found no gsd"),
        ([Recipe("a.laz", gsd=1), Recipe("b.laz", gsd=2)], "other keywords"),
        ([Recipe("a.laz", gsd=1, resolution="9x9")], "resolution: a mosaic shows its tiles as a whole"),
        ([Recipe("a.laz", gsd=1, camera={"direction": (0, 0, -1)})], "camera: a mosaic"),
        ([Recipe("a.laz", gsd=1, crop="0,0,1,1")], "crop: a mosaic"),
    ],
)
def test_recipes_that_do_not_fit_are_refused(recipes, words):
    with pytest.raises(surfel.InvalidSetting, match=words):
        render_mosaic(recipes)


def test_keywords_of_tiles_may_be_arrays():
    tile, other = (Recipe(name, gsd=1, range=numpy.array([0.0, 1.0])) for name in ("a.laz", "b.laz"))
    render_mosaic([tile, other])


def test_rims_are_lengths(survey):
    for rim in (-1, float("nan"), float("inf")):
        with pytest.raises(surfel.InvalidSetting, match="rim: found"):
            render_mosaic([Recipe(survey[0], **KEYS)], rim=rim)
