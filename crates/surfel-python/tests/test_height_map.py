"""Elevations of plans, and the program's file beside them."""

import subprocess
import sys

import numpy
import pytest
import surfel


def test_elevations_are_those_of_the_surface(hill):
    heights = surfel.load(hill).height_map(gsd=0.1)
    rows, columns = heights.elevations.shape
    assert heights.elevations.dtype == numpy.float32 and not heights.elevations.flags.writeable
    assert repr(heights) == f"<surfel.HeightMap {columns}x{rows}>"
    a, b, c, d, e, f = heights.transform
    assert numpy.allclose([a, b, d, e], [0.1, 0, 0, -0.1]) and heights.crs is None
    column, row = numpy.meshgrid(numpy.arange(columns) + 0.5, numpy.arange(rows) + 0.5)
    x, y = a * column + b * row + c, d * column + e * row + f
    is_inside = numpy.maximum(abs(x), abs(y)) < 0.95
    expected = 0.5 * numpy.exp(-2 * (x * x + y * y))
    assert is_inside.sum() > 300
    assert abs(heights.elevations - expected)[is_inside].max() < 0.01
    assert numpy.isnan(heights.elevations[numpy.maximum(abs(x), abs(y)) > 1.1]).all()


def test_the_file_is_that_of_the_program(hill, tmp_path):
    scene = surfel.load(hill, crs="EPSG:25832+7837")
    heights = scene.height_map(gsd=0.1)
    assert heights.crs == "EPSG:25832+7837"
    heights.save(tmp_path / "heights.tif")
    program = [sys.executable, "-m", "surfel", "render", str(hill), "-o", str(tmp_path / "plan.png")]
    options = ["--gsd", "0.1", "--crs", "EPSG:25832+7837", "--height-map", str(tmp_path / "program.tif"), "--spp", "1"]
    subprocess.run(program + options, check=True, capture_output=True)
    assert (tmp_path / "heights.tif").read_bytes() == (tmp_path / "program.tif").read_bytes()
    with pytest.raises(surfel.InvalidFile, match="heights.png"):
        heights.save(tmp_path / "heights.png")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "height_map: needs a camera that looks straight down"),
        ({"gsd": 0.1, "surface": "points"}, "height_map: needs a surface"),
        ({"gsd": 0.1, "height_map": "heights.tif"}, "height_map: a file that the program writes"),
    ],
)
def test_what_has_no_elevations_is_refused(hill, keys, message):
    with pytest.raises(surfel.InvalidSetting, match=message):
        surfel.load(hill).height_map(**keys)
