"""Hours of sun on a place in the course of a day: rays from every point of a grid toward the sun.

    python shadow_hours.py city.laz hours.npy

The sun's path is that of the longest day at 47 degrees north, without the equation of time.
"""

import sys

import numpy
import surfel

LATITUDE, DECLINATION = numpy.radians(47.0), numpy.radians(23.4)
STEP_HOURS = 0.5


def sun_direction(hour):
    """Unit vector toward the sun: x is east, y north, z up."""
    angle = numpy.radians(15 * (hour - 12))
    east = -numpy.cos(DECLINATION) * numpy.sin(angle)
    north = numpy.sin(DECLINATION) * numpy.cos(LATITUDE) - numpy.cos(DECLINATION) * numpy.sin(LATITUDE) * numpy.cos(angle)
    up = numpy.sin(DECLINATION) * numpy.sin(LATITUDE) + numpy.cos(DECLINATION) * numpy.cos(LATITUDE) * numpy.cos(angle)
    return numpy.array([east, north, up])


def main(scan, output, n=200):
    n = int(n)
    scene = surfel.load(scan, up="+Z")
    (x0, y0, z0), (x1, y1, z1) = scene.bounds
    x, y = numpy.meshgrid(numpy.linspace(x0, x1, n), numpy.linspace(y1, y0, n))

    # The surface from above, and a place a little over it.
    down = numpy.stack([x, y, numpy.full_like(x, z1 + 1)] + [numpy.zeros_like(x)] * 2 + [-numpy.ones_like(x)], axis=-1)
    height = z1 + 1 - scene.cast_rays(down)["t_hit"] + 0.01 * (x1 - x0)
    rays = numpy.stack([x, y, height] + [numpy.zeros_like(x)] * 3, axis=-1)

    hours = numpy.zeros((n, n), numpy.float32)
    for hour in numpy.arange(4, 20, STEP_HOURS):
        direction = sun_direction(hour)
        if direction[2] > 0:
            rays[..., 3:] = direction
            hours += STEP_HOURS * ~scene.test_occlusions(rays)
    hours[~numpy.isfinite(height)] = numpy.nan
    numpy.save(output, hours)
    print(f"{numpy.nanmin(hours)} to {numpy.nanmax(hours)} hours of sun, {numpy.nanmean(hours):.1f} on average")


if __name__ == "__main__":
    main(*sys.argv[1:])
