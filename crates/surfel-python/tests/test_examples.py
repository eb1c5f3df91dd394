"""The scripts of examples/python run, and write what they say."""

import pathlib
import subprocess
import sys

import numpy
import pytest

EXAMPLES = pathlib.Path(__file__).parents[3] / "examples" / "python"

RUNS = {
    "scan_to_picture": ("picture.png", ["64x48"]),
    "visible_points": ("visible.ply", ["64x48"]),
    "color_by_column": ("column.png", ["64x48"]),
    "shadow_hours": ("hours.npy", ["20"]),
    "turntable": ("turn.gif", ["32x24", "4"]),
    "movie_on_dask": ("frame_####.png", ["32x24", "4"]),
    "mosaic_on_dask": ("plan.tif", ["0.1"]),
}

NEEDS = {"color_by_column": "pandas", "movie_on_dask": "distributed", "mosaic_on_dask": "distributed"}


def test_every_example_is_run():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(RUNS)


@pytest.mark.parametrize("name", RUNS)
def test_examples_run(name, hill, tmp_path):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    output, words = RUNS[name]
    words = [sys.executable, EXAMPLES / f"{name}.py", hill, tmp_path / output, *words]
    example = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    assert example.returncode == 0, example.stderr
    written = sorted(path for path in tmp_path.iterdir() if not path.name.startswith("."))
    assert len(written) == (4 if "#" in output else 1) and all(100 < path.stat().st_size for path in written)
    if name == "shadow_hours":
        hours = numpy.load(tmp_path / output)
        assert hours.shape == (20, 20) and 8 < numpy.nanmean(hours) < 16
