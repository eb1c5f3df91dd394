"""Files and clouds that tests share."""

import numpy
import pytest


def hill_points(n=50, offset=(0.0, 0.0, 0.0)):
    """Points of a hill of height 0.5 above the square from -1 to 1."""
    x, y = numpy.meshgrid(numpy.linspace(-1, 1, n), numpy.linspace(-1, 1, n))
    z = 0.5 * numpy.exp(-2 * (x * x + y * y))
    return numpy.stack([x.ravel(), y.ravel(), z.ravel()], axis=1) + numpy.asarray(offset)


@pytest.fixture
def points():
    """The points of a hill."""
    return hill_points()


@pytest.fixture(scope="session")
def hill(tmp_path_factory):
    """A file with the points of a hill."""
    path = tmp_path_factory.mktemp("data") / "hill.xyz"
    numpy.savetxt(path, hill_points())
    return path
