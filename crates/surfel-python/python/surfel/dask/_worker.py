"""The cache of a worker: prepared scenes and movies, the last used ones, as many as memory allows."""

from __future__ import annotations

import collections
import os
import pathlib
import tempfile
import threading
from collections.abc import Callable
from typing import Any

import dask

import surfel
from surfel._errors import InvalidSetting
from surfel.dask._recipe import Recipe

#: Extensions of the files that pictures are saved to.
FORMATS = ("png", "jpg", "jpeg", "webp", "tif", "tiff", "exr")


def check_format(format: str) -> None:
    """Raises `InvalidSetting` for anything but the extension of a picture."""
    if format not in FORMATS:
        raise InvalidSetting(f"format: found {format!r}, expected one of {', '.join(FORMATS)}")


def scene(recipe: Recipe) -> surfel.Scene:
    """The scene of a recipe, which is made unless it is kept."""
    kept: surfel.Scene = _KEPT.get(("scene", recipe), recipe.scene)
    return kept


def movie(recipe: Recipe) -> surfel.Movie:
    """The movie of a recipe, which is made unless it is kept."""
    kept: surfel.Movie = _KEPT.get(("movie", recipe), lambda: surfel.Movie(recipe.scene()))
    return kept


def encoded(image: surfel.Image, format: str) -> bytes:
    """The bytes of a picture as a file of this format."""
    return bytes_of_file(format, image.save)


def bytes_of_file(format: str, save: Callable[[pathlib.Path], None]) -> bytes:
    """The bytes of the file of this format that `save` writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / f"picture.{format}"
        save(path)
        return path.read_bytes()


def memory_limit() -> int:
    """Bytes that kept scenes may take: `surfel.scene-memory` of `dask.config`, or half of what the worker may have."""
    stated = dask.config.get("surfel.scene-memory", None)
    return int(dask.utils.parse_bytes(stated)) if stated is not None else _memory_of_worker() // 2


def _memory_of_worker() -> int:
    try:
        from distributed import get_worker
        from distributed.system import MEMORY_LIMIT
    except ImportError:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8 << 30
    try:
        return int(get_worker().memory_manager.memory_limit or MEMORY_LIMIT)
    except ValueError:
        return int(MEMORY_LIMIT)


class _Kept:
    """A value, once it is made, and the bytes that it takes."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.value: Any = None
        self.n_bytes = 0


class Cache:
    """The last used values that fit into memory, and the newest even if it does not. Threads share it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: collections.OrderedDict[Any, _Kept] = collections.OrderedDict()

    def get(self, key: Any, make: Callable[[], Any]) -> Any:
        """The value of a key. Threads that want the same one wait until one of them has made it."""
        with self._lock:
            kept = self._kept.setdefault(key, _Kept())
            self._kept.move_to_end(key)
        with kept.lock:
            if kept.value is None:
                kept.value, kept.n_bytes = self._made(key, make)
            return kept.value

    def keys(self) -> list[Any]:
        """The keys of the values, the last used one at the end."""
        with self._lock:
            return list(self._kept)

    def _made(self, key: Any, make: Callable[[], Any]) -> tuple[Any, int]:
        try:
            value = make()
            n_bytes = value._memory_estimate()
        except BaseException:
            with self._lock:
                self._kept.pop(key, None)
            raise
        self._drop_until(memory_limit() - n_bytes, key)
        return value, n_bytes

    def _drop_until(self, limit: int, key: Any) -> None:
        """Drops the values that were used longest ago, until the others but that of `key` fit."""
        with self._lock:
            others = [other for other in self._kept if other != key]
            total = sum(self._kept[other].n_bytes for other in others)
            for other in others:
                if total <= limit:
                    break
                total -= self._kept.pop(other).n_bytes


_KEPT = Cache()
