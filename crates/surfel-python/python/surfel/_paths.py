"""Names of files, as users hand them over; what is none is refused with what to do instead."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

from surfel._errors import InvalidFile

_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.:-]+)://")


def file_names(function: str, paths: Iterable[object]) -> list[str]:
    """The names of files that `function` was called with.

    Raises `TypeError` for what is no name, and `InvalidFile` for URLs.
    """
    return [_file_name(function, path) for path in paths]


def _file_name(function: str, path: object) -> str:
    if isinstance(path, (list, tuple, set, frozenset)):
        kind = type(path).__name__
        raise TypeError(f"{function}: found a {kind}, expected the names of files one by one: {function}(*paths)")
    if not isinstance(path, (str, os.PathLike)):
        advice = "arrays are shown by scene = surfel.Scene(); scene.add(surfel.Cloud(array))"
        raise TypeError(f"{function}: found an object of type {type(path).__name__}, expected the name of a file; {advice}")
    return local_name(path)


def local_name(path: str | os.PathLike[str]) -> str:
    """The name of a file of this machine. Raises `InvalidFile` for URLs."""
    name = os.fspath(path)
    url = _URL.match(name)
    if url is None:
        return name
    if url[1].lower() == "file":
        advice = "leave out `file://`"
    elif url[1].lower() in ("http", "https", "ftp"):
        short = name.partition("?")[0].rstrip("/").rpartition("/")[2]
        advice = f"download it first, as by `urllib.request.urlretrieve(url, {short!r})`"
    else:
        advice = 'download it first, as by `fsspec.open_local("simplecache::" + url)`'
    raise InvalidFile(f"{name}: is a URL, and surfel reads files of this machine; {advice}")
