"""Scripts of users that mypy checks by its strictest rules; skipped where mypy is not installed."""

import pytest

mypy = pytest.importorskip("mypy.api")

SCRIPT = """
import numpy
import surfel

scene = surfel.load("scan.laz", surface="smooth", class_="ground")
scene.add(surfel.Cloud(numpy.zeros((4, 3)), scalars={"age": numpy.zeros(4)}), material={"kind": "mirror"})
image = scene.render(resolution=(64, 48))
depth: numpy.typing.NDArray[numpy.float32] = image.depth
rays = surfel.create_rays_pinhole(60, (0, 0, 0), (0, -5, 2), (0, 0, 1), 640, 480)
hits = scene.cast_rays(rays)["t_hit"]
frames: list[surfel.Image] = [frame for frame in surfel.Movie(scene, turntable=4)]
height, width, channels = image.shape
with surfel.view(scene) as viewer:
    viewer.wait()
"""

DASK_SCRIPT = """
from surfel.dask import ClusterLost, Recipe, render_frames, render_mosaic, render_tiles, save_frames

recipe = Recipe("scan.laz", turntable=8)
names: list[str] = save_frames(recipe, range(4), "frame_##.png")
pictures = render_frames(recipe, range(4), format="exr")
tiles = render_tiles(recipe, (2, 2))
plan = render_mosaic([recipe], rim=3, format="tif")
scene = recipe.scene()
try:
    scene.render()
except ClusterLost:
    pass
"""

WRONG = """
import surfel

image: surfel.Image = surfel.load("scan.laz")
"""


def checked(script, tmp_path):
    """What mypy says about a script."""
    path = tmp_path / "script.py"
    path.write_text(script)
    return mypy.run(["--strict", "--cache-dir", str(tmp_path / "cache"), str(path)])[0]


def test_scripts_are_typed(tmp_path):
    assert checked(SCRIPT, tmp_path).startswith("Success")
    assert "Incompatible types in assignment" in checked(WRONG, tmp_path)


def test_scripts_for_many_machines_are_typed(tmp_path):
    pytest.importorskip("dask")
    assert checked(DASK_SCRIPT, tmp_path).startswith("Success")
