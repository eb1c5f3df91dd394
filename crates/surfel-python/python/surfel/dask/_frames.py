"""Frames of a film."""

import concurrent.futures
import os
import pathlib
import re
import tempfile

import dask

from surfel._errors import InvalidSetting
from surfel.dask import _worker
from surfel.dask._recipe import ClusterLost


def render_frames(recipe, frames, *, format="png"):
    """Frames of the recipe's film as a list of `dask.delayed` bytes, each a file of this format.

    `frames`: indices from 0, as `range(100)`. The recipe needs `turntable`, or a scene that moves.
    """
    render = dask.delayed(_frame, pure=True)
    return [render(recipe, int(index), format) for index in frames]


def save_frames(recipe, frames, pattern):
    """Renders frames and writes each to a file, `####` in whose name is its number from 1; returns the names.

    Files that are there already are kept, so that an interrupted film goes on.

    Raises `InvalidSetting` for a pattern without `#`, and `ClusterLost` if the scheduler vanishes.
    """
    pattern = os.fspath(pattern)
    if "#" not in os.path.basename(pattern):
        raise InvalidSetting("pattern: found no #, expected a name as in frame_####.png")
    names = {index: _frame_name(pattern, index) for index in frames}
    missing = [index for index, name in names.items() if not os.path.exists(name)]
    pictures = render_frames(recipe, missing, format=pathlib.Path(pattern).suffix[1:])
    save = dask.delayed(_replace)
    try:
        dask.compute(*(save(names[index], picture) for index, picture in zip(missing, pictures)))
    except concurrent.futures.CancelledError as error:
        raise ClusterLost() from error
    return list(names.values())


def _frame(recipe, index, format):
    # A film ends where the recipe says; an index beyond is the caller's mistake.
    film = _worker.film(recipe)
    return _worker.bytes_of_file(format, lambda path: film._save(index, path))


def _frame_name(pattern, index):
    folder, name = os.path.split(pattern)
    return os.path.join(folder, re.sub("#+", lambda hashes: str(index + 1).zfill(len(hashes[0])), name, count=1))


def _replace(name, content):
    """Writes a file beside its name first, so that no half file is ever under it."""
    with tempfile.NamedTemporaryFile(dir=os.path.dirname(name) or ".", delete=False) as file:
        file.write(content)
    os.replace(file.name, name)
