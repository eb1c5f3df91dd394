"""Frames of a movie."""

from __future__ import annotations

import concurrent.futures
import contextlib
import hashlib
import os
import pathlib
import re
import uuid
from collections.abc import Iterable, Iterator
from typing import Any

import dask
from dask.delayed import Delayed

from surfel._errors import InaccessibleFile, InvalidSetting
from surfel.dask import _worker
from surfel.dask._recipe import ClusterLost, Recipe, check_recipe


def render_frames(recipe: Recipe, frames: Iterable[int], *, format: str = "png") -> list[Delayed]:
    """Frames of the recipe's movie as a list of `dask.delayed` bytes, each a file of this format.

    `frames`: indices from 0, as `range(100)`. The recipe needs `turntable`, or a scene that moves.

    Raises `InvalidSetting` for negative indices and for formats that are none of pictures.
    """
    check_recipe(recipe)
    _worker.check_format(format)
    render = dask.delayed(_frame, pure=True)
    return [render(recipe, index, format) for index in _indices(frames)]


def _indices(frames: Iterable[int]) -> list[int]:
    if not hasattr(frames, "__iter__"):
        raise InvalidSetting(f"frames: found {frames!r}, expected indices from 0, as range(100)")
    indices = [int(index) for index in frames]
    if indices and min(indices) < 0:
        raise InvalidSetting(f"frames: found {min(indices)}, expected indices from 0, as range(100)")
    return indices


def save_frames(recipe: Recipe, frames: Iterable[int], pattern: str | os.PathLike[str]) -> list[str]:
    """Renders frames and writes each to a file of this machine, `####` in whose name is its number from 1.

    Returns the names. Frames that a call with the same recipe has written are kept, so that an interrupted movie goes on;
    the file `.PATTERN.recipe` beside them lists them.

    Raises `InvalidSetting` for a pattern without `#` and as `render_frames` does, `InaccessibleFile` if there is no such
    folder or a file cannot be written, and `ClusterLost` if the scheduler vanishes.
    """
    check_recipe(recipe)
    pattern = os.path.abspath(os.fspath(pattern))
    folder, name = os.path.split(pattern)
    if "#" not in name:
        raise InvalidSetting("pattern: found no #, expected a name as in frame_####.png")
    if not os.path.isdir(folder):
        raise InaccessibleFile(f"{pattern}: cannot be written: there is no folder `{folder}`; create it first")
    format = pathlib.Path(pattern).suffix[1:]
    _worker.check_format(format)
    names = {index: _frame_name(pattern, index) for index in _indices(frames)}
    log = _FrameLog(pattern, recipe)
    missing = [index for index, name in names.items() if index not in log.done or not os.path.exists(name)]
    pictures = render_frames(recipe, missing, format=format)
    client = getattr(dask.base.get_scheduler(), "__self__", None)
    if client is None:
        # Threads and processes of this machine, which need not hand the bytes on.
        save = dask.delayed(_write)
        dask.compute(*(save(log.file, index, names[index], picture) for index, picture in zip(missing, pictures)))
        return list(names.values())
    try:
        for index, content in completed(client, missing, pictures):
            _write(log.file, index, names[index], content)
    except concurrent.futures.CancelledError as error:
        raise ClusterLost() from error
    return list(names.values())


def completed(client: Any, indices: Iterable[int], pictures: list[Delayed]) -> Iterator[tuple[int, bytes]]:
    """Pairs of an index and the bytes of its picture, in the order in which a cluster finishes them."""
    from distributed import as_completed

    futures = client.compute(pictures)
    index_of = dict(zip(futures, indices))
    for future, content in as_completed(futures, with_results=True):
        # Where the scheduler has vanished, the error stands in place of the bytes.
        if isinstance(content, concurrent.futures.CancelledError):
            raise content
        yield index_of[future], content
        # The workers need not keep it.
        future.release()


def _frame(recipe: Recipe, index: int, format: str) -> bytes:
    # A movie ends where the recipe says; an index beyond is the caller's mistake.
    movie = _worker.movie(recipe)
    return _worker.bytes_of_file(format, lambda path: movie._save(index, path))


def _frame_name(pattern: str, index: int) -> str:
    folder, name = os.path.split(pattern)
    return os.path.join(folder, re.sub("#+", lambda hashes: str(index + 1).zfill(len(hashes[0])), name, count=1))


class _FrameLog:
    """The frames of a pattern that are those of a recipe: a file with the recipe's hash, then the number of each frame.

    A picture alone does not prove that its frame is done: it may be that of another recipe.
    """

    def __init__(self, pattern: str, recipe: Recipe) -> None:
        folder, name = os.path.split(pattern)
        self.file = os.path.join(folder, f".{name}.recipe")
        digest = hashlib.sha256(recipe._identity().encode()).hexdigest()
        try:
            with open(self.file, encoding="ascii", errors="replace") as file:
                known, *numbers = file.read().split("\n")
        except FileNotFoundError:
            known, numbers = "", []
        except OSError as error:
            raise InaccessibleFile(f"{self.file}: cannot be read: {error.strerror}") from error
        # The last line may be half a number.
        numbers = numbers[:-1] if known == digest else []
        self.done = {int(number) - 1 for number in numbers if number.isdecimal()}
        lines = [digest, *(str(index + 1) for index in sorted(self.done)), ""]
        _replace(self.file, "\n".join(lines).encode())


def _write(log: str, index: int, name: str, content: bytes) -> None:
    """Writes a frame, then its number into the log."""
    _replace(name, content)
    try:
        with open(log, "a", encoding="ascii") as file:
            file.write(f"{index + 1}\n")
    except OSError as error:
        raise InaccessibleFile(f"{log}: cannot be written: {error.strerror}") from error


def _replace(name: str, content: bytes) -> None:
    """Writes a file beside its name first, so that no half file is ever under it."""
    beside = f"{name}.{uuid.uuid4().hex}.part"
    try:
        with open(beside, "xb") as file:
            file.write(content)
        os.replace(beside, name)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.remove(beside)
        raise InaccessibleFile(f"{name}: cannot be written: {error.strerror}") from error
