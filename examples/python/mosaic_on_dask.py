"""One plan of all tiles of a survey, each rendered with a rim of its neighbours, on a cluster or on this machine.

    python mosaic_on_dask.py "tiles/*.laz" plan.tif 0.25 tcp://scheduler:8786

The last two words are the width of a pixel and the scheduler; without one, two processes of this machine render.
"""

import glob
import pathlib
import sys

from dask.distributed import Client, LocalCluster
from surfel.dask import Recipe, render_mosaic


def main(tiles, output, gsd=0.25, scheduler=None):
    cluster = scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    recipes = [Recipe(tile, gsd=float(gsd)) for tile in sorted(glob.glob(tiles))]
    with Client(cluster):
        plan = render_mosaic(recipes, format=pathlib.Path(output).suffix[1:]).compute()
    pathlib.Path(output).write_bytes(plan)
    print(f"{len(recipes)} tiles, {len(plan)} bytes")


if __name__ == "__main__":
    main(*sys.argv[1:])
