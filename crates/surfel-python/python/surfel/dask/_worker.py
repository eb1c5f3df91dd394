"""The cache of a worker: prepared scenes and films, the last used ones, as many as memory allows."""

import collections
import os
import pathlib
import tempfile
import threading

import dask

import surfel


def scene(recipe):
    """The scene of a recipe, which is made unless it is kept."""
    return _KEPT.get(("scene", recipe), recipe.scene)


def film(recipe):
    """The film of a recipe, which is made unless it is kept."""
    return _KEPT.get(("film", recipe), lambda: surfel.Film(recipe.scene()))


def encoded(image, format):
    """The bytes of a picture as a file of this format."""
    return bytes_of_file(format, image.save)


def bytes_of_file(format, save):
    """The bytes of the file of this format that `save` writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / f"picture.{format}"
        save(path)
        return path.read_bytes()


def memory_limit():
    """Bytes that kept scenes may take: `surfel.scene-memory` of `dask.config`, or half of what the worker may have."""
    stated = dask.config.get("surfel.scene-memory", None)
    return dask.utils.parse_bytes(stated) if stated is not None else _memory_of_worker() // 2


def _memory_of_worker():
    try:
        from distributed import get_worker
        from distributed.system import MEMORY_LIMIT
    except ImportError:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8 << 30
    try:
        return get_worker().memory_manager.memory_limit or MEMORY_LIMIT
    except ValueError:
        return MEMORY_LIMIT


class _Kept:
    """A value, once it is made, and the bytes that it takes."""

    def __init__(self):
        self.lock = threading.Lock()
        self.value = None
        self.n_bytes = 0


class Cache:
    """The last used values that fit into memory, and the newest even if it does not. Threads share it."""

    def __init__(self):
        self._lock = threading.Lock()
        self._kept = collections.OrderedDict()

    def get(self, key, make):
        """The value of a key. Threads that want the same one wait until one of them has made it."""
        with self._lock:
            kept = self._kept.setdefault(key, _Kept())
            self._kept.move_to_end(key)
        with kept.lock:
            if kept.value is None:
                kept.value, kept.n_bytes = self._made(key, make)
            return kept.value

    def keys(self):
        """The keys of the values, the last used one at the end."""
        with self._lock:
            return list(self._kept)

    def _made(self, key, make):
        try:
            value = make()
            n_bytes = value._memory_estimate()
        except BaseException:
            with self._lock:
                self._kept.pop(key, None)
            raise
        self._drop_until(memory_limit() - n_bytes, key)
        return value, n_bytes

    def _drop_until(self, limit, key):
        """Drops the values that were used longest ago, until the others but that of `key` fit."""
        with self._lock:
            others = [other for other in self._kept if other != key]
            total = sum(self._kept[other].n_bytes for other in others)
            for other in others:
                if total <= limit:
                    break
                total -= self._kept.pop(other).n_bytes


_KEPT = Cache()
