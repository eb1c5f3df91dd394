"""A scan as a finished picture: everything that is not said is chosen from the data.

    python scan_to_picture.py scan.laz scan.png
"""

import sys

import surfel


def main(scan, output, resolution="1920x1080"):
    image = surfel.load(scan).render(resolution=resolution)
    image.save(output)
    print("\n".join(image.choices))


if __name__ == "__main__":
    main(*sys.argv[1:])
