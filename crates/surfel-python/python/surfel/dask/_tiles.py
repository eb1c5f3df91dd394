"""Tiles of one picture."""

from __future__ import annotations

from typing import Any

import dask
from dask.delayed import Delayed

import surfel
from surfel._errors import InvalidSetting
from surfel.dask import _worker
from surfel.dask._recipe import Recipe, check_recipe


def render_tiles(recipe: Recipe, tiles: int | tuple[int, int] = (4, 4), *, format: str = "png") -> Delayed:
    """One picture of the recipe as `dask.delayed` bytes of a file, rendered in tiles and joined.

    `tiles`: numbers of tiles across and down, or one number of bands of rows. The bytes are those of a picture that is
    rendered whole.

    Raises `InvalidSetting` for other numbers, and for formats that are none of pictures.
    """
    check_recipe(recipe)
    _worker.check_format(format)
    across, down = _counts(tiles)
    render = dask.delayed(_tile, pure=True)
    parts = [render(recipe, (x, y), (across, down)) for y in range(down) for x in range(across)]
    return dask.delayed(_joined, pure=True)(recipe, parts, (across, down), format)


def _counts(tiles: Any) -> tuple[int, int]:
    counts = tuple(tiles) if hasattr(tiles, "__iter__") else (1, tiles)
    if len(counts) != 2 or any(not hasattr(count, "__index__") or count < 1 for count in counts):
        raise InvalidSetting(f"tiles: found {tiles!r}, expected two numbers as in (4, 4), or one number of bands of rows")
    return counts


def resolution(scene: surfel.Scene) -> tuple[int, int]:
    """Width and height of a scene's picture in pixels."""
    width, height = scene.describe()["resolution"].split("x")
    return int(width), int(height)


def _region(scene: surfel.Scene, place: tuple[int, int], counts: tuple[int, int]) -> Any:
    """Columns and rows of a tile, from the first to before the second; empty if there are more tiles than pixels."""
    sizes = resolution(scene)
    return tuple((size * i // n, size * (i + 1) // n) for size, i, n in zip(sizes, place, counts))


def _tile(recipe: Recipe, place: tuple[int, int], counts: tuple[int, int]) -> Any:
    scene = _worker.scene(recipe)
    columns, rows = _region(scene, place, counts)
    if columns[0] == columns[1] or rows[0] == rows[1]:
        return None
    return scene._render_region(columns, rows)


def _joined(recipe: Recipe, parts: list[Any], counts: tuple[int, int], format: str) -> bytes:
    import numpy

    scene = _worker.scene(recipe)
    width, height = resolution(scene)
    color = numpy.empty((height, width, 4), numpy.float32)
    for i, part in enumerate(parts):
        if part is not None:
            (x0, x1), (y0, y1) = _region(scene, (i % counts[0], i // counts[0]), counts)
            color[y0:y1, x0:x1] = part
    return _worker.encoded(scene._picture_of(color), format)
