"""`surfel animate --cluster`: the program's movie from the workers of a scheduler."""

import os
import subprocess
import sys

import pytest

distributed = pytest.importorskip("distributed")

SMALL = ["--resolution", "32x24", "--spp", "1", "--light-samples", "1"]
TURN = ["--turntable", "2", "--fps", "2"]


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster


def animate(*words, **environment):
    words = [sys.executable, "-m", "surfel", "animate", *map(str, words), *SMALL]
    return subprocess.run(words, capture_output=True, text=True, timeout=240, env=os.environ | environment)


@pytest.mark.parametrize("movie", ["turn.gif", "turn.png", "frame_####.png", "frame_##.exr"])
def test_movies_are_those_of_one_machine(cluster, hill, tmp_path, movie):
    for folder, words in (("one", []), ("many", ["--cluster", cluster.scheduler_address])):
        (tmp_path / folder).mkdir()
        ended = animate(hill, "-o", tmp_path / folder / movie, *TURN, *words)
        assert ended.returncode == 0, ended.stderr
    files = [sorted((tmp_path / folder).iterdir()) for folder in ("one", "many")]
    assert [file.name for file in files[0]] == [file.name for file in files[1]] and files[0]
    for one, many in zip(*files):
        assert one.read_bytes() == many.read_bytes(), one.name


def test_scene_files_with_objects_travel(cluster, hill, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(f'up = "+Z"\n[[object]]\nfile = {str(hill)!r}\n[[object]]\nfile = {str(hill)!r}\ntranslate = [3, 0, 0]\n')
    for name, words in (("one.gif", []), ("many.gif", ["--cluster", cluster.scheduler_address])):
        ended = animate(scene, "-o", tmp_path / name, *TURN, *words)
        assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "one.gif").read_bytes() == (tmp_path / "many.gif").read_bytes()


def test_relative_names_start_where_the_program_does(cluster, hill, tmp_path):
    words = [sys.executable, "-m", "surfel", "animate", hill.name, "-o", str(tmp_path / "turn.gif"), *TURN, *SMALL]
    words += ["--cluster", cluster.scheduler_address]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=240, cwd=hill.parent)
    assert ended.returncode == 0, ended.stderr


def test_what_workers_say_is_shown(cluster, hill, tmp_path):
    words = [hill, "-o", tmp_path / "turn.gif", *TURN, "--surface", "gaussian", "--cluster", cluster.scheduler_address]
    ended = animate(*words)
    assert ended.returncode != 0 and "error: " in ended.stderr and "Traceback" not in ended.stderr


def test_schedulers_that_do_not_answer_are_named(hill, tmp_path):
    ended = animate(hill, "-o", tmp_path / "turn.gif", *TURN, "--cluster", "tcp://127.0.0.1:1", DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT="2s")
    assert ended.returncode == 1 and "127.0.0.1:1" in ended.stderr, ended.stderr
    assert not list(tmp_path.iterdir())


def test_missing_packages_are_named(hill, tmp_path):
    # Without site-packages the interpreter has no surfel.
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec "{sys._base_executable}" -S "$@"\n')
    bare.chmod(0o755)
    for python in ("no-such-python", str(bare)):
        words = [hill, "-o", tmp_path / "turn.gif", *TURN, "--cluster", "tcp://127.0.0.1:1"]
        ended = animate(*words, SURFEL_PYTHON=python)
        assert ended.returncode == 1 and "pip install './crates/surfel-python[dask]'" in ended.stderr, ended.stderr
        assert not (tmp_path / "turn.gif").exists()
