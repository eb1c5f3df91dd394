"""Clouds and meshes of arrays: what is taken, what is refused, and what becomes of it."""

import array
import copy
import pickle
import types

import numpy
import pytest
import surfel
from conftest import hill_points


class Interface:
    """An object that has nothing but the array interface."""

    def __init__(self, values):
        self.values = values
        self.__array_interface__ = values.__array_interface__


class Dlpack:
    """An object that has nothing but DLPack."""

    def __init__(self, values):
        self.values = values

    def __dlpack__(self, **keywords):
        return self.values.__dlpack__(**keywords)

    def __dlpack_device__(self):
        return self.values.__dlpack_device__()


def read_only(values):
    values = values.copy()
    values.flags.writeable = False
    return values


@pytest.mark.parametrize(
    "convert",
    [
        lambda points: points,
        lambda points: points.astype("f4"),
        lambda points: points.astype(">f8"),
        lambda points: numpy.asfortranarray(points),
        lambda points: numpy.repeat(points, 2, axis=0)[::2],
        lambda points: points[::-1].copy()[::-1],
        lambda points: numpy.hstack([points, points])[:, :3],
        lambda points: numpy.hstack([points[:, ::-1], points])[:, 2::-1],
        read_only,
        lambda points: points.tolist(),
        lambda points: memoryview(points),
        Interface,
        Dlpack,
        lambda points: Dlpack(points.astype("f4")),
    ],
)
def test_arrays_of_many_kinds_are_the_same_cloud(points, convert):
    cloud = surfel.Cloud(convert(points))
    assert len(cloud) == len(points)
    assert numpy.allclose(cloud.points, points, atol=1e-6)


def test_coordinates_are_a_copy_that_may_be_changed(points):
    cloud = surfel.Cloud(points)
    world = cloud.points
    world -= world.mean(axis=0)
    assert numpy.allclose(cloud.points, points, atol=1e-6)
    with pytest.raises(ValueError, match="read-only"):
        cloud.local_points[0] = 0


@pytest.mark.parametrize("crs", ["EPSG:25832", "25832", 25832, numpy.int64(25832)])
def test_clouds_have_coordinate_systems(crs):
    points = hill_points(offset=(691000, 5334000, 500))
    cloud = surfel.Cloud(points, crs=crs)
    assert cloud.crs == "EPSG:25832" and surfel.Cloud(points).crs is None
    scene = surfel.Scene(resolution=(32, 24), spp=1, light_samples=1, gsd=0.1)
    scene.add(cloud)
    scene.add(cloud, translate=(3, 0, 0))
    assert scene.height_map().crs == "EPSG:25832"
    scene.render(sun="2026-06-21T15:00+02:00")
    assert surfel.prepare(cloud, subsample="random:100").crs == "EPSG:25832"


def test_coordinate_systems_of_files_stay(tmp_path):
    points = hill_points(offset=(691000, 5334000, 500))
    surfel.Cloud(points, crs="EPSG:25832").save(tmp_path / "hill.laz")
    cloud = surfel.prepare(tmp_path / "hill.laz", filter="z > 500.1")
    assert cloud.crs == "EPSG:25832"
    scene = surfel.Scene(gsd=0.1)
    scene.add(cloud)
    assert scene.height_map().crs == "EPSG:25832"


def test_unknown_coordinate_systems_are_refused(points):
    for crs in ("EPSG:99999", "Munich", 7, [1]):
        with pytest.raises(surfel.InvalidSetting, match="crs: .*expected"):
            surfel.Cloud(points, crs=crs)


def test_integers_are_taken(points):
    cloud = surfel.Cloud((points * 1000).astype("i2"))
    assert (cloud.points == (points * 1000).astype("i2")).all()


def test_far_coordinates_keep_their_resolution():
    points = hill_points(offset=(5e5, 4.9e6, 100.0))
    cloud = surfel.Cloud(points)
    assert numpy.abs(cloud.points - points).max() < 1e-6
    assert cloud.local_points.dtype == numpy.float32 and numpy.abs(cloud.local_points).max() < 200
    assert numpy.allclose(cloud.local_points + numpy.array(cloud.origin), points, atol=1e-6)


def test_columns_come_back(points):
    n = len(points)
    colors = numpy.arange(3 * n, dtype="u2").reshape(n, 3)
    columns = {
        "u1": numpy.arange(n).astype("u1"),
        "u2": numpy.arange(n).astype("u2"),
        "i4": numpy.arange(n).astype("i4") - 7,
        "f4": numpy.linspace(0, 1, n).astype("f4"),
        "f8": numpy.linspace(0, 1, n),
        "i8": numpy.arange(n),
        "bool": numpy.arange(n) % 2 == 0,
    }
    normals = numpy.tile([0.0, 0.0, 2.0], (n, 1))
    cloud = surfel.Cloud(
        points, normals=normals, radii=0.05, colors=colors, intensity=columns["f4"], classification=columns["u1"], scalars=columns
    )
    assert (cloud.normals == normals).all() and (cloud.radii == numpy.float32(0.05)).all()
    assert (cloud.colors == colors).all() and (cloud.intensity == columns["f4"]).all()
    assert (cloud.classification == columns["u1"]).all()
    assert list(cloud.scalars) == list(columns)
    for name, values in columns.items():
        assert (cloud.scalars[name] == values).all(), name
    assert cloud.scalars["i4"].dtype == numpy.int32 and cloud.scalars["i8"].dtype == numpy.float64
    bare = surfel.Cloud(points)
    assert bare.normals is None and bare.colors is None and bare.scalars == {}


@pytest.mark.parametrize(
    ("colors", "expected"),
    [
        (numpy.array([[255, 128, 0]], "u1"), [65535, 128 * 257, 0]),
        (numpy.array([[255, 128, 0, 9]], "u1"), [65535, 128 * 257, 0]),
        (numpy.array([[1.0, 0.5, 0.0]]), [65535, 32768, 0]),
        (numpy.array([[1.0, 0.5, 0.0]], "f4"), [65535, 32768, 0]),
        (numpy.array([[1.0, 0.5, 0.0]], "f2"), [65535, 32768, 0]),
        (numpy.array([[7, 8, 9]], "u2"), [7, 8, 9]),
    ],
)
def test_colours_have_sixteen_bits(colors, expected):
    cloud = surfel.Cloud([[0.0, 0.0, 0.0]], colors=colors)
    assert cloud.colors.tolist() == [expected]


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"points": numpy.zeros((5, 2))}, r"points: found shape \(5, 2\), expected \(N, 3\)"),
        ({"points": numpy.zeros(15)}, r"points: found shape \(15,\)"),
        ({"points": numpy.zeros((0, 3))}, "points: found none"),
        ({"points": numpy.zeros((5, 3), "c8")}, "points: found dtype complex64"),
        ({"points": numpy.full((5, 3), "x")}, "points: found dtype"),
        ({"points": [[1, 2, 3], [4, 5]]}, "points: found an object of type list"),
        ({"points": None}, "points: found"),
        ({"normals": numpy.zeros((4, 3))}, r"normals: found shape \(4, 3\), expected \(5, 3\)"),
        ({"radii": numpy.zeros(4)}, r"radii: found shape \(4,\), expected \(5,\)"),
        ({"colors": numpy.zeros((5, 2))}, r"colors: found shape \(5, 2\)"),
        ({"colors": numpy.full((5, 3), 1.5)}, "colors: found 1.5 to 1.5, expected 0 to 1"),
        ({"colors": numpy.full((5, 3), numpy.nan)}, "colors: found nan"),
        ({"colors": numpy.full((5, 3), 70000)}, "colors: found 70000 to 70000 of dtype int64"),
        ({"intensity": numpy.zeros((5, 1))}, r"intensity: found shape \(5, 1\)"),
        ({"classification": numpy.full(5, 256)}, "classification: found 256 to 256, expected 0 to 255"),
        ({"scalars": {"age": numpy.zeros(6)}}, r"age: found shape \(6,\), expected \(5,\)"),
        ({"scalars": {"age": numpy.array(["a"] * 5)}}, "age: found dtype"),
    ],
)
def test_wrong_arrays_are_refused(keywords, words):
    with pytest.raises(surfel.InvalidArray, match=words):
        surfel.Cloud(**({"points": numpy.zeros((5, 3))} | keywords))


def test_unknown_keywords_are_refused(points):
    with pytest.raises(TypeError, match="colours"):
        surfel.Cloud(points, colours=points)


def test_points_that_are_not_finite_are_left_out(points):
    points[::7] = numpy.nan
    points[1] = numpy.inf
    scene = surfel.Scene(resolution=(32, 24), spp=1, light_samples=1)
    scene.add(surfel.Cloud(points))
    ids = scene.render().point_ids
    shown = ids[ids != 0xFFFFFFFF]
    assert shown.size and numpy.isfinite(points[shown]).all()
    scene = surfel.Scene()
    scene.add(surfel.Cloud(numpy.full((9, 3), numpy.nan)))
    with pytest.raises(surfel.InvalidScene, match="^<object 0>: the cloud has no points"):
        scene.render(resolution=(8, 8))


def test_later_changes_of_arrays_change_nothing(points):
    cloud = surfel.Cloud(points)
    before = cloud.points
    points[:] = 7
    del points
    assert (cloud.points == before).all()


@pytest.mark.parametrize("extension", ["ply", "laz", "xyz"])
def test_clouds_are_saved_and_read(points, tmp_path, extension):
    n = len(points)
    path = tmp_path / f"hill.{extension}"
    surfel.Cloud(points, scalars={"age": numpy.arange(n).astype("f4")}).save(path)
    read = surfel.read_cloud(path)
    # LAZ holds multiples of a step, text some digits.
    assert numpy.allclose(read.points, points, atol=1e-3)
    assert (read.scalars["age"] == numpy.arange(n)).all()
    scene = surfel.load(path, color="age", light="none", resolution=(32, 24), spp=1)
    image = scene.render()
    hit = image.point_ids != 0xFFFFFFFF
    assert hit.any() and len(numpy.unique(image.color[hit], axis=0)) > 10


def test_clouds_cannot_be_saved_anyhow(points, tmp_path):
    with pytest.raises(surfel.InvalidFile):
        surfel.Cloud(points).save(tmp_path / "hill.bmp")


def test_meshes_of_arrays_are_refused_or_taken():
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert repr(surfel.Mesh(corners, [[0, 1, 2]])) == "<surfel.Mesh of 1 triangle>"
    for triangles, words in [
        ([[0, 1, 3]], "triangles: found indices 0 to 3, expected 0 to 2"),
        ([[0, 1, -1]], "triangles: found indices -1 to 1"),
        ([[0.0, 1.0, 2.0]], "triangles: found dtype float64, expected integers"),
        (numpy.zeros((0, 3), int), "triangles: found none"),
        ([[0, 1]], r"triangles: found shape \(1, 2\)"),
    ]:
        with pytest.raises(surfel.InvalidArray, match=words):
            surfel.Mesh(corners, triangles)
    with pytest.raises(surfel.InvalidArray, match="vertices: found one that is not finite, at index 1"):
        surfel.Mesh([[0, 0, 0], [numpy.nan, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(surfel.InvalidArray, match="triangles: found none"):
        surfel.Mesh(corners)


def test_meshes_have_the_arrays_that_they_were_made_of():
    vertices = numpy.array([[691_000.25, 5_334_000.5, 7], [691_001, 5_334_000, 7], [691_000, 5_334_001, 9]])
    colors = numpy.array([[0, 1, 257], [32768, 65535, 12345], [2, 3, 60000]], "u2")
    mesh = surfel.Mesh(vertices, [[0, 1, 2], [2, 1, 0]], normals=[[0, 0, 2]] * 3, colors=colors)
    assert numpy.allclose(mesh.vertices, vertices, atol=1e-4) and mesh.vertices.dtype == numpy.float64
    assert mesh.triangles.tolist() == [[0, 1, 2], [2, 1, 0]] and mesh.triangles.dtype == numpy.uint32
    assert mesh.normals.tolist() == [[0, 0, 1]] * 3 and not mesh.normals.flags.writeable
    assert mesh.colors.dtype == numpy.uint16 and (mesh.colors == colors).all()
    bare = surfel.Mesh(vertices, [[0, 1, 2]])
    assert bare.normals is None and bare.colors is None


def test_files_are_read_as_clouds(hill, points, tmp_path):
    cloud = surfel.read_cloud(hill)
    assert len(cloud) == 2500 and numpy.allclose(cloud.points, points, atol=1e-5)
    assert cloud.normals is None and cloud.radii is None
    high = surfel.read_cloud(hill, hill, filter="z > 0.2", threads=1)
    assert len(high) == 2 * (points[:, 2] > 0.2).sum()
    (tmp_path / "named.txt").write_text("1 2 3 4\n5 6 7 8\n")
    named = surfel.read_cloud(tmp_path / "named.txt", columns="y,x,z,age")
    assert named.points.tolist() == [[2, 1, 3], [6, 5, 7]] and named.scalars["age"].tolist() == [4, 8]
    cut = tmp_path / "cut.ply"
    surfel.Cloud(points).save(cut)
    cut.write_bytes(cut.read_bytes()[:-100])
    with pytest.raises(surfel.InvalidFile, match=r"\[salvage\]$"):
        surfel.read_cloud(cut)
    assert 2400 < len(surfel.read_cloud(cut, salvage=True)) < 2500


@pytest.mark.parametrize(
    ("keys", "error", "words"),
    [
        ({"radius": "0.1"}, surfel.InvalidSetting, "radius: is no key of reading; give it to prepare or load"),
        ({"surface": "disc"}, surfel.InvalidSetting, "surface: is no key of reading"),
        ({"filter": "z > 9"}, surfel.InvalidScene, "no point meets z > 9"),
        ({"memory_limit": 1000}, surfel.OutOfMemory, r"\[memory_limit\]$"),
    ],
)
def test_files_are_not_read_by_other_keys(hill, keys, error, words):
    with pytest.raises(error, match=words):
        surfel.read_cloud(hill, **keys)


def test_clouds_are_not_made_of_paths(hill):
    for path in ("a.laz", hill):
        with pytest.raises(surfel.InvalidArray, match="surfel.read_cloud reads files"):
            surfel.Cloud(path)
    with pytest.raises(surfel.MissingFile):
        surfel.read_cloud("nowhere.laz")
    with pytest.raises(surfel.Error, match="no input file"):
        surfel.read_cloud()


def test_buffers_of_the_standard_library_are_arrays():
    flat = array.array("d", range(12))
    cloud = surfel.Cloud(numpy.frombuffer(flat).reshape(4, 3))
    assert cloud.points.tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]]


def masked(points, rows):
    """The points with -9999 in some rows, which are masked."""
    values = points.copy()
    values[rows] = -9999
    mask = numpy.zeros(values.shape, bool)
    mask[rows] = True
    return numpy.ma.array(values, mask=mask)


@pytest.mark.parametrize("dtype", ["f8", "f4", "i4"])
def test_masked_positions_count_as_not_measured(points, dtype):
    values = masked((points * 1000).astype(dtype), slice(100, 200))
    cloud = surfel.Cloud(values)
    assert numpy.isnan(cloud.points[100:200]).all() and numpy.isfinite(cloud.points[200:]).all()
    assert numpy.allclose(cloud.points[200:], values.data[200:], atol=1e-3)
    scene = surfel.Scene()
    scene.add(values)
    assert -2000 < scene.bounds.min()
    assert (surfel.Cloud(numpy.ma.array(points)).points == surfel.Cloud(points).points).all()


def test_masked_columns_are_missing_or_refused(points):
    n = len(points)
    ages = numpy.ma.array(numpy.arange(n), mask=numpy.arange(n) < 7)
    cloud = surfel.Cloud(points, intensity=ages, scalars={"age": ages, "whole": numpy.ma.array(numpy.arange(n, dtype="i4"))})
    assert numpy.isnan(cloud.scalars["age"][:7]).all() and (cloud.scalars["age"][7:] == numpy.arange(7, n)).all()
    assert numpy.isnan(cloud.intensity[:7]).all() and cloud.scalars["whole"].dtype == numpy.int32
    for keywords, words in [
        ({"classification": ages % 5}, r"classification: found 7 masked values, expected none; .*classification.filled\(0\)"),
        ({"colors": masked(points, slice(0, 2)).astype("u1")}, "colors: found 6 masked values"),
    ]:
        with pytest.raises(surfel.InvalidArray, match=words):
            surfel.Cloud(points, **keywords)
    with pytest.raises(surfel.InvalidArray, match="vertices: found one that is not finite"):
        surfel.Mesh(masked(points, slice(0, 1)), [[0, 1, 2]])
    with pytest.raises(surfel.InvalidArray, match="triangles: found 3 masked values"):
        surfel.Mesh(points, masked(numpy.array([[0, 1, 2], [3, 4, 5]]), slice(0, 1)))


def test_scalars_are_any_mapping(points):
    ages = numpy.arange(len(points), dtype="f4")
    cloud = surfel.Cloud(points, scalars=types.MappingProxyType({"age": ages}))
    assert (cloud.scalars["age"] == ages).all()
    with pytest.raises(TypeError, match="scalars: found an object of type list, expected names with columns"):
        surfel.Cloud(points, scalars=[ages])
    with pytest.raises(TypeError, match="scalars: found the name 1, expected text"):
        surfel.Cloud(points, scalars={1: ages})


def test_clouds_are_arrays_of_their_points(points):
    cloud = surfel.Cloud(points)
    assert (numpy.asarray(cloud) == cloud.points).all() and numpy.asarray(cloud).dtype == numpy.float64
    assert numpy.asarray(cloud, dtype="f4").dtype == numpy.float32
    if numpy.lib.NumpyVersion(numpy.__version__) >= "2.0.0":
        with pytest.raises(ValueError, match="local_points"):
            numpy.asarray(cloud, copy=False)


def test_clouds_of_clouds_keep_all_columns(points):
    cloud = surfel.Cloud(points, colors=points * 0 + 0.5, scalars={"age": points[:, 0]}, crs=25832)
    again = surfel.Cloud(cloud, scalars={"height": points[:, 2]})
    assert (again.points == cloud.points).all() and (again.colors == cloud.colors).all() and again.crs == "EPSG:25832"
    assert list(again.scalars) == ["age", "height"] and again.normals is None


def test_clouds_of_clouds_keep_stations(tmp_path):
    header = "1\n{}\n10 20 2\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 2 1\n"
    cells = [f"{x} {y} 0 0.5" for x, y in ((1, 0), (2, 0), (0, 3))]
    (tmp_path / "scan.ptx").write_text("\n".join([header.format(len(cells)) + cells[0], *cells[1:], ""]))
    cloud = surfel.read_cloud(tmp_path / "scan.ptx")
    (station,) = cloud.stations
    assert station["name"] == "scan 1" and station["position"] == [10, 20, 2]
    assert (station["rows"], station["columns"]) == (3, 1)
    assert numpy.allclose(numpy.abs(station["rotation"]), [0, 0, 0.5**0.5, 0.5**0.5])
    assert surfel.Cloud(cloud, intensity=None).stations == cloud.stations
    assert surfel.Cloud(cloud.points).stations == []


def test_the_nearest_keyword_is_named(points):
    with pytest.raises(TypeError, match="unexpected keyword argument 'color'; the nearest known one is `colors`"):
        surfel.Cloud(points, color=points)
    with pytest.raises(TypeError, match="unexpected keyword argument 'normal'; the nearest known one is `normals`"):
        surfel.Mesh(points, [[0, 1, 2]], normal=points)


@pytest.mark.parametrize("copied", [pickle.dumps, copy.deepcopy])
def test_what_stays_in_its_process_says_what_travels(points, copied):
    scene, cloud = surfel.Scene(resolution=(8, 8), spp=1, light_samples=1), surfel.Cloud(points)
    scene.add(cloud)
    for value in (scene, cloud, scene.render(), surfel.Mesh(points, [[0, 1, 2]])):
        with pytest.raises(TypeError, match=f"surfel.{type(value).__name__} .*cannot be pickled; a surfel.dask.Recipe"):
            copied(value)


def misaligned(array):
    """The numbers of an array, in rows one after the other, at an odd address, as of a file behind its header."""
    copy = numpy.frombuffer(b"x" + array.tobytes(), array.dtype, offset=1).reshape(array.shape)
    assert copy.flags.c_contiguous and not copy.flags.aligned
    return copy


def test_arrays_at_odd_addresses_are_taken(points):
    n = len(points)
    single = points.astype("f4")
    columns = {
        "normals": numpy.tile(numpy.float32([0, 0, 1]), (n, 1)),
        "radii": numpy.full(n, 0.1, "f4"),
        "colors": numpy.full((n, 3), 300, "u2"),
        "intensity": numpy.arange(n, dtype="f4"),
    }
    scalars = {"age": numpy.arange(n, dtype="i4")}
    odd = {name: misaligned(column) for name, column in columns.items()}
    cloud = surfel.Cloud(misaligned(single), scalars={"age": misaligned(scalars["age"])}, **odd)
    expected = surfel.Cloud(single, scalars=scalars, **columns)
    assert (cloud.points == expected.points).all() and (cloud.scalars["age"] == scalars["age"]).all()
    for name in columns:
        assert (getattr(cloud, name) == getattr(expected, name)).all(), name
    triangles = numpy.arange(6, dtype="u4").reshape(2, 3)
    assert (surfel.Mesh(misaligned(points[:6]), misaligned(triangles)).triangles == triangles).all()
    scene = surfel.Scene()
    scene.add(cloud)
    rays = numpy.float32([[0, 0, 5, 0, 0, -1]])
    assert scene.cast_rays(misaligned(rays))["t_hit"] == scene.cast_rays(rays)["t_hit"]


def test_a_radius_of_all_points_is_a_number(points):
    for radius in (0.1, numpy.float32(0.1), numpy.array(0.1)):
        assert (surfel.Cloud(points, radii=radius).radii == numpy.float32(0.1)).all()
    with pytest.raises(surfel.InvalidArray, match=r"^radii: found shape \(1,\), expected \(2500,\)"):
        surfel.Cloud(points, radii=numpy.array([0.1]))
