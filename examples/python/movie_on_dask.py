"""Frames of a movie on a cluster, or on two processes of this machine if no scheduler is named.

    python movie_on_dask.py scan.laz frames/frame_####.png 640x360 200 tcp://scheduler:8786
"""

import pathlib
import sys

from dask.distributed import Client, LocalCluster
from surfel.dask import Recipe, save_frames


def main(scan, pattern, resolution="640x360", frames=200, scheduler=None):
    pathlib.Path(pattern).parent.mkdir(parents=True, exist_ok=True)
    cluster = scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster):
        recipe = Recipe(scan, turntable=8, resolution=resolution)
        names = save_frames(recipe, range(int(frames)), pattern)
    print(f"{len(names)} frames, the last is {names[-1]}")


if __name__ == "__main__":
    main(*sys.argv[1:])
