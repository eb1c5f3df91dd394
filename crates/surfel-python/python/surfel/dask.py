"""Pictures on many machines by Dask: frames of a film, or rows of one picture.

    from dask.distributed import Client
    from surfel.dask import Recipe, render_frames, save_frames

    client = Client("tcp://scheduler:8786")
    recipe = Recipe("/data/scan.laz", turntable=8, resolution=(1280, 720))
    save_frames(recipe, range(200), "film/frame_####.png")

What travels is the recipe: names of files and keywords. Each worker reads the files, which it must find under the same
names, and keeps the last scenes. Random numbers come from counters, so that the bytes are those of the program wherever
a part is rendered, and whoever renders it again after a worker is lost.
"""

import functools
import os
import pathlib
import re
import tempfile

import dask

import surfel
from surfel._errors import Error, InvalidSetting

__all__ = ["Recipe", "VersionMismatch", "render_frames", "render_tiles", "save_frames"]

#: Number of scenes that a worker keeps.
MAX_SCENES = 2


class VersionMismatch(Error):
    """A worker has another version of surfel than the one that made a recipe."""


class Recipe:
    """Files and keywords of `surfel.load`, which are read where they are rendered.

    Relative names start where the recipe is made. Recipes with the same files and keywords are equal.
    """

    def __init__(self, *paths, **keys):
        self.paths = tuple(os.path.abspath(os.fspath(path)) for path in paths)
        self.keys = keys

    def scene(self):
        """The scene of the recipe, as `surfel.load` opens it."""
        return surfel.load(*self.paths, **self.keys)

    def _identity(self):
        return repr((self.paths, sorted(self.keys.items())))

    def __eq__(self, other):
        return isinstance(other, Recipe) and self._identity() == other._identity()

    def __hash__(self):
        return hash(self._identity())

    def __dask_tokenize__(self):
        return ("surfel.Recipe", surfel.__version__, self._identity())

    def __reduce__(self):
        return _restored, (surfel.__version__, self.paths, self.keys)

    def __repr__(self):
        return f"<surfel.dask.Recipe of {', '.join(self.paths)}>"


def render_frames(recipe, frames, *, format="png"):
    """Frames of the recipe's film as a list of `dask.delayed` bytes, each a file of this format.

    `frames`: indices from 0, as `range(100)`. The recipe needs `turntable`, or a scene that moves.
    """
    render = dask.delayed(_frame, pure=True)
    return [render(recipe, int(index), format) for index in frames]


def save_frames(recipe, frames, pattern):
    """Renders frames and writes each to a file, `####` in whose name is its number from 1; returns the names.

    Files that are there already are kept, so that an interrupted film goes on.

    Raises `InvalidSetting` for a pattern without `#`.
    """
    pattern = os.fspath(pattern)
    if "#" not in os.path.basename(pattern):
        raise InvalidSetting("pattern: found no #, expected a name as in frame_####.png")
    names = {index: _frame_name(pattern, index) for index in frames}
    missing = [index for index, name in names.items() if not os.path.exists(name)]
    pictures = render_frames(recipe, missing, format=pathlib.Path(pattern).suffix[1:])
    save = dask.delayed(_replace)
    dask.compute(*(save(names[index], picture) for index, picture in zip(missing, pictures)))
    return list(names.values())


def render_tiles(recipe, tiles=16, *, format="png"):
    """One picture of the recipe as `dask.delayed` bytes of a file: `tiles` bands of rows, rendered apart and joined.

    The bytes are those of a picture that is rendered whole.
    """
    height = _resolution(recipe)[1]
    tiles = max(1, min(int(tiles), height))
    edges = [height * i // tiles for i in range(tiles + 1)]
    render = dask.delayed(_rows, pure=True)
    bands = [render(recipe, first, end) for first, end in zip(edges, edges[1:])]
    return dask.delayed(_joined, pure=True)(recipe, bands, format)


def _restored(version, paths, keys):
    if version != surfel.__version__:
        raise VersionMismatch(f"the recipe was made by surfel {version}, and here is {surfel.__version__}; install the same")
    return Recipe(*paths, **keys)


@functools.lru_cache(MAX_SCENES)
def _scene(recipe):
    return recipe.scene()


@functools.lru_cache(MAX_SCENES)
def _film(recipe):
    return surfel.Film(_scene(recipe))


def _frame(recipe, index, format):
    # A film ends where the recipe says; an index beyond is the caller's mistake.
    return _encoded(_film(recipe).render(index), format)


def _rows(recipe, first, end):
    return _scene(recipe)._render_rows(first, end)


def _joined(recipe, bands, format):
    import numpy

    return _encoded(_scene(recipe)._picture_of_rows(numpy.concatenate(bands)), format)


def _encoded(image, format):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / f"picture.{format}"
        image.save(path)
        return path.read_bytes()


def _resolution(recipe):
    found = recipe.keys.get("resolution", (1920, 1080))
    sides = re.split("[x,]", found) if isinstance(found, str) else found
    return tuple(int(side) for side in sides)


def _frame_name(pattern, index):
    folder, name = os.path.split(pattern)
    return os.path.join(folder, re.sub("#+", lambda hashes: str(index + 1).zfill(len(hashes[0])), name, count=1))


def _replace(name, content):
    """Writes a file beside its name first, so that no half file is ever under it."""
    with tempfile.NamedTemporaryFile(dir=os.path.dirname(name) or ".", delete=False) as file:
        file.write(content)
    os.replace(file.name, name)
