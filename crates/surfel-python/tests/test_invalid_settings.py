"""Keywords, values and files that make no sense: an exception each time, with the program's words."""

import datetime
import re
import subprocess
import sys

import numpy
import pytest
import surfel


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"camera_postion": (1, 2, 3)}, "nearest known one is `camera.position`"),
        ({"surfce": "smooth"}, "nearest known one is `surface`"),
        ({"resolution": (0, 1)}, "resolution: found"),
        ({"surface": "velvet"}, "surface: found \"velvet\""),
        ({"sun_azimuth": float("nan")}, "sun_azimuth: found NaN"),
        ({"camera": {"position": [1, 2, float("inf")]}}, "found inf, expected a number"),
        ({"color": object()}, "color: found an object of type object"),
        ({"camera_position": (1, 2, 3), "camera_focal_point": (1, 2, 3)}, "focal point"),
        ({"backend": "cuda"}, "backend: found \"cuda\""),
        ({"backend": "cpu", "device": "0"}, "device: names a GPU, and the backend is cpu"),
        ({"window_size": (640, 480)}, "window_size: unknown key; here it is `resolution`"),
    ],
)
def test_wrong_keywords_are_named(hill, keys, words):
    with pytest.raises(surfel.InvalidSetting) as caught:
        surfel.load(hill, **keys)
    assert words in str(caught.value)
    assert isinstance(caught.value, ValueError)


def test_wrong_keywords_of_a_picture_are_named(hill):
    with pytest.raises(surfel.InvalidSetting, match="nearest known one is `resolution`"):
        surfel.load(hill).render(resolutoin=(8, 8))


def test_columns_that_are_not_there_are_named(hill):
    with pytest.raises(surfel.InvalidScene, match="no column intensity"):
        surfel.load(hill, color="intensity")


def test_values_of_numpy_and_dates_are_taken(hill):
    scene = surfel.load(hill, spp=numpy.int64(1), light_samples=2, camera_azimuth_angle=numpy.float32(30))
    date = datetime.datetime(2026, 6, 21, 15, 0, tzinfo=datetime.timezone.utc)
    keys = scene.describe(resolution=numpy.array([32, 24]), sun=date, place=(47.0, 15.0))
    assert keys["resolution"] == "32x24" and keys["spp"] == 1


def test_none_makes_a_key_automatic_again(hill):
    scene = surfel.load(hill, resolution=(32, 24))
    assert scene.describe().get("resolution") == "32x24"
    assert scene.describe(resolution=None).get("resolution") != "32x24"


def test_missing_and_damaged_files_are_named(tmp_path):
    with pytest.raises(surfel.MissingFile, match="nowhere.laz: cannot be read") as caught:
        surfel.load(tmp_path / "nowhere.laz")
    assert isinstance(caught.value, FileNotFoundError)
    damaged = tmp_path / "damaged.ply"
    damaged.write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float x\n")
    with pytest.raises(surfel.InvalidFile, match="damaged.ply"):
        surfel.load(damaged)
    with pytest.raises(surfel.InvalidFile, match="extension"):
        surfel.load(__file__)
    with pytest.raises(surfel.InvalidSetting, match="no objects"):
        surfel.load()


def test_the_memory_limit_is_kept(hill):
    with pytest.raises(surfel.OutOfMemory, match="memory_limit|memory-limit") as caught:
        surfel.load(hill, memory_limit="1M")
    assert isinstance(caught.value, MemoryError)


def test_messages_are_those_of_the_program(hill):
    with pytest.raises(surfel.InvalidFile) as caught:
        surfel.load(__file__)
    words = [sys.executable, "-m", "surfel", "render", __file__, "-o", "x.png"]
    program = subprocess.run(words, capture_output=True, text=True)
    assert program.returncode == 1
    assert str(caught.value) in program.stderr


@pytest.mark.parametrize(
    ("url", "advice"),
    [
        ("https://x.org/a/scan.laz?key=1", r"download it first, as by `urllib.request.urlretrieve\(url, 'scan.laz'\)`"),
        ("s3://bucket/scan.laz", "fsspec.open_local"),
        ("file:///data/scan.laz", "leave out `file://`"),
    ],
)
def test_urls_are_refused_by_name(url, advice):
    for take in (surfel.load, surfel.read_cloud, surfel.prepare, surfel.Scene().add):
        with pytest.raises(surfel.InvalidFile, match=f"^{re.escape(url)}: is a URL, and surfel reads files.*{advice}"):
            take(url)


def test_what_is_no_name_of_a_file_is_told(hill, points):
    with pytest.raises(TypeError, match=r"^surfel.load: found a list, .*surfel.load\(\*paths\)"):
        surfel.load([hill, hill])
    with pytest.raises(TypeError, match=r"^surfel.load: found an object of type ndarray, .*scene.add\(surfel.Cloud\(array\)\)"):
        surfel.load(points)
    with pytest.raises(TypeError, match=r"surfel.read_cloud\(\*paths\)"):
        surfel.read_cloud((hill, hill))


def test_keys_that_are_words_of_the_language_end_with_an_underscore(points, tmp_path):
    n = len(points)
    surfel.Cloud(points, classification=numpy.where(numpy.arange(n) < 100, 2, 6)).save(tmp_path / "hill.laz")
    assert len(surfel.read_cloud(tmp_path / "hill.laz", class_="ground")) == 100
    scene = surfel.load(tmp_path / "hill.laz", class_=6)
    assert scene.describe()["class"] == surfel.load(tmp_path / "hill.laz", **{"class": 6}).describe()["class"]
    with pytest.raises(surfel.InvalidSetting, match="^class: is given twice, also as class_"):
        surfel.load(tmp_path / "hill.laz", class_=6, **{"class": 6})


def test_values_that_hold_themselves_are_refused():
    views, sun, deep = [], {}, 1
    views.append(views)
    sun["azimuth"] = sun
    for _ in range(100):
        deep = numpy.array([deep], dtype=object)
    for keys in ({"views": views}, {"sun": sun}, {"views": deep}):
        with pytest.raises(surfel.InvalidSetting, match="^(views|azimuth): holds more than 64 levels of lists and dicts"):
            surfel.Scene(**keys)
