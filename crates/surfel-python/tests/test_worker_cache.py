"""The cache of workers: the last used scenes that fit into memory."""

import threading
import time

import pytest

dask = pytest.importorskip("dask")
from surfel.dask import Recipe  # noqa: E402
from surfel.dask._worker import Cache, memory_limit  # noqa: E402


class Value:
    """A value that states its size."""

    def __init__(self, n_bytes):
        self.n_bytes = n_bytes

    def _memory_estimate(self):
        return self.n_bytes


def limited(n_bytes):
    return dask.config.set({"surfel.scene-memory": n_bytes})


def test_the_last_used_values_that_fit_are_kept():
    cache, made = Cache(), []

    def get(key, n_bytes=40):
        return cache.get(key, lambda: made.append(key) or Value(n_bytes))

    with limited(100):
        for key in "ababcbca":
            assert get(key) is get(key)
        assert "".join(made) == "abca"
        assert cache.keys() == ["c", "a"]
        # One that is larger than the limit is alone.
        get("large", 500)
        assert cache.keys() == ["large"]
        get("a")
        assert cache.keys() == ["a"]


def test_failures_are_not_kept():
    cache = Cache()
    for _ in range(2):
        with pytest.raises(OSError):
            cache.get("a", lambda: (_ for _ in ()).throw(OSError()))
    assert cache.keys() == []
    assert cache.get("a", lambda: Value(1)).n_bytes == 1


def test_threads_make_a_value_once():
    cache, made = Cache(), []

    def make():
        time.sleep(0.05)
        made.append(1)
        return Value(1)

    threads = [threading.Thread(target=cache.get, args=("a", make)) for _ in range(8)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert made == [1]


def test_limits_are_read_from_the_configuration():
    with limited("2 GiB"):
        assert memory_limit() == 2 << 30
    assert memory_limit() > 1 << 28


def test_scenes_and_movies_state_their_memory(hill):
    import surfel

    scene = Recipe(hill, turntable=1).scene()
    # 2500 points: columns as read and as prepared, block and tree.
    assert 2500 * 60 < scene._memory_estimate() < 2500 * 200
    assert surfel.Movie(scene, resolution=(8, 8))._memory_estimate() == scene._memory_estimate()
