"""Pictures on many machines by Dask: frames of a movie, tiles of one picture, or one plan of many survey tiles.

    from dask.distributed import Client
    from surfel.dask import Recipe, render_frames, save_frames

    client = Client("tcp://scheduler:8786")
    recipe = Recipe("/data/scan.laz", turntable=8, resolution=(1280, 720))
    save_frames(recipe, range(200), "movie/frame_####.png")

What travels is the recipe: names of files and keywords. Each worker reads the files, which it must find under the same
names, and keeps the last scenes, as many as `dask.config` grants memory to by `surfel.scene-memory`, as in "8 GiB".
Random numbers come from counters, so that the bytes are those of the program wherever a part is rendered, and whoever
renders it again after a worker is lost.
"""

from surfel.dask._frames import render_frames, save_frames
from surfel.dask._mosaic import render_mosaic
from surfel.dask._recipe import ClusterLost, Recipe, VersionMismatch
from surfel.dask._tiles import render_tiles

__all__ = ["ClusterLost", "Recipe", "VersionMismatch", "render_frames", "render_mosaic", "render_tiles", "save_frames"]
