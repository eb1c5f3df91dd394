"""Files and clouds that tests share."""

import io
import struct
import zlib

import numpy
import pytest


def hill_points(n=50, offset=(0.0, 0.0, 0.0)):
    """Points of a hill of height 0.5 above the square from -1 to 1."""
    x, y = numpy.meshgrid(numpy.linspace(-1, 1, n), numpy.linspace(-1, 1, n))
    z = 0.5 * numpy.exp(-2 * (x * x + y * y))
    return numpy.stack([x.ravel(), y.ravel(), z.ravel()], axis=1) + numpy.asarray(offset)


@pytest.fixture
def points():
    """The points of a hill."""
    return hill_points()


@pytest.fixture(scope="session")
def hill(tmp_path_factory):
    """A file with the points of a hill."""
    path = tmp_path_factory.mktemp("data") / "hill.xyz"
    numpy.savetxt(path, hill_points())
    return path


def pixels_of_png(data):
    """Samples of an 8-bit PNG, (height, width, channels)."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    stream, chunks, header = io.BytesIO(data[8:]), b"", None
    while head := stream.read(8):
        size, kind = struct.unpack(">I4s", head)
        content = stream.read(size)
        stream.read(4)
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", content)
        chunks += content if kind == b"IDAT" else b""
    width, height, depth, color = header[:4]
    assert depth == 8
    return unfiltered(zlib.decompress(chunks), width, height, {0: 1, 2: 3, 4: 2, 6: 4}[color])


def unfiltered(data, width, height, n):
    rows, before = [], bytes(width * n)
    for y in range(height):
        kind, *line = data[y * (width * n + 1) : (y + 1) * (width * n + 1)]
        for i in range(width * n):
            left, up, corner = (line[i - n], before[i], before[i - n]) if i >= n else (0, before[i], 0)
            nearest = min((left, up, corner), key=lambda value: abs(left + up - corner - value))
            line[i] = (line[i] + (0, left, up, (left + up) // 2, nearest)[kind]) & 255
        rows.append(line)
        before = line
    return numpy.array(rows, numpy.uint8).reshape(height, width, n)


def tags_of_tiff(data):
    """Values of the tags of the first picture of a TIFF, as tuples of numbers or as bytes, by the numbers of the tags."""
    order = {b"II": "<", b"MM": ">"}[data[:2]]
    magic, at = struct.unpack_from(order + "HI", data, 2)
    assert magic == 42
    codes = {1: "B", 2: "s", 3: "H", 4: "I", 11: "f", 12: "d"}
    tags = {}
    for i in range(*struct.unpack_from(order + "H", data, at)):
        tag, kind, count = struct.unpack_from(order + "HHI", data, at + 2 + 12 * i)
        if kind in codes:
            place = at + 2 + 12 * i + 8
            layout = f"{order}{count}{codes[kind]}"
            if struct.calcsize(layout) > 4:
                (place,) = struct.unpack_from(order + "I", data, place)
            tags[tag] = struct.unpack_from(layout, data, place)
    return tags
