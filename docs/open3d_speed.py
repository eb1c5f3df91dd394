"""Measures the Python package beside Open3D on one cloud, by processor time, which other programs disturb least.

    python docs/open3d_speed.py scan.ply
"""

import sys
import time

import numpy
import open3d
import surfel

SIZE = (1024, 1024)
FOV_DEG = 40
NEIGHBORS = 16
POISSON_DEPTH = 9
RUNS = 3


def processor_seconds(work):
    """The least processor time of some runs, and the last result."""
    seconds = []
    for _ in range(RUNS):
        start = time.process_time()
        result = work()
        seconds.append(time.process_time() - start)
    return min(seconds), result


def camera(points):
    """Middle of the points, and a place from which all are seen."""
    low, high = numpy.percentile(points, [1, 99], axis=0)
    center, size = (low + high) / 2, numpy.linalg.norm(high - low)
    return center, center + size * numpy.array([0.5, -1.2, 0.6])


def rays_of(points):
    center, eye = camera(points)
    return surfel.create_rays_pinhole(FOV_DEG, center, eye, (0, 0, 1), *SIZE)


def filled(depth):
    """The part of the pixels between the first and the last hit of each row that show a surface."""
    hit = numpy.isfinite(depth) & (depth > 0)
    between = numpy.logical_or.accumulate(hit, axis=1) & numpy.logical_or.accumulate(hit[:, ::-1], axis=1)[:, ::-1]
    return hit.sum() / between.sum()


def depth_pictures(points, scene):
    """Seconds, and filled parts, of a depth picture of points by Open3D and of the surface by surfel."""
    center, eye = camera(points)
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(points.astype(numpy.float32)))
    forward = (center - eye) / numpy.linalg.norm(center - eye)
    right = numpy.cross(forward, (0, 0, 1))
    right /= numpy.linalg.norm(right)
    rotation = numpy.stack([right, numpy.cross(forward, right), forward])
    extrinsic = numpy.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = rotation, -rotation @ eye
    focal = SIZE[0] / 2 / numpy.tan(numpy.radians(FOV_DEG) / 2)
    intrinsic = numpy.array([[focal, 0, SIZE[0] / 2], [0, focal, SIZE[1] / 2], [0, 0, 1]])
    matrices = [open3d.core.Tensor(matrix) for matrix in (intrinsic, extrinsic)]
    project = lambda: cloud.project_to_depth_image(*SIZE, *matrices, depth_scale=1.0, depth_max=1e9)
    theirs, picture = processor_seconds(project)
    rays = rays_of(points)
    ours, hits = processor_seconds(lambda: scene.cast_rays(rays))
    return (theirs, filled(picture.as_tensor().numpy()[..., 0])), (ours, filled(hits["t_hit"]))


def normals(points):
    """Million points a second of processor time: normals of planes through neighbours, Open3D and surfel."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    search = open3d.geometry.KDTreeSearchParamKNN(NEIGHBORS)
    theirs, _ = processor_seconds(lambda: cloud.estimate_normals(search))
    own = surfel.Cloud(points)
    ours, _ = processor_seconds(lambda: surfel.prepare(own, normals=True, normals_k=NEIGHBORS, duplicates="keep"))
    return [len(points) / seconds / 1e6 for seconds in (theirs, ours)]


def rays(points, scene):
    """Million rays a second of processor time: the Poisson mesh by Open3D and by surfel, and the points by surfel."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBORS))
    cloud.orient_normals_towards_camera_location(camera(points)[1])
    start = time.process_time()
    mesh, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=POISSON_DEPTH)
    poisson = time.process_time() - start
    caster = open3d.t.geometry.RaycastingScene()
    caster.add_triangles(open3d.t.geometry.TriangleMesh.from_legacy(mesh))
    casted = open3d.core.Tensor(rays_of(points).astype(numpy.float32))
    own = surfel.Scene()
    own.add(surfel.Mesh(mesh))
    own.cast_rays(rays_of(points)[:32, :32])
    works = [lambda: caster.cast_rays(casted), lambda: own.cast_rays(rays_of(points)), lambda: scene.cast_rays(rays_of(points))]
    rates = [SIZE[0] * SIZE[1] / processor_seconds(work)[0] / 1e6 for work in works]
    return poisson, len(mesh.triangles), rates


if __name__ == "__main__":
    points = numpy.array(surfel.prepare(sys.argv[1], duplicates="keep").points)
    scene = surfel.Scene()
    scene.add(surfel.Cloud(points))
    scene.cast_rays(rays_of(points)[:32, :32])
    print(f"{len(points)} points, Open3D {open3d.__version__}, surfel {surfel.__version__}")
    (theirs, their_part), (ours, our_part) = depth_pictures(points, scene)
    print(f"depth picture of {SIZE[0]}x{SIZE[1]}: {theirs:.3f} s, {100 * their_part:.1f} % filled, Open3D (points)")
    print(f"depth picture of {SIZE[0]}x{SIZE[1]}: {ours:.3f} s, {100 * our_part:.1f} % filled, surfel (surface)")
    print("normals, million points a second: {:.2f} Open3D, {:.2f} surfel".format(*normals(points)))
    poisson, n_triangles, rates = rays(points, scene)
    print(f"Poisson mesh of {n_triangles} triangles: {poisson:.1f} s")
    print("million rays a second: {:.2f} Open3D (mesh), {:.2f} surfel (mesh), {:.2f} surfel (points)".format(*rates))
