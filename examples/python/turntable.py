"""A movie that turns a scan once in eight seconds.

    python turntable.py scan.laz turn.gif
"""

import sys

import surfel


def main(scan, output, resolution="640x360", frames=200):
    surfel.animate(surfel.load(scan), output, frames=int(frames), turntable=8, resolution=resolution, progress=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
