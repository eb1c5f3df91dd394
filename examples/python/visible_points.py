"""The points that a picture shows, with the depth at which each is seen, as a cloud of their own.

    python visible_points.py scan.laz visible.ply
"""

import sys

import numpy
import surfel


def main(scan, output, resolution="1920x1080"):
    cloud = surfel.prepare(scan, duplicates="keep", normals=True)
    scene = surfel.Scene(resolution=resolution)
    scene.add(cloud)
    image = scene.render()

    # Each pixel names the point that it shows; a point is as far away as the nearest of its pixels.
    hit = image.point_ids != 0xFFFFFFFF
    depth = numpy.full(len(cloud), numpy.inf, numpy.float32)
    numpy.minimum.at(depth, image.point_ids[hit], image.depth[hit])
    seen = numpy.isfinite(depth)
    visible = surfel.Cloud(cloud.points[seen], normals=cloud.normals[seen], scalars={"depth": depth[seen]})
    visible.save(output)
    print(f"{seen.sum()} of {len(cloud)} points are visible, from {depth.min():.2f} to {depth[seen].max():.2f} away")


if __name__ == "__main__":
    main(*sys.argv[1:])
