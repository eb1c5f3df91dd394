"""Pictures by Dask: the program's bytes, on threads and on processes that die."""

import datetime
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import time

import pytest
import surfel

dask = pytest.importorskip("dask")
from surfel.dask import (  # noqa: E402
    ClusterLost,
    Recipe,
    VersionMismatch,
    _worker,
    render_frames,
    render_mosaic,
    render_tiles,
    save_frames,
)

SMALL = {"resolution": (48, 32), "spp": 1, "light_samples": 1}


@pytest.fixture
def recipe(hill):
    return Recipe(hill, turntable=2, **SMALL)


def program(*words):
    subprocess.run([sys.executable, "-m", "surfel", *map(str, words), "--quiet"], check=True)


def options(hill):
    return [hill, "--resolution", "48x32", "--spp", 1, "--light-samples", 1]


def test_frames_are_those_of_the_program(hill, recipe, tmp_path):
    names = save_frames(recipe, range(3), tmp_path / "ours_####.png")
    program("animate", *options(hill), "-o", tmp_path / "theirs_####.png", "--turntable", 2, "--frames", 3)
    assert [os.path.basename(name) for name in names] == ["ours_0001.png", "ours_0002.png", "ours_0003.png"]
    for i in (1, 2, 3):
        ours, theirs = (tmp_path / f"{whose}_000{i}.png" for whose in ("ours", "theirs"))
        assert ours.read_bytes() == theirs.read_bytes(), i


def test_frames_of_another_recipe_are_rendered_again(hill, recipe, tmp_path):
    pattern = tmp_path / "frame_##.png"

    def saved(recipe, n_frames):
        names = save_frames(recipe, range(n_frames), pattern)
        return [pathlib.Path(name).read_bytes() for name in names]

    first = saved(recipe, 2)
    (tmp_path / "frame_01.png").write_bytes(b"kept")
    (tmp_path / "frame_03.png").write_bytes(b"foreign")
    again = saved(recipe, 3)
    assert again[:2] == [b"kept", first[1]] and again[2] != b"foreign"
    other = saved(Recipe(hill, turntable=2, **{**SMALL, "spp": 2}), 3)
    assert b"kept" not in other and not set(other) & set(first)
    assert saved(recipe, 2) == first


def test_tiles_join_to_the_program_s_picture(hill, tmp_path):
    program("render", *options(hill), "-o", tmp_path / "whole.png", "--legend")
    whole = (tmp_path / "whole.png").read_bytes()
    for tiles in (1, 5, 99, (1, 1), (4, 4), (3, 1), (60, 2)):
        assert render_tiles(Recipe(hill, legend=True, **SMALL), tiles).compute() == whole, tiles


def test_recipes_travel_as_descriptions(hill, recipe):
    data = pickle.dumps(recipe)
    assert len(data) < 500
    assert pickle.loads(data) == recipe and hash(pickle.loads(data)) == hash(recipe)
    assert recipe != Recipe(hill, **SMALL)


def test_recipes_are_equal_if_all_digits_are(hill):
    numpy = pytest.importorskip("numpy")
    near, far = (Recipe(hill, camera_position=numpy.array([1.0, 2.0, z])) for z in (3.0, 3.0000000001))
    assert repr(near.keys["camera_position"]) == "[1.0, 2.0, 3.0]" and near != far
    assert near == Recipe(hill, camera_position=(1.0, 2.0, 3.0)) == pickle.loads(pickle.dumps(near))
    date = datetime.datetime(2026, 6, 21, 15, tzinfo=datetime.timezone.utc)
    assert Recipe(hill, sun=date) == Recipe(hill, sun="2026-06-21T15:00:00+00:00")
    with pytest.raises(surfel.InvalidSetting, match="spp: found an object of type object"):
        Recipe(hill, spp=object())


def test_recipes_are_equal_in_any_order_of_keys(hill):
    first = Recipe(hill, spp=1, sun={"azimuth": 1, "elevation": 2})
    second = Recipe(hill, sun={"elevation": 2, "azimuth": 1}, spp=1)
    assert first == second and hash(first) == hash(second)
    assert first != Recipe(hill, spp=1, sun={"azimuth": 2, "elevation": 1})


def test_files_of_keywords_are_named_from_the_root(hill, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    keys = {"environment": pathlib.Path("sky.hdr"), "crop": "area.geojson", "color": "rgb", "up": None}
    recipe = Recipe(hill, camera={"name": "front"}, **keys)
    expected = {"environment": str(tmp_path / "sky.hdr"), "crop": str(tmp_path / "area.geojson"), "color": "rgb", "up": None}
    assert recipe.keys == expected | {"camera": {"name": "front"}}
    assert Recipe(hill, crop="POLYGON((0 0, 1 0, 1 1, 0 0))").keys["crop"].startswith("POLYGON")


def test_recipes_of_other_versions_are_refused(recipe):
    version = surfel.__version__.encode()
    data = pickle.dumps(recipe, protocol=0).replace(version, b"9" * len(version))
    with pytest.raises(VersionMismatch, match=f"this process has surfel {surfel.__version__}.*made by surfel 9"):
        pickle.loads(data).scene()


def test_workers_of_other_versions_are_refused_by_name(recipe):
    distributed = pytest.importorskip("distributed")

    def become_other():
        import surfel

        surfel.__version__ = "9.9.9"

    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            client.run(become_other)
            with pytest.raises(VersionMismatch, match="worker 0 at tcp://.* has surfel 9.9.9"):
                client.gather(client.compute(render_frames(recipe, range(1))))


def test_a_scheduler_that_vanishes_leaves_the_finished_frames(hill, tmp_path):
    distributed = pytest.importorskip("distributed")
    found = tmp_path / "scheduler.json"
    words = ["--scheduler-file", str(found)]
    start = lambda *more: subprocess.Popen([sys.executable, "-m", "dask", *more, *words], stderr=subprocess.DEVNULL)
    processes = [start("scheduler", "--port", "0", "--no-dashboard")]
    try:
        while not found.exists():
            assert processes[0].poll() is None
            time.sleep(0.05)
        processes.append(start("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard"))
        with distributed.Client(scheduler_file=str(found)) as client:
            client.wait_for_workers(1, timeout=300)
            (tmp_path / "movie").mkdir()
            arguments = (processes[0], tmp_path / "movie")
            end = threading.Thread(target=kill_after_a_file, args=arguments, daemon=True)
            end.start()
            with pytest.raises(ClusterLost, match="start it and do the same again"):
                save_frames(Recipe(hill, turntable=40, **SMALL), range(1000), tmp_path / "movie" / "frame_####.png")
            end.join()
    finally:
        [process.kill() for process in processes]
    assert 0 < len(list((tmp_path / "movie").glob("frame_*.png"))) < 1000


def kill_after_a_file(process, folder):
    while not any(folder.glob("*.png")):
        time.sleep(0.01)
    process.kill()


def test_frames_are_written_where_the_client_runs(recipe, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            client.run(os.chdir, os.path.dirname(tmp_path))
            names = save_frames(recipe, range(2), "frame_##.png")
    assert names == [str(tmp_path / name) for name in ("frame_01.png", "frame_02.png")]
    assert sorted(os.listdir(tmp_path)) == [".frame_##.png.recipe", "frame_01.png", "frame_02.png"]
    assert dask.compute(*render_frames(recipe, range(2))) == tuple(open(name, "rb").read() for name in names)


@pytest.mark.skipif(os.name == "nt", reason="permissions of Unix")
def test_frames_have_the_permissions_of_other_files(recipe, tmp_path):
    (tmp_path / "other").touch()
    name = save_frames(recipe, range(1), tmp_path / "frame_##.png")[0]
    assert os.stat(name).st_mode == (tmp_path / "other").stat().st_mode


def test_missing_folders_are_told_before_the_work(tmp_path):
    with pytest.raises(surfel.InaccessibleFile, match="frame_##.png: cannot be written: there is no folder .*nowhere"):
        save_frames(Recipe("nowhere.ply", turntable=1), range(2), tmp_path / "nowhere" / "frame_##.png")


def test_lost_clusters_are_told_across_processes():
    assert str(pickle.loads(pickle.dumps(ClusterLost()))) == str(ClusterLost())


@pytest.mark.parametrize("tiles", [0, (0, 4), (1, 2, 3), "4x4", 2.5, (2, -1)])
def test_other_tiles_are_refused(recipe, tiles):
    with pytest.raises(surfel.InvalidSetting, match="tiles: found"):
        render_tiles(recipe, tiles)


def test_wrong_keywords_are_named_where_the_recipe_is_made(hill):
    with pytest.raises(surfel.InvalidSetting, match="^turntabel: .*nearest known one is `turntable`"):
        Recipe(hill, turntabel=1)
    with pytest.raises(surfel.InvalidSetting, match="^surface: found"):
        Recipe(hill, surface="velvet")


def test_wrong_recipes_are_named_where_they_are_rendered(hill):
    with pytest.raises(surfel.MissingFile):
        dask.compute(*render_frames(Recipe("nowhere.ply", turntable=1), range(2)))
    with pytest.raises(surfel.InvalidSetting, match="nothing moves"):
        dask.compute(*render_frames(Recipe(hill, **SMALL), range(2)))
    with pytest.raises(surfel.InvalidSetting, match="found no #"):
        save_frames(Recipe(hill), range(2), "frame.png")


def test_movies_survive_a_worker(recipe, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            frames = client.compute(render_frames(recipe, range(12)))
            distributed.wait(frames[0])
            victim = next(iter(cluster.workers.values())).pid
            os.kill(victim, signal.SIGKILL)
            found = client.gather(frames)
    expected = dask.compute(*render_frames(recipe, range(12)))
    assert found == list(expected)


def test_formats_are_refused_before_the_work(recipe, tmp_path):
    for format in _worker.FORMATS:
        assert len(render_tiles(recipe, 1, format=format).compute(scheduler="sync")) > 100, format
    for work in (
        lambda: render_tiles(recipe, format="bmp"),
        lambda: render_frames(recipe, range(2), format="bmp"),
        lambda: render_mosaic([recipe], format="bmp"),
        lambda: save_frames(recipe, range(2), tmp_path / "frame_##.bmp"),
    ):
        with pytest.raises(surfel.InvalidSetting, match="^format: found 'bmp', expected one of png, jpg"):
            work()


def test_anything_but_a_recipe_is_refused(hill, tmp_path):
    for work in (
        lambda found: render_tiles(found),
        lambda found: render_frames(found, range(2)),
        lambda found: render_mosaic([found]),
        lambda found: save_frames(found, range(2), tmp_path / "frame_##.png"),
    ):
        with pytest.raises(TypeError, match="^recipe: found 'a.las', expected a surfel.dask.Recipe"):
            work("a.las")
        with pytest.raises(TypeError, match="^recipe: found an object of type Scene, expected"):
            work(surfel.load(hill))


@pytest.mark.parametrize("frames", [4, [0, -1]])
def test_other_frames_are_refused(recipe, tmp_path, frames):
    for work in (lambda: render_frames(recipe, frames), lambda: save_frames(recipe, frames, tmp_path / "frame_##.png")):
        with pytest.raises(ValueError, match=r"^frames: found -?\d, expected indices from 0, as range\(100\)"):
            work()


def test_urls_are_no_files_of_recipes():
    with pytest.raises(surfel.InvalidFile, match="^https://x.org/a.laz: is a URL"):
        Recipe("https://x.org/a.laz")


def test_exceptions_are_named_as_they_are_imported():
    assert VersionMismatch.__module__ == ClusterLost.__module__ == "surfel.dask"
