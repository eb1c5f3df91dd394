"""The notebooks of examples/python run, and show pictures."""

import importlib.util
import shutil

import pytest
from test_examples import EXAMPLES, NEEDS, RUNS

#: Parameters that make each notebook quick, besides its files.
PARAMETERS = {
    "scan_to_picture": {"resolution": "64x48"},
    "visible_points": {"resolution": "64x48"},
    "color_by_column": {"resolution": "64x48"},
    "shadow_hours": {"n": 20},
    "turntable": {"resolution": "32x24", "frames": 4},
    "movie_on_dask": {"resolution": "32x24", "frames": 4},
    "mosaic_on_dask": {"gsd": 0.1},
    "viewer": {},
}

#: Pictures that a notebook shows, if not one.
N_PICTURES = {"scan_to_picture": 2, "visible_points": 2, "turntable": 1, "viewer": 0}


def test_every_script_has_a_notebook():
    assert {path.stem for path in EXAMPLES.glob("*.ipynb")} == set(PARAMETERS)
    assert set(RUNS) | {"viewer"} == set(PARAMETERS)


@pytest.mark.parametrize("name", PARAMETERS)
def test_notebooks_run(name, hill, tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    notebook = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    nbformat.validate(notebook)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are not kept"
    files = {"tiles": str(hill)} if name == "mosaic_on_dask" else {"scan": str(hill)}
    parameters = {**files, **PARAMETERS[name]}
    first = next(cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", []))
    assert {line.split(" = ")[0] for line in first.source.splitlines()} == set(parameters)
    first.source = "\n".join(f"{key} = {value!r}" for key, value in parameters.items())
    resources = {"metadata": {"path": str(tmp_path)}}
    waits = {"timeout": 300, "startup_timeout": 300, "iopub_timeout": 300}
    nbclient.NotebookClient(notebook, kernel_name="python3", resources=resources, **waits).execute()
    outputs = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [data for data in outputs if "image/png" in data or "image/gif" in data]
    assert len(pictures) == N_PICTURES.get(name, 1)
    if name == "viewer":
        kind = "application/vnd.jupyter.widget-view+json" if importlib.util.find_spec("anywidget") else "text/html"
        assert any(kind in data for data in outputs)
    shutil.rmtree(tmp_path)
