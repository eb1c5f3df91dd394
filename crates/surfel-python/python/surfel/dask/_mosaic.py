"""One plan of many survey tiles, each rendered with a rim of its neighbours."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import dask
from dask.delayed import Delayed

from surfel._errors import InvalidSetting
from surfel.dask import _worker
from surfel.dask._recipe import Recipe, check_recipe
from surfel.dask._tiles import resolution

#: Points of a tile from which what the recipes leave open is chosen.
N_SURVEYED = 100_000

#: Keys that are chosen from the data and must be the same everywhere, or edges would show.
_SHARED = ("background", "color", "light", "range", "sky", "sun")


def render_mosaic(recipes: Iterable[Recipe], *, rim: float | None = None, format: str = "png") -> Delayed:
    """One plan of survey tiles as `dask.delayed` bytes of a file: of each recipe the tile, with a rim of its neighbours.

    `recipes`: a `Recipe` for each tile, which differ in their files alone, with `gsd`; the plan looks straight down, and
    its edges lie on multiples of `gsd`. `rim`: how far around a tile the points of its neighbours are used, in the unit of
    the coordinates; as far as shadows reach and the sky is darkened if it is left out, at most the size of a tile. What
    the recipes leave open (exposure, range of colours, reach of the sky's shade) is chosen once for all, from points of
    each tile. No machine reads more than a tile and the neighbours that its rim touches. `format="tif"` gives a GeoTIFF.

    Raises `InvalidSetting` for recipes that do not fit together, and for formats that are none of pictures.
    """
    recipes = tuple(recipes)
    _worker.check_format(format)
    _check(recipes, rim)
    survey = dask.delayed(_survey, pure=True)
    layout = dask.delayed(Layout, pure=True)(recipes, [survey(recipe) for recipe in recipes], rim)
    part = dask.delayed(_part, pure=True)
    return dask.delayed(_joined, pure=True)(layout, [part(layout, i) for i in range(len(recipes))], format)


def _check(recipes: tuple[Recipe, ...], rim: float | None) -> None:
    if not recipes:
        raise InvalidSetting("recipes: found none, expected one for each tile")
    for recipe in recipes:
        check_recipe(recipe)
    keys = recipes[0].keys
    for recipe in recipes:
        if recipe.keys != keys:
            raise InvalidSetting(f"recipes: {recipe} has other keywords than {recipes[0]}, expected the same")
    if "gsd" not in keys:
        raise InvalidSetting("recipes: found no gsd, expected the width of a pixel in the unit of the coordinates")
    for key in keys:
        if key.startswith("camera") or key in ("crop", "resolution"):
            raise InvalidSetting(f"{key}: a mosaic shows its tiles as a whole, straight down; leave it out")
    if rim is not None and not 0 <= rim < math.inf:
        raise InvalidSetting(f"rim: found {rim}, expected a length")


def _survey(recipe: Recipe) -> tuple[dict[str, Any], list[list[float]], tuple[float, float] | None]:
    """The properties of a tile: its description, its corners, and the range of its colours."""
    thinned = {"subsample": f"random:{N_SURVEYED}", "up": "+Z"} | recipe.keys
    scene = recipe.derived(recipe.paths, **thinned).scene()
    return scene.describe(), scene.bounds.tolist(), scene._color_range()


class Layout:
    """The layout of the tiles of a mosaic, and the keywords with which all are rendered.

    `windows` has the pixels of each tile's points, `regions` those that are rendered of it, as columns and rows from the
    first to before the second.
    """

    def __init__(self, recipes: tuple[Recipe, ...], surveys: list[Any], rim: float | None) -> None:
        self.recipes = recipes
        gsd = self.gsd = float(recipes[0].keys["gsd"])
        edges = [_edges(description, gsd) for description, _, _ in surveys]
        left, top = min(edge[0] for edge in edges), max(edge[1] for edge in edges)
        self.windows = [((x0 - left, x1 - left), (top - y0, top - y1)) for x0, y0, x1, y1 in edges]
        self.left, self.top = left, top
        self.width = max(columns[1] for columns, _ in self.windows)
        self.height = max(rows[1] for _, rows in self.windows)
        self.keys = _merged(_shared_keys(surveys), recipes[0].keys) | self._camera_keys(surveys)
        self.rim = self._automatic_rim(surveys) if rim is None else float(rim)
        self.regions = self._regions()

    def _camera_keys(self, surveys: list[Any]) -> dict[str, Any]:
        x = self.gsd * (self.left + self.width / 2)
        y = self.gsd * (self.top - self.height / 2)
        cameras = [description["camera"] for description, _, _ in surveys]
        return {
            "resolution": (self.width, self.height),
            "camera_position": (x, y, max(camera["position"][2] for camera in cameras)),
            "camera_focal_point": (x, y, min(camera["focal_point"][2] for camera in cameras)),
            "camera_view_up": (0, 1, 0),
        }

    def _automatic_rim(self, surveys: list[Any]) -> float:
        description = surveys[0][0]
        height = max(high[2] for _, (_, high), _ in surveys) - min(low[2] for _, (low, _), _ in surveys)
        sky = self.keys.get("sky", {})
        reach = sky.get("ao_distance", 0) if isinstance(sky, dict) else 0
        if "sun" in description.get("light", ()):
            elevation = math.radians(max(description["sun"]["elevation"], 1))
            reach = max(reach, height / math.tan(elevation))
        largest = max(max(x1 - x0, y1 - y0) for (x0, x1), (y0, y1) in self.windows)
        return min(max(reach, self.gsd), largest * self.gsd)

    def owners(self) -> Any:
        """The tile that each pixel shows, by its number; -1 where none is near."""
        import numpy

        owners = numpy.full((self.height, self.width), -1, numpy.int32)
        n_pixels = math.ceil(self.rim / self.gsd)
        # The first of several tiles has a pixel, and any that has points there before those that are near.
        for margin in (n_pixels, 0):
            for i in reversed(range(len(self.windows))):
                _grown(owners, self.windows[i], margin)[...] = i
        return owners

    def _regions(self) -> list[Any]:
        import numpy

        owners, n_pixels = self.owners(), math.ceil(self.rim / self.gsd)
        regions = []
        for i, window in enumerate(self.windows):
            own = _grown(owners, window, n_pixels) == i
            columns, rows = (numpy.flatnonzero(own.any(axis=axis)) for axis in (0, 1))
            x0, y0 = (max(0, first - n_pixels) for first, _ in window)
            spans = ((x0 + columns[0], x0 + columns[-1] + 1), (y0 + rows[0], y0 + rows[-1] + 1)) if len(columns) else None
            regions.append(spans and tuple((int(first), int(end)) for first, end in spans))
        return regions

    def recipe(self, i: int) -> Recipe:
        """The recipe of a tile with its rim."""
        area = self._area(self.windows[i])
        near = [j for j, window in enumerate(self.windows) if _overlap(area, self._area(window, 0))]
        paths = dict.fromkeys(path for j in near for path in self.recipes[j].paths)
        return self.recipes[i].derived(paths, **self.keys, crop=area)

    def _area(self, window: Any, rim: float | None = None) -> tuple[float, ...]:
        (x0, x1), (y0, y1) = window
        rim = self.rim if rim is None else rim
        west, east = (self.gsd * (self.left + x) for x in (x0, x1))
        south, north = (self.gsd * (self.top - y) for y in (y1, y0))
        return (west - rim, south - rim, east + rim, north + rim)


def _edges(description: dict[str, Any], gsd: float) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of a tile's plan, in pixels from the origin of the coordinates."""
    width, height = (int(side) for side in description["resolution"].split("x"))
    x, y, _ = description["camera"]["focal_point"]
    left, top = round(x / gsd - width / 2), round(y / gsd + height / 2)
    return left, top, left + width, top - height


def _shared_keys(surveys: list[Any]) -> dict[str, Any]:
    first = surveys[0][0]
    keys = {key: first[key] for key in _SHARED if key in first} | {"up": "+Z"}
    exposures = sorted(description["exposure"] for description, _, _ in surveys)
    keys["exposure"] = exposures[len(exposures) // 2]
    if isinstance(keys.get("sky"), dict):
        distances = [description.get("sky", {}).get("ao_distance", 0) for description, _, _ in surveys]
        keys["sky"] = keys["sky"] | {"ao_distance": max(distances)}
    ranges = [found for _, _, found in surveys if found is not None]
    # A tile may be coloured by no map where another one is.
    if surveys[0][2] is not None and "range" not in keys:
        keys["range"] = (min(low for low, _ in ranges), max(high for _, high in ranges))
    return keys


def _merged(shared: dict[str, Any], keys: dict[str, Any]) -> dict[str, Any]:
    """The keywords of a recipe over those that are chosen for all; a dict leaves what it does not say as it was chosen."""
    both = {key: shared[key] | keys[key] for key in shared.keys() & keys.keys() if _are_dicts(shared[key], keys[key])}
    return shared | keys | both


def _are_dicts(*values: Any) -> bool:
    return all(isinstance(value, dict) for value in values)


def _grown(pixels: Any, window: Any, margin: int) -> Any:
    (x0, x1), (y0, y1) = window
    return pixels[max(0, y0 - margin) : y1 + margin, max(0, x0 - margin) : x1 + margin]


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]


def _part(layout: Layout, i: int) -> Any:
    """The pixels of a tile's region and the classes of its points; none if it has no pixel."""
    region = layout.regions[i]
    if region is None:
        return None
    scene = _worker.scene(layout.recipe(i))
    return scene._render_region(*region), scene._classes()


def _joined(layout: Layout, parts: list[Any], format: str) -> bytes:
    import numpy

    color = numpy.full((layout.height, layout.width, 4), numpy.nan, numpy.float32)
    owners = layout.owners()
    for i, (region, part) in enumerate(zip(layout.regions, parts)):
        if part is not None:
            pixels = slice(*region[1]), slice(*region[0])
            own = owners[pixels] == i
            color[pixels][own] = part[0][own]
    classes = set().union(*(part[1] for part in parts if part is not None))
    first = layout.recipes[0]
    # Of what is drawn over the plan, only the classes depend on the points.
    scene = first.derived(first.paths, **layout.keys | {"subsample": "random:1000"}).scene()
    return _worker.encoded(scene._picture_of(color, sorted(classes)), format)
