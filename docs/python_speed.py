"""Measures the Python package beside the program, by processor time, which other programs disturb least.

    python docs/python_speed.py scan.ply [rays]

With `rays`, rays alone are measured.
"""

import json
import resource
import statistics
import subprocess
import sys
import time

import numpy
import surfel

RUNS = 3
RENDER = "import sys, surfel; surfel.load(sys.argv[1]).render(resolution=(960, 540), layers=False).save(sys.argv[2])"


def seconds_of_import():
    code = "import time; t = time.perf_counter(); import surfel; print(time.perf_counter() - t)"
    return min(float(subprocess.check_output([sys.executable, "-c", code])) for _ in range(RUNS))


def seconds_of_cloud(n=10_000_000):
    points = numpy.random.default_rng(1).random((n, 3), dtype=numpy.float32)
    seconds = []
    for _ in range(RUNS):
        start = time.perf_counter()
        surfel.Cloud(points)
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def rates_of_rays(scan, threads=2):
    """Million rays a second: of `cast_rays`, arrays included, and of `surfel bench`, for the same camera."""
    scene = surfel.load(scan, resolution=(1024, 1024), threads=threads)
    camera = scene.describe()["camera"]
    place = (camera["view_angle"], camera["focal_point"], camera["position"], camera["view_up"])
    rays = surfel.create_rays_pinhole(*place, 1024, 1024)
    bench = ["surfel", "bench", scan, "--rays", "surface", "--runs", "1", "--json", "--quiet", "--threads", str(threads)]
    scene.cast_rays(rays)
    ours, theirs = [], []
    for _ in range(RUNS):
        start = time.process_time()
        scene.cast_rays(rays)
        ours.append(threads * len(rays.reshape(-1, 6)) / (time.process_time() - start) / 1e6)
        theirs.append(_rate(json.loads(subprocess.check_output(bench))))
    return statistics.median(ours), statistics.median(theirs)


def _rate(report):
    if isinstance(report, list):
        return next(filter(None, map(_rate, report)), None)
    if isinstance(report, dict):
        return report.get("median_mrays_per_s") or _rate(list(report.values()))
    return None


def seconds_of_picture(scan):
    """Processor seconds of `load` and `render`, and of the program."""
    library = [sys.executable, "-c", RENDER, scan, "library.png"]
    program = ["surfel", "render", scan, "-o", "program.png", "--resolution", "960x540", "--quiet"]
    return [statistics.median(_processor_seconds(words) for _ in range(RUNS)) for words in (library, program)]


def _processor_seconds(words):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def print_rays(scan):
    ours, theirs = rates_of_rays(scan)
    print(f"cast_rays and surfel bench: {ours:.2f} and {theirs:.2f} million rays a second ({100 * ours / theirs:.1f} %)")


if __name__ == "__main__":
    scan, *only = sys.argv[1:]
    if only == ["rays"]:
        print_rays(scan)
        sys.exit()
    print(f"import surfel: {1000 * seconds_of_import():.0f} ms")
    print(f"Cloud of 10 million points of float32: {seconds_of_cloud():.2f} s")
    print_rays(scan)
    print("load and render, and the program: {:.2f} and {:.2f} s of processor time".format(*seconds_of_picture(scan)))
