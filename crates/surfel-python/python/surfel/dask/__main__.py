"""Renders frames for the program: reads a job as JSON from stdin, writes frames to stdout, messages to stderr.

A frame is a line with its index and its number of bytes, and the bytes of its file. `surfel animate --cluster` runs this.
"""

import concurrent.futures
import json
import sys
from typing import Any

from distributed import Client

from surfel.dask import ClusterLost, Recipe, render_frames
from surfel.dask._frames import completed


def main() -> int:
    """Renders a job; returns the exit code."""
    job = json.load(sys.stdin)
    recipe = Recipe(*job["files"], _scene=job["scene"])
    try:
        with Client(job["address"]) as client:
            write_frames(client, recipe, job)
    except KeyboardInterrupt:
        return 130
    except concurrent.futures.CancelledError:
        print(ClusterLost(), file=sys.stderr)
        return 1
    except Exception as error:
        print(str(error).splitlines()[0] if str(error) else repr(error), file=sys.stderr)
        return 1
    return 0


def write_frames(client: Client, recipe: Recipe, job: dict[str, Any]) -> None:
    """Writes frames in the order in which they are finished."""
    pictures = render_frames(recipe, job["frames"], format=job["format"])
    for index, content in completed(client, job["frames"], pictures):
        sys.stdout.buffer.write(b"%d %d\n" % (index, len(content)))
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    sys.exit(main())
