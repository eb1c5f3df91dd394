#!/usr/bin/env python3
"""Writes the meshes that `compare.py` measures: each as NAME.ply for surfel and NAME.tri for Embree, with its
camera NAME.cam.

  make_meshes.py FOLDER [--bunny bun_zipper.ply]

`bunny` is the Stanford bunny, read from the ascii PLY file of the Stanford 3D Scanning Repository and turned to
have Z up. `knot_1m` is generated: the tube of a torus knot with five octaves of bumps, 1,036,800 triangles.
"""
import argparse
from pathlib import Path

import numpy as np

# Each camera: eye, target, vertical angle of view in degrees, point light; Z is up.
CAMERAS = {
    "bunny": "0.05,-0.42,0.2,-0.017,0.0015,0.1,18,0.35,-0.45,0.5",
    "knot_1m": "0.6,-5.4,3.4,0,-0.3,-0.35,50,5,-6,9",
}


def bunny(path):
    """Reads vertices and triangles of the bunny. The first three columns of a vertex are x, y and z, with Y up."""
    header, body = path.read_text().split("end_header\n")
    counts = [int(line.split()[2]) for line in header.splitlines() if line.startswith("element")]
    lines = body.splitlines()
    vertices = np.array([line.split()[:3] for line in lines[:counts[0]]], np.float32)
    triangles = np.array([line.split()[1:4] for line in lines[counts[0]:sum(counts)]], np.uint32)
    x, y, z = vertices.T
    return np.stack([x, -z, y], axis=1), triangles


def knot(n_along=2160, n_around=240, radius=0.55):
    """Returns vertices and triangles of the tube, a grid of quads along and around the knot."""
    along = np.linspace(0, 2 * np.pi, n_along, endpoint=False)
    around = np.linspace(0, 2 * np.pi, n_around, endpoint=False)[None, :, None]
    center = on_knot(along)
    tangent = unit(on_knot(along + 1e-4) - on_knot(along - 1e-4))
    # The normal points away from the circle that the knot winds around, and is never parallel to the tangent.
    axis = np.stack([2 * np.cos(2 * along), 2 * np.sin(2 * along), 0 * along], axis=1)
    normal = unit(np.cross(tangent, np.cross(center - axis, tangent)))
    binormal = np.cross(tangent, normal)
    outward = np.cos(around) * normal[:, None] + np.sin(around) * binormal[:, None]
    position = center[:, None] + radius * outward
    height = sum(0.16 / octave * bumps(4 * octave * position + octave) for octave in (1, 2, 4, 8, 16))
    vertices = position + 0.6 * height[..., None] * outward
    return vertices.reshape(-1, 3).astype(np.float32), grid(n_along, n_around)


def on_knot(angle):
    """Returns the points of the knot's centre line at angles."""
    distance = 2 + np.cos(3 * angle)
    return np.stack([distance * np.cos(2 * angle), distance * np.sin(2 * angle), np.sin(3 * angle)], axis=1)


def bumps(position):
    """Returns Schoen's gyroid function, from -1.5 to 1.5."""
    x, y, z = np.moveaxis(position, -1, 0)
    return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def grid(n_rows, n_columns):
    """Returns two triangles for each cell of a grid that closes in both directions."""
    row, column = np.divmod(np.arange(n_rows * n_columns), n_columns)
    vertex = lambda down, right: (row + down) % n_rows * n_columns + (column + right) % n_columns
    corners = [vertex(0, 0), vertex(1, 0), vertex(1, 1), vertex(0, 0), vertex(1, 1), vertex(0, 1)]
    return np.stack(corners, axis=1).reshape(-1, 3).astype(np.uint32)


def write(folder, name, vertices, triangles):
    """Writes one mesh in both formats, with its camera."""
    n_vertices, n_triangles = len(vertices), len(triangles)
    vertices, triangles = vertices.astype("<f4"), triangles.astype("<u4")
    counts = np.array([n_vertices, n_triangles], "<u4")
    (folder / f"{name}.tri").write_bytes(counts.tobytes() + vertices.tobytes() + triangles.tobytes())
    faces = np.zeros(n_triangles, [("n_corners", "u1"), ("corners", "<u4", 3)])
    faces["n_corners"], faces["corners"] = 3, triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {n_vertices}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {n_triangles}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    (folder / f"{name}.ply").write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())
    (folder / f"{name}.cam").write_text(CAMERAS[name] + "\n")
    print(f"{name}: {n_vertices} vertices, {n_triangles} triangles")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bunny", type=Path)
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    if args.bunny:
        write(args.folder, "bunny", *bunny(args.bunny))
    write(args.folder, "knot_1m", *knot())


if __name__ == "__main__":
    main()
