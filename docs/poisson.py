#!/usr/bin/env python3
"""Makes meshes of point clouds by screened Poisson reconstruction (Kazhdan and Hoppe 2013) with Open3D.

  poisson.py CLOUDS MESHES [--depth 9] [--neighbors 30] [NAME...]

For each CLOUDS/NAME.ply this writes the mesh MESHES/NAME.ply and the processor seconds that it took, MESHES/NAME.secs, as the
bench `quality` reads them (docs/quality.md). A cloud without normals gets those of planes through its neighbors,
oriented along a spanning tree (Hoppe et al. 1992); the seconds include both. Poisson closes what has no points, so
vertices whose density is more than two octree levels below the median are removed: points are more than four times as
far apart there as usual. Needs `pip install open3d`.
"""
import argparse, time
from pathlib import Path

import numpy as np
import open3d as o3d

MAX_LEVELS_BELOW_MEDIAN = 2.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clouds", type=Path)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--depth", type=int, default=9)
    parser.add_argument("--neighbors", type=int, default=30)
    args = parser.parse_args()
    args.meshes.mkdir(parents=True, exist_ok=True)
    for path in sorted(args.clouds.glob("*.ply")):
        if args.names and path.stem not in args.names:
            continue
        cloud = o3d.io.read_point_cloud(str(path))
        begin = time.process_time()
        mesh = reconstruct(cloud, args.depth, args.neighbors)
        seconds = time.process_time() - begin
        o3d.io.write_triangle_mesh(str(args.meshes / path.name), mesh)
        (args.meshes / f"{path.stem}.secs").write_text(f"{seconds:.2f}\n")
        print(f"{path.stem}: {len(cloud.points)} points, {len(mesh.triangles)} triangles, {seconds:.1f} s", flush=True)


def reconstruct(cloud, depth, n_neighbors):
    if not cloud.has_normals():
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(n_neighbors))
        cloud.orient_normals_consistent_tangent_plane(n_neighbors)
    mesh, densities = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth)
    densities = np.asarray(densities)
    mesh.remove_vertices_by_mask(densities < np.median(densities) - MAX_LEVELS_BELOW_MEDIAN)
    mesh.compute_vertex_normals()
    return mesh


if __name__ == "__main__":
    main()
