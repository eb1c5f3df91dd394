"""The description of a scene as it travels: names of files and keywords."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from typing import Any

import surfel
from surfel._errors import Error
from surfel._native import _plain, _unread
from surfel._paths import file_names


class VersionMismatch(Error):
    """A worker has another version of surfel than the one that made a recipe."""


class ClusterLost(Error):
    """The scheduler is gone, or has cancelled the work."""

    ADVICE = "the scheduler is gone or has cancelled the work; start it and do the same again: finished frames are kept"

    def __init__(self, message: str = ADVICE) -> None:
        super().__init__(message)


# Tracebacks name them as users import them.
VersionMismatch.__module__ = ClusterLost.__module__ = "surfel.dask"


class Recipe:
    """Files and keywords of `surfel.load`, which are read where they are rendered.

    Relative names start where the recipe is made, also those of keywords, as `environment`. Recipes with the same files
    and keywords are equal.

    Raises `InvalidSetting` for unknown keywords and wrong values, `InvalidFile` for URLs.
    """

    paths: tuple[str, ...]
    keys: dict[str, Any]
    version: str

    def __init__(self, *paths: str | os.PathLike[str], **keys: Any) -> None:
        self.paths = tuple(os.path.abspath(name) for name in file_names("Recipe", paths))
        self.keys = _plain(**keys)
        self.version = surfel.__version__

    def scene(self) -> surfel.Scene:
        """The scene of the recipe; its files are read when they are needed.

        Raises `VersionMismatch` where another version of surfel made the recipe.
        """
        if self.version != surfel.__version__:
            message = f"{_place()} has surfel {surfel.__version__}, and the recipe was made by surfel {self.version}"
            raise VersionMismatch(f"{message}; install the same version on all machines")
        return _unread(*self.paths, **self.keys)

    def derived(self, paths: Iterable[str], **keys: Any) -> Recipe:
        """A recipe of the same version with other files, and with these keywords besides."""
        return _restored(self.version, tuple(paths), self.keys | _plain(**keys))

    def _identity(self) -> str:
        return json.dumps((self.version, self.paths, self.keys), sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Recipe) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())

    def __dask_tokenize__(self) -> tuple[str, str]:
        return ("surfel.Recipe", self._identity())

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.version, self.paths, self.keys)

    def __repr__(self) -> str:
        return f"<surfel.dask.Recipe of {', '.join(self.paths)}>"


def check_recipe(recipe: object) -> None:
    """Raises `TypeError` for anything but a recipe."""
    if isinstance(recipe, Recipe):
        return
    found = repr(recipe) if isinstance(recipe, (str, os.PathLike)) else f"an object of type {type(recipe).__name__}"
    raise TypeError(f"recipe: found {found}, expected a surfel.dask.Recipe, as Recipe('scan.laz', spp=4)")


def _restored(version: str, paths: tuple[str, ...], keys: dict[str, Any]) -> Recipe:
    """A recipe as it was made; keywords of another version may be unknown here."""
    recipe = Recipe.__new__(Recipe)
    recipe.version, recipe.paths, recipe.keys = version, paths, keys
    return recipe


def _place() -> str:
    """The worker that runs this, by its name and address."""
    try:
        from distributed import get_worker

        worker = get_worker()
    except (ImportError, ValueError):
        return "this process"
    return f"worker {worker.name} at {worker.address}"
