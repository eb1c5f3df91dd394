"""Measures how much faster two workers of a local Dask cluster render a movie than one, with a thread each.

    python docs/cluster_speed.py scan.ply [--frames 20] [--resolution 960x540] [--spp 4]

Start-up does not count: each worker reads and prepares the scene before the clock runs. Its time is printed beside.
"""

import argparse
import time

from dask import compute
from distributed import Client, LocalCluster
from surfel.dask import Recipe, _worker, render_frames


def seconds_of_movie(recipe, n_frames, n_workers):
    """Seconds of preparation on the slowest worker, seconds of the movie, and its frames."""
    cluster = LocalCluster(n_workers=n_workers, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        start = time.perf_counter()
        client.run(_prepare, recipe)
        prepared = time.perf_counter()
        frames = compute(*render_frames(recipe, range(n_frames)), scheduler=client)
        return prepared - start, time.perf_counter() - prepared, frames


def _prepare(recipe):
    """Makes the movie of a recipe, which the worker keeps."""
    _worker.movie(recipe)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scan")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--resolution", default="960x540")
    parser.add_argument("--spp", type=int, default=4)
    args = parser.parse_args()
    keys = {"resolution": args.resolution, "spp": args.spp, "fps": args.frames, "threads": 1}
    recipe = Recipe(args.scan, turntable=1, **keys)
    one, two = (seconds_of_movie(recipe, args.frames, n_workers) for n_workers in (1, 2))
    assert one[2] == two[2], "the frames depend on the number of workers"
    for name, (preparation, movie, _) in (("1 worker", one), ("2 workers", two)):
        print(f"{name}: {preparation:.1f} s of preparation, {movie:.1f} s of {args.frames} frames")
    with_preparation = (one[0] + one[1]) / (two[0] + two[1])
    print(f"{one[1] / two[1]:.2f} times faster, {with_preparation:.2f} times with the preparation")


if __name__ == "__main__":
    main()
