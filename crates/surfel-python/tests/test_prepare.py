"""Prepared clouds: of files and of arrays, by the program's rules."""

import subprocess
import sys

import numpy
import pytest
import surfel


def test_normals_and_radii_are_added(hill):
    cloud = surfel.prepare(hill)
    assert len(cloud) == 2500
    assert numpy.allclose(numpy.linalg.norm(cloud.normals, axis=1), 1, atol=1e-3)
    assert (cloud.radii > 0).all()


def test_single_steps_add_nothing_else(hill):
    cloud = surfel.prepare(hill, filter="z > 0.2")
    assert (cloud.points[:, 2] > 0.2).all() and 0 < len(cloud) < 2500
    assert cloud.normals is None and cloud.radii is None
    assert surfel.prepare(hill, filter="z > 0.2", normals=True).normals is not None
    assert "surface_variation" in surfel.prepare(hill, keep_variation=True).scalars


def test_clouds_of_arrays_are_prepared(points):
    cloud = surfel.prepare(surfel.Cloud(points), subsample="random:100")
    assert len(cloud) == 100
    twice = surfel.prepare(surfel.prepare(surfel.Cloud(points)), radius="0.1")
    assert numpy.allclose(twice.radii, 0.1)


def test_saved_clouds_are_those_of_the_program(hill, tmp_path):
    ours, theirs = tmp_path / "ours.ply", tmp_path / "theirs.ply"
    surfel.prepare(hill, normals_k=12).save(ours)
    words = ["prepare", hill, "-o", theirs, "--normals-k", "12", "--quiet"]
    subprocess.run([sys.executable, "-m", "surfel", *map(str, words)], check=True)
    assert ours.read_bytes() == theirs.read_bytes()


def test_several_files_become_one_cloud(hill):
    assert len(surfel.prepare(hill, hill, duplicates="keep")) == 5000


def test_files_clouds_and_arrays_become_one_cloud(hill, points):
    above, n_high = points + [0, 0, 3], (points[:, 2] > 0.2).sum()
    for sources in ((surfel.Cloud(points), surfel.Cloud(above)), (hill, above), (above, hill, above)):
        cloud = surfel.prepare(*sources, duplicates="keep", filter="z > 0.2")
        assert len(cloud) == n_high + 2500 * (len(sources) - 1)
    assert len(surfel.prepare(points)) == 2500
    with pytest.raises(surfel.InvalidArray, match="object of type object, expected an array"):
        surfel.prepare(hill, object())


def test_degrees_are_moved_on_request_and_warned_of_otherwise():
    angles = numpy.arange(900)
    degrees = [11.57 + 1e-4 * (angles % 30), 48.13 + 1e-4 * (angles // 30), angles % 17]
    cloud = surfel.Cloud(numpy.stack(degrees, axis=1))
    with pytest.warns(UserWarning, match=r"degrees of longitude and latitude.*\[reproject\]"):
        kept = surfel.prepare(cloud, duplicates="keep")
    assert (kept.points[:, 1] < 90).all()
    moved = surfel.prepare(cloud, duplicates="keep", reproject=True)
    assert (moved.points[:, 1] > 5e6).all()


def test_sources_are_moved_to_metres_before_they_become_one(tmp_path):
    angles = numpy.arange(900)
    degrees = numpy.stack([11.57 + 1e-4 * (angles % 30), 48.13 + 1e-4 * (angles // 30), angles % 17], axis=1)
    moved = surfel.prepare(surfel.Cloud(degrees), duplicates="keep", reproject=True)
    numpy.savetxt(tmp_path / "degrees.xyz", degrees, fmt="%.9f")
    for other in (surfel.Cloud(degrees), tmp_path / "degrees.xyz"):
        both = surfel.prepare(moved, other, duplicates="keep", reproject=True)
        assert both.crs == "EPSG:32632"
        assert numpy.allclose(both.points[:900], both.points[900:], atol=0.01)


def test_coordinate_systems_that_differ_are_warned_of(points):
    clouds = [surfel.Cloud(points, crs=crs) for crs in (25832, 25833)]
    with pytest.warns(UserWarning, match="cloud 1: its coordinate system differs from that of cloud 0"):
        surfel.prepare(*clouds, duplicates="keep")


def test_clouds_count_against_the_memory_limit(hill, points):
    for sources in ((points,), (hill, points)):
        with pytest.raises(surfel.OutOfMemory, match=r"\[memory_limit\]$"):
            surfel.prepare(*sources, memory_limit=10_000)
    assert len(surfel.prepare(points, memory_limit="1G")) == 2500


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"surface": "smooth"}, "surface: is no key of preparation"),
        ({"camera_position": (1, 2, 3)}, "camera.position: is no key of preparation"),
        ({"filtre": "z > 1"}, "nearest known one is `filter`"),
        ({"filter": "z >"}, "filter: found"),
    ],
)
def test_other_keys_are_refused(hill, keys, words):
    with pytest.raises(surfel.InvalidSetting, match=words):
        surfel.prepare(hill, **keys)


def test_filters_that_keep_nothing_are_refused(hill, points):
    for source in (hill, surfel.Cloud(points)):
        for keys in ({}, {"orient": "none"}, {"normals": True}):
            with pytest.raises(surfel.InvalidScene, match="no point meets z > 9"):
                surfel.prepare(source, filter="z > 9", **keys)
        with pytest.raises(surfel.Error, match="age"):
            surfel.prepare(source, filter="age > 9")


def test_missing_files_are_named():
    with pytest.raises(surfel.MissingFile):
        surfel.prepare("nowhere.laz")
    with pytest.raises(surfel.Error, match="no input file"):
        surfel.prepare()
