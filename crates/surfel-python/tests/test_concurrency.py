"""Threads, processes, signals and progress while work goes on."""

import _thread
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import numpy
import pytest
import surfel
from conftest import hill_points

SMALL = {"resolution": (48, 32), "spp": 1, "light_samples": 1}
LONG = {"resolution": (1600, 1200), "spp": 64, "light_samples": 64}


def test_threads_share_a_scene(hill):
    scene = surfel.load(hill)
    expected = scene.render(**SMALL).color
    found = {}

    def work(i):
        found[i] = [scene.render(camera_azimuth_angle=90 if i % 2 else None, **SMALL).color for _ in range(3)]

    threads = [threading.Thread(target=work, args=(i,)) for i in range(6)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 6
    for i in (0, 2, 4):
        assert all((color == expected).all() for color in found[i])
    assert all((color == found[1][0]).all() for i in (1, 3, 5) for color in found[i])


def test_a_scene_grows_while_another_thread_renders(points):
    scene = surfel.Scene(**SMALL)
    scene.add(surfel.Cloud(points))
    images = []
    thread = threading.Thread(target=lambda: [images.append(scene.render()) for _ in range(5)])
    thread.start()
    for i in range(1, 5):
        assert scene.add(surfel.Cloud(points), translate=(3 * i, 0, 0)) == i
    thread.join()
    assert len(images) == 5 and all(image.coverage.any() for image in images)
    assert scene.cast_rays([[12, 0, 9, 0, 0, -1]])["geometry_ids"].tolist() == [4]


def test_threads_add_to_one_scene(points):
    scene, cloud = surfel.Scene(), surfel.Cloud(points)
    numbers = []

    def work():
        for _ in range(20):
            numbers.append(scene.add(cloud))
            with pytest.raises(surfel.InvalidSetting):
                scene.add(cloud, colour="red")

    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert sorted(numbers) == list(range(80))


def test_other_threads_run_while_a_picture_is_rendered(hill):
    scene, ticks = surfel.load(hill), []

    def report(stage, done, total):
        if 10 < len(ticks):
            raise InterruptedError

    def render():
        with pytest.raises(InterruptedError):
            scene.render(progress=report, **LONG)

    thread = threading.Thread(target=render)
    thread.start()
    while thread.is_alive():
        ticks.append(None)
        time.sleep(0.001)
    assert 10 < len(ticks)


@pytest.mark.parametrize("kind", ["cloud", "rays"])
def test_other_threads_run_while_arrays_wait_for_a_picture(hill, kind):
    many = hill_points(450)
    small = surfel.Scene()
    small.add(surfel.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    rays = numpy.hstack([many, many])
    small.cast_rays(rays[:1])
    scene, has_begun, has_ended = surfel.load(hill), threading.Event(), threading.Event()
    scene.render(**SMALL)

    def report(stage, done, total):
        has_begun.set()
        if has_ended.is_set():
            raise InterruptedError

    def render():
        with pytest.raises(InterruptedError):
            scene.render(progress=report, **LONG)

    convert = {"cloud": lambda: surfel.Cloud(many), "rays": lambda: small.cast_rays(rays)}[kind]
    rendering, converting = threading.Thread(target=render), threading.Thread(target=convert)
    rendering.start()
    assert has_begun.wait(60)
    converting.start()
    [time.sleep(0.01) for _ in range(20)]
    assert rendering.is_alive()
    has_ended.set()
    [thread.join() for thread in (rendering, converting)]


def test_progress_is_reported(hill):
    reports = []
    surfel.load(hill).render(resolution=(640, 480), progress=lambda *report: reports.append(report))
    assert reports
    for stage, done, total in reports:
        assert isinstance(stage, str) and stage and 0 <= done and isinstance(total, int)


def test_frames_of_a_movie_report_progress(hill):
    movie, stages = surfel.Movie(surfel.load(hill), frames=2, turntable=1, resolution=(640, 480)), []
    movie.render(1, progress=lambda stage, done, total: stages.append(stage))
    assert "render" in stages


def test_what_a_callback_raises_stops_the_work(hill):
    def refuse(stage, done, total):
        raise RuntimeError("enough")

    scene = surfel.load(hill)
    with pytest.raises(RuntimeError, match="enough"):
        scene.render(progress=refuse, **LONG)
    assert scene.render(**SMALL).color.any()


def test_progress_true_shows_a_bar(hill, capsys):
    surfel.load(hill).render(resolution=(640, 480), progress=True)
    assert "render" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
def test_ctrl_c_stops_a_picture(hill):
    code = f"""
import os, signal, sys, threading, time, surfel
scene = surfel.load({str(hill)!r})
scene.render(resolution=(8, 8), spp=1)
# Programs that a shell has put in the background ignore the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)
has_begun, last = threading.Event(), []
def report(*stage):
    last[:] = stage
    if stage[0] == "render":
        has_begun.set()
def interrupt():
    has_begun.wait()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    scene.render(resolution=(1600, 1200), spp=64, light_samples=64, backend="cpu", progress=report)
except KeyboardInterrupt:
    print(last[1] / last[2])
"""
    program = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    # A picture that had gone on would be finished.
    assert float(program.stdout) < 0.5, program.stderr


def test_ctrl_c_stops_waiting_for_a_frame_of_another_thread(hill):
    movie = surfel.Movie(surfel.load(hill), frames=2, turntable=1, **LONG)
    has_begun, may_end = threading.Event(), threading.Event()

    def hold(stage, done, total):
        has_begun.set()
        may_end.wait()
        raise InterruptedError

    def render():
        with pytest.raises(InterruptedError):
            movie.render(0, progress=hold)

    rendering = threading.Thread(target=render)
    rendering.start()
    assert has_begun.wait(60)
    # Programs that a shell has put in the background ignore the signal.
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(0.5, _thread.interrupt_main).start()
            movie.render(1)
        assert rendering.is_alive()
    finally:
        signal.signal(signal.SIGINT, previous)
        may_end.set()
        rendering.join()


def render_in_child(queue):
    try:
        scene = surfel.Scene(**SMALL)
        scene.add(surfel.Cloud(hill_points()))
        queue.put(bool(scene.render().color.any()))
    except Exception as error:
        queue.put(repr(error))


def forked(work, *arguments):
    """What `work` puts into its queue in a process that is forked now."""
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=work, args=(queue, *arguments))
    process.start()
    try:
        return queue.get(timeout=60)
    finally:
        process.kill()
        process.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_forked_processes_raise_instead_of_waiting(hill):
    surfel.load(hill)
    assert "was forked" in forked(render_in_child)


def outcome(queue, work):
    try:
        queue.put(repr(work()))
    except RuntimeError as error:
        queue.put(str(error))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize("kind", ["cloud", "mesh", "rays", "view", "file"])
def test_forked_processes_convert_no_arrays_and_show_no_viewer(hill, kind):
    # So many points are converted on several threads.
    many = hill_points(450)
    scene = surfel.load(hill)
    scene.render(**SMALL)
    work = {
        "cloud": lambda: surfel.Cloud(many),
        "mesh": lambda: surfel.Mesh(many, [[0, 1, 2]]),
        "rays": lambda: scene.cast_rays(numpy.hstack([many, many])),
        "view": lambda: surfel.view(scene),
        # Files are looked at without the interpreter, too.
        "file": lambda: surfel.Scene().add(hill),
    }
    assert "was forked" in forked(outcome, work[kind])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_clouds_start_the_threads_that_forked_processes_lack():
    code = f"""
import sys
sys.path.insert(0, {os.path.dirname(__file__)!r})
import surfel, test_concurrency
surfel.Cloud(test_concurrency.hill_points(450))
print(test_concurrency.forked(test_concurrency.render_in_child))
"""
    program = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert "was forked" in program.stdout, program.stderr


def test_spawned_processes_render():
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=render_in_child, args=(queue,))
    process.start()
    assert queue.get(timeout=120) is True
    process.join(60)


def test_threads_share_a_scene_with_threads_of_its_own():
    scene = surfel.Scene(threads=2, **SMALL)
    scene.add(surfel.Cloud(hill_points(150)))
    images = []
    work = lambda i: [images.append(scene.render(normals_k=8 + i + 4 * k)) for k in range(3)]
    threads = [threading.Thread(target=work, args=(i,), daemon=True) for i in range(3)]
    [thread.start() for thread in threads]
    [thread.join(120) for thread in threads]
    assert not any(thread.is_alive() for thread in threads)
    assert len(images) == 9 and all(image.coverage.any() for image in images)


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="threads as Linux lists them")
def test_a_scene_starts_no_more_threads_than_it_is_given(hill):
    # Threads that have done their work, and those of scenes that are gone, end some time later.
    code = f"""
import os, surfel, time
def n_threads():
    count = lambda: len(os.listdir("/proc/self/task"))
    counts = [count()]
    while len(counts) < 10 or len(set(counts[-10:])) != 1:
        time.sleep(0.1)
        counts.append(count())
    return counts[-1]
first = surfel.load({str(hill)!r})
first.render(resolution=(8, 8), spp=1)
before = n_threads()
scene = surfel.load({str(hill)!r}, threads=3)
scene.render(resolution=(8, 8), spp=1)
print(n_threads() - before)
"""
    program = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert program.stdout == "3\n", program.stderr


def test_pictures_are_the_same_on_any_number_of_threads(hill):
    one, two = (surfel.load(hill, threads=n).render(**SMALL).color for n in (1, 2))
    assert (one == two).all()
