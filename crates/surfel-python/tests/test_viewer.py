"""The viewer: its page, its end, and several at once."""

import json
import signal
import subprocess
import sys
import threading
import time
import urllib.request

import pytest
import surfel


def fetch(url):
    with urllib.request.urlopen(url, timeout=30) as answer:
        return answer.read()


def test_the_page_is_there_until_the_viewer_is_closed(points):
    scene = surfel.Scene()
    scene.add(surfel.Cloud(points), name="hill")
    with surfel.view(scene) as viewer, surfel.view(scene) as other:
        assert viewer.url.startswith("http://127.0.0.1:") and viewer.url != other.url
        assert b"<!doctype html>" in fetch(viewer.url).lower()
        assert viewer.url in viewer._repr_html_() and viewer.url in repr(viewer)
    with pytest.raises(OSError):
        fetch(viewer.url)
    viewer.close()


def test_programs_get_pictures_of_clouds_of_arrays(points):
    scene = surfel.Scene()
    scene.add(surfel.Cloud(points))
    with surfel.view(scene) as viewer:
        while b"ready" not in fetch(viewer.url + "healthz"):
            time.sleep(0.05)
        picture = fetch(viewer.url + "render?resolution=32x24&spp=1&light-samples=1")
        assert picture.startswith(b"\x89PNG")


def test_the_number_of_threads_of_a_scene_holds_for_its_viewer(hill):
    with surfel.view(surfel.load(hill, threads=3)) as viewer:
        while b"ready" not in fetch(viewer.url + "healthz"):
            time.sleep(0.05)
        assert json.loads(fetch(viewer.url + "stats"))["info"]["threads"] == 3


def test_ports_in_use_are_refused(hill):
    scene = surfel.load(hill)
    with surfel.view(scene) as viewer:
        port = int(viewer.url.rsplit(":", 1)[1].strip("/"))
        with pytest.raises(surfel.Error, match=str(port)):
            surfel.view(scene, port=port)


@pytest.mark.parametrize("port", [-1, 65536])
def test_ports_out_of_range_are_refused(hill, port):
    with pytest.raises(ValueError, match=f"^port: found {port}, expected 0 to 65535"):
        surfel.view(surfel.load(hill), port=port)


def test_the_nearest_keyword_is_named(hill):
    with pytest.raises(TypeError, match="'prt'; the nearest known one is `port`"):
        surfel.view(surfel.load(hill), prt=3)


def test_a_script_waits_for_the_end_of_its_viewer(hill):
    viewer = surfel.view(surfel.load(hill))
    waits = threading.Thread(target=viewer.wait)
    waits.start()
    waits.join(0.3)
    assert waits.is_alive() and fetch(viewer.url)
    viewer.close()
    waits.join(30)
    assert not waits.is_alive()
    viewer.wait()


@pytest.mark.skipif(sys.platform == "win32", reason="SIGINT is sent to a process")
def test_ctrl_c_ends_a_script_that_waits(hill):
    # Programs that a shell has put in the background ignore the signal. The address is printed once the script waits.
    code = """
import signal, sys, threading, surfel
signal.signal(signal.SIGINT, signal.default_int_handler)
viewer = surfel.view(surfel.load(sys.argv[1]))
threading.Timer(0.5, lambda: print(viewer.url, flush=True)).start()
viewer.wait()
print("over")
"""
    script = subprocess.Popen([sys.executable, "-c", code, hill], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    url = script.stdout.readline().strip()
    assert fetch(url) and script.poll() is None
    script.send_signal(signal.SIGINT)
    out, err = script.communicate(timeout=60)
    assert (out, err, script.returncode) == ("over\n", "", 0)


def test_viewers_end_in_order_with_the_interpreter(hill):
    """Also one that no variable holds: a handler that was registered before theirs finds them gone."""
    code = """
import atexit, sys, urllib.request
urls = []
def look():
    for url in urls:
        try:
            urllib.request.urlopen(url)
            print("open")
        except OSError:
            print("closed")
atexit.register(look)
import surfel
scene = surfel.load(sys.argv[1])
held = surfel.view(scene)
urls += [held.url, surfel.view(scene).url]
urllib.request.urlopen(urls[1])
"""
    done = subprocess.run([sys.executable, "-c", code, hill], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("closed\nclosed\n", "")


def test_scenes_of_arrays_have_names(points):
    """A page that connects again keeps its view only if these are those of before."""

    def name(n_points, **keys):
        scene = surfel.Scene()
        scene.add(surfel.Cloud(points[:n_points]), **keys)
        with surfel.view(scene) as viewer:
            while b"ready" not in fetch(viewer.url + "healthz"):
                time.sleep(0.05)
            return json.loads(fetch(viewer.url + "stats"))["info"]["name"]

    assert name(2500, name="hill") == "hill (2500 points)"
    assert len({name(2500), name(2000), name(2500, name="hill")}) == 3
