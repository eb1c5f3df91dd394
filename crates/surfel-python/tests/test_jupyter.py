"""The viewer in a cell: its widget, and the page in a JupyterLab in Chromium."""

import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest
import surfel

TOKEN = "of-the-test"


@pytest.fixture
def viewer(points):
    scene = surfel.Scene()
    scene.add(surfel.Cloud(points))
    with surfel.view(scene) as viewer:
        yield viewer


def policy(viewer):
    """The pages that may frame the viewer, as its page says."""
    with urllib.request.urlopen(viewer.url, timeout=30) as answer:
        return answer.headers["content-security-policy"].split("frame-ancestors ")[1]


def test_frames_are_allowed_one_by_one(viewer):
    assert policy(viewer) == "'none'"
    for wrong in ("*", "http://*:8888", "localhost:8888", "http://a; script-src *", ""):
        with pytest.raises(surfel.InvalidSetting, match="expected one as http://localhost:8888"):
            viewer.allow_frame(wrong)
    assert policy(viewer) == "'none'"
    viewer.allow_frame("http://localhost:8888")
    assert policy(viewer) == "http://localhost:8888"


def test_the_widget_allows_the_notebook_that_shows_it(viewer):
    pytest.importorskip("anywidget")
    import anywidget
    import traitlets
    from surfel._widget import _widget_class

    widget = _widget_class(anywidget, traitlets)(viewer)
    assert widget.link == viewer.url and widget.allowed == "" and policy(viewer) == "'none'"
    # What the front end sends.
    widget.set_state({"origin": "http://127.0.0.1:8888"})
    assert widget.allowed == "http://127.0.0.1:8888" == policy(viewer)
    other = _widget_class(anywidget, traitlets)(viewer)
    other.set_state({"origin": "vscode-webview://1f2e"})
    assert other.allowed == "" and policy(viewer) == "http://127.0.0.1:8888"
    bundle = viewer._repr_mimebundle_()
    bundle = bundle[0] if isinstance(bundle, tuple) else bundle
    assert "application/vnd.jupyter.widget-view+json" in bundle


def test_without_anywidget_a_link_is_shown(viewer, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    assert viewer.url in viewer._repr_mimebundle_(include=None, exclude=None)["text/html"]


def browser_environment():
    """The environment in which node finds Chromium and playwright-core; skips the test where one is missing."""
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache"))
    playwright = os.environ.get("PLAYWRIGHT", str(cache / "surfel-playwright"))
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if shutil.which("node") is None or chromium is None:
        pytest.skip("node or Chromium is not installed")
    if not (pathlib.Path(playwright) / "node_modules" / "playwright-core").is_dir():
        pytest.skip(f"playwright-core is not in {playwright}")
    return os.environ | {"PLAYWRIGHT": playwright, "CHROMIUM": chromium}


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def stop(process):
    """Ends a process and those that it has started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
        try:
            process.wait(20)
            break
        except subprocess.TimeoutExpired:
            pass
    # Kernels and browsers that outlive it.
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


def start(words, environment, log):
    """Starts a program in a process group of its own, which writes into a file."""
    return subprocess.Popen(words, env=environment, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)


def start_lab(folder, log):
    """Starts a JupyterLab of a folder; returns its process and address."""
    port = free_port()
    # JupyterLab would ask over the notebook whether it may show news.
    page_config = folder / "jupyter-config" / "labconfig" / "page_config.json"
    page_config.parent.mkdir(parents=True)
    page_config.write_text('{"disabledExtensions": {"@jupyterlab/apputils-extension:announcements": true}}')
    own = {f"JUPYTER_{name}_DIR": str(folder / f"jupyter-{name.lower()}") for name in ("CONFIG", "DATA", "RUNTIME")}
    words = ["--no-browser", "--allow-root", "--ip=127.0.0.1", f"--port={port}", f"--IdentityProvider.token={TOKEN}"]
    words += ["--LabApp.expose_app_in_browser=True", f"--ServerApp.root_dir={folder / 'scans'}"]
    lab = start([sys.executable, "-m", "jupyterlab", *words], os.environ | own, log)
    address = f"http://127.0.0.1:{port}"
    end = time.monotonic() + 120
    while time.monotonic() < end and lab.poll() is None:
        try:
            urllib.request.urlopen(f"{address}/api/status?token={TOKEN}", timeout=10).close()
            return lab, address
        except OSError:
            time.sleep(0.5)
    stop(lab)
    raise AssertionError((folder / "lab.log").read_text())


def test_the_page_is_in_a_cell_of_jupyterlab(hill, tmp_path):
    for package in ("jupyterlab", "anywidget", "nbformat", "ipykernel"):
        pytest.importorskip(package)
    environment = browser_environment()
    # With the program's demo.laz as SURFEL_SCAN the screenshot is that of docs/python.md.
    scan = pathlib.Path(os.environ.get("SURFEL_SCAN", hill))
    folder = tmp_path / "scans"
    folder.mkdir()
    shutil.copy(scan, folder)
    code = [f"import surfel\n\nscene = surfel.load({scan.name!r})\nsurfel.view(scene)"]
    cells = [{"cell_type": "code", "id": "a", "metadata": {}, "execution_count": None, "outputs": [], "source": code}]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    notebook = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (folder / "viewer.ipynb").write_text(json.dumps(notebook))
    screenshot = pathlib.Path(os.environ.get("SURFEL_SCREENSHOTS", tmp_path)) / "jupyterlab.png"
    with open(tmp_path / "lab.log", "w") as lab_log, open(tmp_path / "page.log", "w+") as page_log:
        lab, address = start_lab(tmp_path, lab_log)
        try:
            script = pathlib.Path(__file__).parent / "jupyter_page.mjs"
            words = ["node", str(script), f"{address}/lab/tree/viewer.ipynb?token={TOKEN}", str(screenshot)]
            page = start(words, environment, page_log)
            try:
                page.wait(1200)
            except subprocess.TimeoutExpired:
                pass
            finally:
                stop(page)
        finally:
            stop(lab)
        page_log.seek(0)
        written = page_log.read()
    assert page.returncode == 0, written + (tmp_path / "lab.log").read_text()
    found = json.loads(written.splitlines()[0])
    assert found["parents"] == [address] and found["address"].startswith("http://127.0.0.1:")
    assert found["nColors"] > 100
    assert screenshot.stat().st_size > 10_000
