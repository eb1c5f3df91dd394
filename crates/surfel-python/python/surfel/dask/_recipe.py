"""The description of a scene as it travels: names of files and keywords."""

import json
import os

import surfel
from surfel._errors import Error
from surfel._native import _plain, _unread


class VersionMismatch(Error):
    """A worker has another version of surfel than the one that made a recipe."""


class ClusterLost(Error):
    """The scheduler is gone, or has cancelled the work."""

    ADVICE = "the scheduler is gone or has cancelled the work; start it and do the same again: finished frames are kept"

    def __init__(self, message=ADVICE):
        super().__init__(message)


class Recipe:
    """Files and keywords of `surfel.load`, which are read where they are rendered.

    Relative names start where the recipe is made, also those of keywords, as `environment`. Recipes with the same files
    and keywords are equal.

    Raises `InvalidSetting` for values that no scene file can hold.
    """

    def __init__(self, *paths, **keys):
        self.paths = tuple(os.path.abspath(os.fspath(path)) for path in paths)
        self.keys = _plain(**keys)
        self.version = surfel.__version__

    def scene(self):
        """The scene of the recipe; its files are read when they are needed.

        Raises `VersionMismatch` where another version of surfel made the recipe.
        """
        if self.version != surfel.__version__:
            message = f"{_place()} has surfel {surfel.__version__}, and the recipe was made by surfel {self.version}"
            raise VersionMismatch(f"{message}; install the same version on all machines")
        return _unread(*self.paths, **self.keys)

    def derived(self, paths, **keys):
        """A recipe of the same version with other files, and with these keywords besides."""
        return _restored(self.version, tuple(paths), {**self.keys, **keys})

    def _identity(self):
        return json.dumps((self.version, self.paths, sorted(self.keys.items())))

    def __eq__(self, other):
        return isinstance(other, Recipe) and self._identity() == other._identity()

    def __hash__(self):
        return hash(self._identity())

    def __dask_tokenize__(self):
        return ("surfel.Recipe", self._identity())

    def __reduce__(self):
        return _restored, (self.version, self.paths, self.keys)

    def __repr__(self):
        return f"<surfel.dask.Recipe of {', '.join(self.paths)}>"


def _restored(version, paths, keys):
    recipe = Recipe(*paths, **keys)
    recipe.version = version
    return recipe


def _place():
    """The worker that runs this, by its name and address."""
    try:
        from distributed import get_worker

        worker = get_worker()
    except (ImportError, ValueError):
        return "this process"
    return f"worker {worker.name} at {worker.address}"
