"""Rays: shapes, units and answers."""

import numpy
import pytest
import surfel

NONE = 0xFFFFFFFF


@pytest.fixture(scope="module")
def scene():
    """Squares of side 2 at z = 0 and z = 3, far from the origin."""
    square = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    scene = surfel.Scene()
    for z in (0, 3):
        scene.add(surfel.Mesh(numpy.array(square) + [5e5, 4e6, z], [[0, 1, 2], [0, 2, 3]]))
    return scene


def ray(x, length=1.0):
    return [5e5 + x, 4e6 + 0.25, 10, 0, 0, -length]


def test_hits_are_in_units_of_the_direction(scene):
    hits = scene.cast_rays(numpy.array([ray(0.5), ray(0.5, 2.0), ray(5.0)]))
    assert hits["t_hit"].tolist() == [7.0, 3.5, numpy.inf]
    assert hits["geometry_ids"].tolist() == [1, 1, NONE]
    assert hits["primitive_ids"].tolist() == [0, 0, NONE]
    assert hits["point_ids"].tolist() == [NONE] * 3
    assert hits["primitive_normals"].tolist() == [[0, 0, 1], [0, 0, 1], [0, 0, 0]]
    types = {name: values.dtype.str[1:] for name, values in hits.items()}
    expected = {"t_hit": "f4", "geometry_ids": "u4", "primitive_ids": "u4", "primitive_normals": "f4", "point_ids": "u4"}
    assert types == expected


def test_rays_have_any_leading_shape(scene):
    rays = numpy.tile(ray(0.5), (2, 3, 1))
    hits = scene.cast_rays(rays)
    assert hits["t_hit"].shape == (2, 3) and hits["primitive_normals"].shape == (2, 3, 3)
    assert scene.test_occlusions(rays).shape == scene.count_intersections(rays).shape == (2, 3)
    assert scene.cast_rays(ray(0.5))["t_hit"].shape == ()
    assert scene.cast_rays(numpy.zeros((0, 6)))["t_hit"].shape == (0,)


def test_answers_may_be_changed(scene):
    rays = numpy.tile(ray(0.5), (2, 3, 1))
    answers = [*scene.cast_rays(rays).values(), scene.test_occlusions(rays), scene.count_intersections(rays), scene.bounds]
    for answer in answers:
        assert answer.flags.writeable and answer.flags.c_contiguous
        answer += answer
    assert (scene.count_intersections(rays) == 2).all() and scene.test_occlusions(rays).dtype == bool
    empty = scene.cast_rays(numpy.zeros((0, 6)))
    assert empty["t_hit"].shape == (0,) and empty["primitive_normals"].shape == (0, 3)


def test_single_precision_rays_and_views_are_taken(scene):
    rays = numpy.array([ray(0.5), ray(5.0)])
    for same in (rays[::-1], numpy.hstack([rays, rays])[::-1, ::1][:, :6], rays[::-1].astype(">f8")):
        assert scene.cast_rays(same)["t_hit"].tolist() == [numpy.inf, 7.0]
    assert scene.cast_rays(rays.astype("f4"))["t_hit"].tolist() == [7.0, numpy.inf]


def test_rays_with_nan_or_without_direction_hit_nothing(scene):
    bad = [ray(0.5, 0.0), ray(numpy.nan), ray(0.5, numpy.nan), ray(numpy.inf), ray(0.5, numpy.inf)]
    assert numpy.isinf(scene.cast_rays(bad)["t_hit"]).all()
    assert not scene.test_occlusions(bad).any() and not scene.count_intersections(bad).any()


def test_occlusions_count_within_their_range(scene):
    rays = [ray(0.5), ray(0.5, 6.0), ray(0.5, 20.0), ray(5.0)]
    occluded = scene.test_occlusions(rays)
    assert occluded.dtype == bool and occluded.tolist() == [True, True, True, False]
    assert scene.test_occlusions(rays, tfar=1.0).tolist() == [False, False, True, False]
    assert scene.test_occlusions(rays, tnear=8.0, tfar=9.5).tolist() == [False, False, False, False]


def test_surfaces_are_counted(scene, hill):
    counts = scene.count_intersections([ray(0.5), ray(5.0)])
    assert counts.dtype == numpy.int32 and counts.tolist() == [2, 0]
    points = surfel.load(hill).count_intersections([[0.3, 0.2, 9, 0, 0, -1], [0, -9, 0.1, 0, 1, 0], [9, 9, 9, 0, 0, -1]])
    assert points.tolist() == [1, 2, 0]


def test_the_pinhole_camera_sees_the_depth_of_the_picture(hill):
    eye, center, up = (0, -3, 2), (0, 0, 0.2), (0, 0, 1)
    width, height = 64, 48
    # A vertical angle of view, of the picture, and a horizontal one, of the rays, that belong together.
    vertical = 40.0
    horizontal = 2 * numpy.degrees(numpy.arctan(numpy.tan(numpy.radians(vertical / 2)) * width / height))
    rays = surfel.create_rays_pinhole(horizontal, center, eye, up, width, height)
    assert rays.shape == (height, width, 6)
    scene = surfel.load(hill, camera_position=eye, camera_focal_point=center, camera_view_angle=vertical)
    image = scene.render(resolution=(width, height), spp=1, light_samples=1)
    hits = scene.cast_rays(rays)
    both = numpy.isfinite(image.depth) & numpy.isfinite(hits["t_hit"])
    assert both.sum() > 500 and (numpy.isfinite(image.depth) != numpy.isfinite(hits["t_hit"])).mean() < 0.002
    assert numpy.abs(hits["t_hit"][both] - image.depth[both]).max() < 1e-3
    assert (hits["point_ids"] == image.point_ids)[both].mean() > 0.99


@pytest.mark.parametrize("width, height", [(45, 70), (64, 96), (33, 32), (2, 2), (31, 129), (100, 3)])
def test_pictures_of_rays_are_answered_in_their_order(hill, width, height):
    scene = surfel.load(hill)
    rays = surfel.create_rays_pinhole(60, (0, 0, 0), (0, -3, 2), (0, 0, 1), width, height)
    for query in (scene.test_occlusions, scene.count_intersections):
        assert (query(rays).ravel() == query(rays.reshape(-1, 6))).all()
    picture, row = scene.cast_rays(rays), scene.cast_rays(rays.reshape(-1, 6))
    for name, values in picture.items():
        assert (values.reshape(row[name].shape) == row[name]).all(), name


@pytest.mark.parametrize("shape", [(6, 5), (7,), (), (3, 3)])
def test_other_shapes_are_refused(scene, shape):
    for query in (scene.cast_rays, scene.test_occlusions, scene.count_intersections):
        with pytest.raises(surfel.InvalidArray, match="rays: found shape"):
            query(numpy.zeros(shape))


def test_cameras_that_look_nowhere_are_refused():
    for camera in [
        (60, (0, 0, 1), (0, 0, 0), (0, 0, 1), 4, 4),
        (0, (0, 1, 0), (0, 0, 0), (0, 0, 1), 4, 4),
        (60, (0, 1, 0), (0, 0, 0), (0, 0, 1), 0, 4),
        (60, (0, numpy.nan, 0), (0, 0, 0), (0, 0, 1), 4, 4),
    ]:
        with pytest.raises(surfel.InvalidArray):
            surfel.create_rays_pinhole(*camera)
