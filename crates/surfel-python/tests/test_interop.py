"""Clouds and meshes of other packages; each test is skipped where its package is not installed."""

import numpy
import pytest
import surfel
from conftest import hill_points

COLORS = numpy.tile([[10, 20, 30]], (2500, 1))


def test_laspy_coordinates_are_exact(tmp_path):
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(version="1.4", point_format=7))
    las.header.scales, las.header.offsets = [0.001] * 3, [5e5, 4e6, 0]
    points = hill_points(offset=(500123.4, 4000567.8, 90.0))
    las.x, las.y, las.z = points.T
    las.red, las.green, las.blue = (COLORS * 257).T
    las.classification = numpy.arange(2500) % 7
    las.intensity = numpy.arange(2500)
    cloud = surfel.Cloud(las)
    assert numpy.abs(cloud.points - las.xyz).max() < 1e-6
    assert (cloud.colors == COLORS * 257).all()
    assert (cloud.classification == numpy.arange(2500) % 7).all() and (cloud.intensity == numpy.arange(2500)).all()
    assert {"gps_time", "return_number"} <= cloud.scalars.keys()
    scene = surfel.Scene(resolution=(32, 24), spp=1, light_samples=1)
    assert scene.add(las, color="class") == 0
    assert numpy.isfinite(scene.render().depth).any()


def test_laspy_coordinate_systems_are_kept(tmp_path):
    laspy, pyproj = pytest.importorskip("laspy"), pytest.importorskip("pyproj")
    header = laspy.LasHeader(version="1.4", point_format=6)
    las = laspy.LasData(header)
    las.x, las.y, las.z = hill_points(offset=(691000, 5334000, 500)).T
    assert surfel.Cloud(las).crs is None
    header.add_crs(pyproj.CRS("EPSG:25832"))
    assert surfel.Cloud(las).crs == "EPSG:25832"
    las.write(tmp_path / "hill.las")
    assert surfel.Cloud(laspy.read(tmp_path / "hill.las")).crs == "EPSG:25832"
    for system in (pyproj.CRS("EPSG:31468"), pyproj.CRS(pyproj.CRS("EPSG:31468").to_wkt())):
        assert surfel.Cloud(las, crs=system).crs == "EPSG:31468"
    unnamed = pyproj.CRS("+proj=utm +zone=32 +ellps=GRS80 +units=m")
    scene = surfel.Scene(resolution=(32, 24), spp=1, light_samples=1)
    scene.add(surfel.Cloud(las, crs=unnamed))
    scene.render(sun="2026-06-21T15:00+02:00")


def test_laspy_points_are_read_as_their_file():
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(version="1.2", point_format=2))
    las.x, las.y, las.z = hill_points().T
    las.red, las.green, las.blue = COLORS.T
    high = surfel.Cloud(las.points[numpy.asarray(las.z) > 0.2])
    assert 0 < len(high) < 2500 and high.points[:, 2].min() > 0.19
    assert (surfel.Cloud(las.points).colors == surfel.Cloud(las).colors).all()


def test_laspy_colours_of_eight_bits_are_bright():
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(version="1.2", point_format=2))
    las.x, las.y, las.z = hill_points().T
    las.red, las.green, las.blue = COLORS.T
    assert (surfel.Cloud(las).colors == COLORS * 257).all()


def test_pandas_colours_of_any_integers_are_read():
    pandas = pytest.importorskip("pandas")
    columns = dict(zip("xyz", hill_points().T)) | dict(zip(("red", "green", "blue"), COLORS.T))
    assert (surfel.Cloud(pandas.DataFrame(columns)).colors == COLORS * 257).all()


def test_pandas_columns_become_scalars():
    pandas = pytest.importorskip("pandas")
    x, y, z = hill_points().T
    frame = pandas.DataFrame({"X": x, "Y": y, "Z": z, "age": numpy.arange(2500.0), "name": ["a"] * 2500})
    cloud = surfel.Cloud(frame)
    assert (cloud.points == hill_points().astype("f4")).all() or numpy.allclose(cloud.points, hill_points(), atol=1e-6)
    assert list(cloud.scalars) == ["age"]
    assert list(surfel.Cloud(frame, scalars={"depth": z}).scalars) == ["age", "depth"]


def test_pandas_columns_that_lack_values_have_nan():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(dict(zip("xyz", hill_points().T)))
    frame["age"] = pandas.array([None, *range(1, 2500)], dtype="Int64")
    frame["weight"] = pandas.array([None, *range(1, 2500)], dtype="Float64")
    frame["name"] = pandas.array(["a"] * 2500, dtype="string")
    cloud = surfel.Cloud(frame)
    assert list(cloud.scalars) == ["age", "weight"]
    for values in (*cloud.scalars.values(), surfel.Cloud(hill_points(), scalars=frame[["age"]]).scalars["age"]):
        assert numpy.isnan(values[0]) and (values[1:] == numpy.arange(1, 2500)).all()
    frame["one"] = pandas.array(numpy.ones(2500), dtype="Float64")
    normals = surfel.Cloud(hill_points(), normals=frame[["age", "weight", "one"]]).normals
    assert numpy.isnan(normals[0]).any() and (normals[1:, 2] == 1).all()


def test_xarray_columns_become_scalars():
    xarray = pytest.importorskip("xarray")
    x, y, z = hill_points().T
    data = xarray.Dataset({"x": ("n", x), "y": ("n", y), "z": ("n", z), "age": ("n", numpy.arange(2500.0))})
    cloud = surfel.Cloud(data)
    assert numpy.allclose(cloud.points, hill_points(), atol=1e-6) and list(cloud.scalars) == ["age"]


def test_trimesh_meshes_and_clouds_are_added():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=(2, 2, 2))
    scene = surfel.Scene()
    scene.add(box)
    assert scene.cast_rays([0.1, 0.2, 5, 0, 0, -1])["t_hit"] == 4
    cloud = surfel.Cloud(trimesh.PointCloud(hill_points(), colors=COLORS))
    assert len(cloud) == 2500 and (cloud.colors == COLORS * 257).all()


def colors_of_mesh(mesh):
    """Linear red, green and blue of the middle of a box as seen from above."""
    scene = surfel.Scene(resolution=(9, 9), spp=1, light_samples=1, camera_direction=(0, 0, -1))
    scene.add(mesh)
    return scene.render().albedo[4, 4]


#: The colour 10, 20, 30 of sRGB in linear numbers.
LINEAR = [(0.055 + c / 255) ** 2.4 / 1.055**2.4 if c > 10 else c / 255 / 12.92 for c in (10, 20, 30)]


def test_trimesh_colours_of_vertices_are_kept():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=(2, 2, 2))
    box.visual.vertex_colors = COLORS[:8].astype("u1")
    assert numpy.allclose(colors_of_mesh(box), LINEAR, atol=1e-3)
    scene = surfel.Scene()
    scene.add(box)
    # Its edges stay sharp.
    assert scene.cast_rays([0.9, 0.9, 5, 0, 0, -1])["primitive_normals"].tolist() == [0, 0, 1]


def test_pyvista_colours_and_normals_of_vertices_are_kept():
    pyvista = pytest.importorskip("pyvista")
    box = pyvista.Box((-1, 1, -1, 1, -1, 1)).triangulate()
    box.point_data["RGB"] = COLORS[: box.n_points].astype("u1")
    assert numpy.allclose(colors_of_mesh(box), LINEAR, atol=1e-3)
    tilted = numpy.tile(numpy.array([0.6, 0, 0.8], "f4"), (box.n_points, 1))
    box.point_data["Normals"] = tilted
    scene = surfel.Scene()
    scene.add(box)
    assert numpy.allclose(scene.cast_rays([0.1, 0.2, 5, 0, 0, -1])["primitive_normals"], tilted[0])


def test_open3d_tensors_are_read():
    core = pytest.importorskip("open3d", exc_type=ImportError).core
    import open3d

    box = open3d.t.geometry.TriangleMesh.create_box(2, 2, 2)
    box.vertex.colors = core.Tensor(COLORS[:8].astype("u1"))
    assert numpy.allclose(colors_of_mesh(box), LINEAR, atol=1e-3)
    tensors = open3d.t.geometry.PointCloud(core.Tensor(hill_points()))
    tensors.point.intensity = core.Tensor(numpy.arange(2500.0).reshape(2500, 1))
    tensors.point.age = core.Tensor(numpy.arange(2500).reshape(2500, 1))
    cloud = surfel.Cloud(tensors)
    assert (cloud.intensity == numpy.arange(2500)).all() and (cloud.scalars["age"] == numpy.arange(2500)).all()
    assert list(cloud.scalars) == ["age"] and cloud.normals is None


def test_other_objects_are_refused_with_what_is_taken():
    class Thing:
        pass

    words = "points: found an object of type Thing, expected an array .* laspy, Open3D"
    for take in (surfel.Cloud, surfel.Scene().add):
        with pytest.raises(surfel.InvalidArray, match=words):
            take(Thing())


def test_pyvista_meshes_and_clouds_are_added():
    pyvista = pytest.importorskip("pyvista")
    scene = surfel.Scene()
    scene.add(pyvista.Cube(x_length=2, y_length=2, z_length=2))
    assert scene.cast_rays([0.1, 0.2, 5, 0, 0, -1])["t_hit"] == 4
    data = pyvista.PolyData(hill_points())
    data.point_data["age"] = numpy.arange(2500.0)
    assert list(surfel.Cloud(data).scalars) == ["age"]


def test_open3d_meshes_and_clouds_are_added():
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    scene = surfel.Scene()
    scene.add(open3d.geometry.TriangleMesh.create_box(2, 2, 2))
    assert scene.cast_rays([0.5, 0.5, 5, 0, 0, -1])["t_hit"] == 3
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(hill_points()))
    cloud.colors = open3d.utility.Vector3dVector(COLORS / 255)
    assert (surfel.Cloud(cloud).colors == COLORS * 257).all()


def test_pandas_columns_are_handed_over_as_scalars():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"h": numpy.arange(2500.0), 7: numpy.arange(2500)})
    cloud = surfel.Cloud(hill_points(), scalars=frame[["h"]])
    assert (cloud.scalars["h"] == numpy.arange(2500)).all()
    with pytest.raises(TypeError, match="scalars: found the name 7"):
        surfel.Cloud(hill_points(), scalars=frame)


def test_pyvista_grids_are_refused_with_what_makes_a_mesh():
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.ImageData(dimensions=(3, 3, 3))
    blocks = pyvista.MultiBlock([pyvista.Sphere()])
    kinds = [grid, grid.cast_to_structured_grid(), grid.cast_to_unstructured_grid(), blocks]
    for data in kinds:
        for take in (surfel.Mesh, surfel.Scene().add):
            with pytest.raises(surfel.InvalidArray, match=rf"found a {type(data).__name__}.* `.extract_surface\(\)`"):
                take(data)
        surfel.Scene().add(data.extract_surface().triangulate())
    with pytest.raises(surfel.InvalidArray, match="MultiBlock of 1 blocks"):
        surfel.Cloud(blocks)
    assert len(surfel.Cloud(kinds[2])) == 27
