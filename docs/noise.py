#!/usr/bin/env python3
"""Measures the grain of pictures: the deviation of blocks of 16x16 pixels between four seeds.

    docs/noise.py target/release/surfel FILE... [-- OPTIONS]

Blocks are flat if the means of their 4x4 cells, over all seeds, deviate from a plane by less than 2 steps of 255. The
standard deviation of a block is the square root of the mean variance of its pixels and channels.
"""
import json
import os
import struct
import subprocess
import sys
import tempfile
import zlib

SEEDS = range(4)
SIZE = (960, 540)
BLOCK = 16
CELL = 4
FLAT = 2.0


def read_png(path):
    """Returns the rows of an 8-bit RGB picture."""
    with open(path, "rb") as file:
        data = file.read()
    pos, packed = 8, b""
    while pos < len(data):
        size, kind = struct.unpack(">I4s", data[pos:pos + 8])
        packed += data[pos + 8:pos + 8 + size] if kind == b"IDAT" else b""
        pos += 12 + size
    raw, stride = zlib.decompress(packed), 3 * SIZE[0]
    rows, above = [], bytearray(stride)
    for begin in range(0, len(raw), stride + 1):
        row = bytearray(raw[begin + 1:begin + 1 + stride])
        unfilter(raw[begin], row, above)
        rows.append(row)
        above = row
    return rows


def unfilter(kind, row, above):
    """Undoes the filter of a row in place (PNG specification, section 9)."""
    for i in range(len(row)):
        left, up, corner = (row[i - 3], above[i], above[i - 3]) if 3 <= i else (0, above[i], 0)
        if kind == 4:
            to_left, to_up, to_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
            nearest = left if to_left <= to_up and to_left <= to_corner else up if to_up <= to_corner else corner
        else:
            nearest = (0, left, up, (left + up) // 2)[kind]
        row[i] = (row[i] + nearest) & 255


def measure(pictures, x, y):
    """Returns the standard deviation of a block between pictures, and how far its cells deviate from a plane."""
    n, variance = len(pictures), 0.0
    per_side = BLOCK // CELL
    cells = [[0.0] * per_side for _ in range(per_side)]
    for row in range(BLOCK):
        rows = [picture[y + row] for picture in pictures]
        for column in range(3 * BLOCK):
            values = [values[3 * x + column] for values in rows]
            total = sum(values)
            variance += (sum(value * value for value in values) - total * total / n) / (n - 1)
            cells[row // CELL][column // (3 * CELL)] += total / (n * CELL * CELL * 3)
    offsets = [i - (per_side - 1) / 2 for i in range(per_side)]
    norm = per_side * sum(offset * offset for offset in offsets)
    mean = sum(map(sum, cells)) / per_side**2
    slope_x = sum(dx * value for row in cells for dx, value in zip(offsets, row)) / norm
    slope_y = sum(dy * value for dy, row in zip(offsets, cells) for value in row) / norm
    residuals = [value - mean - slope_x * dx - slope_y * dy
                 for dy, row in zip(offsets, cells) for dx, value in zip(offsets, row)]
    bend = (sum(residual * residual for residual in residuals) / (len(residuals) - 3)) ** 0.5
    return (variance / (3 * BLOCK * BLOCK)) ** 0.5, bend


def render(surfel, file, options, folder):
    """Returns one picture for each seed, and the numbers of one run."""
    pictures, stats = [], None
    for seed in SEEDS:
        path = os.path.join(folder, f"{seed}.png")
        command = [surfel, "render", file, "-o", path, "--seed", str(seed), "--stats", "-",
                   "--resolution", f"{SIZE[0]}x{SIZE[1]}", *options]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        stats = json.loads(output)
        pictures.append(read_png(path))
    return pictures, stats


def quantile(values, fraction):
    return sorted(values)[int(fraction * len(values))] if values else float("nan")


def main():
    end = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    surfel, files, options = sys.argv[1], sys.argv[2:end], sys.argv[end + 1:]
    print("file | flat blocks | median | 95 % | all blocks | median | 95 % | rays per pixel")
    for file in files:
        with tempfile.TemporaryDirectory() as folder:
            pictures, stats = render(surfel, file, options, folder)
        corners = [(x, y) for y in range(0, SIZE[1] - BLOCK + 1, BLOCK) for x in range(0, SIZE[0], BLOCK)]
        # The background does not deviate at all.
        blocks = [block for block in (measure(pictures, *corner) for corner in corners) if 0.02 < block[0]]
        figures = []
        for values in ([dev for dev, bend in blocks if bend < FLAT], [dev for dev, _ in blocks]):
            figures += [str(len(values)), f"{quantile(values, 0.5):.2f}", f"{quantile(values, 0.95):.2f}"]
        rays = sum(stats["rays"].values()) / (SIZE[0] * SIZE[1])
        print(" | ".join([os.path.basename(file), *figures, f"{rays:.1f}"]), flush=True)


if __name__ == "__main__":
    main()
