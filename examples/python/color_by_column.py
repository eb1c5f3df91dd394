"""A cloud coloured by a column of a table: here the distance of each point from the middle.

    python color_by_column.py scan.laz distance.png
"""

import sys

import numpy
import pandas
import surfel


def main(scan, output, resolution="1920x1080"):
    points = surfel.read_cloud(scan).points
    table = pandas.DataFrame(points, columns=["x", "y", "z"])
    table["distance"] = numpy.linalg.norm(points - points.mean(axis=0), axis=1)

    scene = surfel.Scene(color="distance", cmap="viridis", legend=True, resolution=resolution)
    scene.add(table)
    scene.render().save(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
